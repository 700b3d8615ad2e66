"""Linear regression for mechanics: smoothing, differentiation, decimation, base parameters.

The inverse dynamics of a rigid robot are linear in its inertial and friction parameters, so that sampled
torque and motion give them by least squares (Gautier and Khalil 1990; Janot, Vandanjon and Gautier 2014).
The steps, each a pure function: smooth the position forward and backward, differentiate it by central
differences, decimate every column of the regressor and the torque by one and the same filter.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import FloatArray, IntArray
from robid_core.errors import DataRejected

# MATLAB's `decimate`: Chebyshev type I of order 8, 0.05 dB ripple, edge at 0.8 of the new Nyquist frequency.
DECIMATION_ORDER, DECIMATION_RIPPLE_DB, DECIMATION_EDGE = 8, 0.05, 0.8


def smooth(values: FloatArray, sample_time: float, cutoff_hz: float, order: int = 4) -> FloatArray:
    """Butterworth low-pass, forward and backward: no phase, squared amplitude response.

    Parameters
    ----------
    values
        Samples along the first axis, shape (n_sample, ...).
    sample_time
        Time between samples, s.
    cutoff_hz
        Edge of the one-way filter; the amplitude is halved there (-6 dB after both passes).
    order
        Order of the one-way filter.

    Raises
    ------
    DataRejected
        If the edge is not below the Nyquist frequency or the signal is shorter than the filter's start-up.
    """
    nyquist = 0.5 / sample_time
    if not 0 < cutoff_hz < nyquist:
        raise DataRejected(
            f"a low-pass at {cutoff_hz:g} Hz asks for a sampling rate above {2 * cutoff_hz:g} Hz, the data have "
            f"{2 * nyquist:g} Hz; lower the cut-off"
        )
    padding = 3 * order
    _ask_length(values, padding, "smooth")
    sections = scipy.signal.butter(order, cutoff_hz / nyquist, output="sos")
    result: FloatArray = scipy.signal.sosfiltfilt(sections, values, axis=0, padtype="odd", padlen=padding)
    return result


def differentiate(values: FloatArray, sample_time: float) -> FloatArray:
    """Time derivative by central differences along the first axis (one-sided at both ends), same shape."""
    _ask_length(values, 2, "differentiate")
    result: FloatArray = np.gradient(values, sample_time, axis=0)
    return result


def decimate(values: FloatArray, factor: int) -> FloatArray:
    """Low-pass and keep every `factor`-th sample along the first axis, as MATLAB's `decimate` does.

    Chebyshev I of order 8, forward and backward; the last sample is always kept. Everything that enters one
    regression must pass here together: torque and motion behind different filters would not fit each other.
    """
    if factor == 1:
        return values
    _ask_length(values, 3 * DECIMATION_ORDER, "decimate")
    n_sample = values.shape[0]
    sections, padding = _low_pass(factor), 3 * DECIMATION_ORDER
    filtered = scipy.signal.sosfiltfilt(sections, values, axis=0, padtype="odd", padlen=padding)
    result: FloatArray = filtered[decimated_index(n_sample, factor)]
    return result


@functools.cache
def _low_pass(factor: int) -> FloatArray:
    """Sections of the filter of `decimate`: a fit that moves its torques in time asks for them hundreds of times."""
    edge = DECIMATION_EDGE / factor
    sections: FloatArray = scipy.signal.cheby1(DECIMATION_ORDER, DECIMATION_RIPPLE_DB, edge, output="sos")
    return sections


def decimated_index(n_sample: int, factor: int) -> IntArray:
    """Return which samples `decimate` keeps: ``factor - 1 - (-n_sample mod factor)`` and every factor-th after."""
    return np.arange(factor - 1 - (-n_sample % factor), n_sample, factor)


def _ask_length(values: FloatArray, padding: int, what: str) -> None:
    if values.shape[0] <= padding:
        raise DataRejected(f"{what}: {values.shape[0]} samples are too few, more than {padding} are needed")


@dataclass(frozen=True)
class BaseParameters:
    """The combinations of parameters that the dynamics can show (Gautier 1991).

    ``regressor[:, dependent] = regressor[:, independent] @ grouping``, so that the identifiable value is
    ``parameter[independent] + grouping @ parameter[dependent]``; `unseen` columns are zero for every motion.
    """

    independent: IntArray
    dependent: IntArray
    unseen: IntArray
    grouping: FloatArray

    def values(self, parameters: FloatArray) -> FloatArray:
        """Return the base parameters of a full parameter vector, shape (len(independent),)."""
        result: FloatArray = parameters[self.independent] + self.grouping @ parameters[self.dependent]
        return result


def base_parameters(regressor: FloatArray, tolerance: float = 1e-9) -> BaseParameters:
    """Split the columns of a regressor of random motion into independent, dependent and unseen ones.

    The rank comes from QR with column pivoting on columns of unit length; which columns stand for a
    dependent set is decided by their order: the first ones stay, later ones are regrouped into them.

    Parameters
    ----------
    regressor
        Shape (n_equation, n_parameter), n_equation well above n_parameter, of random states (not of data:
        what the motion happens not to excite is another question).
    tolerance
        Relative size below which a column counts as a combination of others.
    """
    length = np.linalg.norm(regressor, axis=0)
    unseen = np.flatnonzero(length <= tolerance * length.max())
    seen = np.flatnonzero(length > tolerance * length.max())
    scaled = regressor[:, seen] / length[seen]
    pivoted = np.abs(np.diag(scipy.linalg.qr(scaled, mode="r", pivoting=True)[0]))
    rank = int((pivoted > tolerance * pivoted[0]).sum())
    kept: list[int] = []
    basis = np.empty((len(scaled), 0))
    for column in range(len(seen)):
        # Twice is enough: the second pass removes what rounding left of the first.
        rest = scaled[:, column] - basis @ (basis.T @ scaled[:, column])
        rest -= basis @ (basis.T @ rest)
        size = float(np.linalg.norm(rest))
        if size > np.sqrt(tolerance) and len(kept) < rank:
            kept.append(column)
            basis = np.column_stack([basis, rest / size])
    left = [column for column in range(len(seen)) if column not in kept]
    grouping = np.zeros((len(kept), len(left)))
    if left:
        grouping = scipy.linalg.lstsq(regressor[:, seen[kept]], regressor[:, seen[left]])[0]
    grouping[np.abs(grouping) < tolerance * max(float(np.abs(grouping).max(initial=0)), 1.0)] = 0.0
    return BaseParameters(
        seen[kept].astype(np.int64), seen[left].astype(np.int64), unseen.astype(np.int64), grouping
    )
