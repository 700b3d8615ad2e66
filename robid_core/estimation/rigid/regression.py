"""Linear regression for mechanics: smoothing, differentiation, decimation, least squares, base parameters.

The inverse dynamics of a rigid robot are linear in its inertial and friction parameters, so that sampled
torque and motion give them by least squares (Gautier and Khalil 1990; Janot, Vandanjon and Gautier 2014).
The steps, each a pure function: smooth the position forward and backward, differentiate it by central
differences, decimate every column of the regressor and the torque by one and the same filter, weight the
equations of each axis by its residual, solve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import FloatArray, IntArray
from robid_core.errors import DataRejected, NotIdentifiable

# MATLAB's `decimate`: Chebyshev type I of order 8, 0.05 dB ripple, edge at 0.8 of the new Nyquist frequency.
DECIMATION_ORDER, DECIMATION_RIPPLE_DB, DECIMATION_EDGE = 8, 0.05, 0.8
# Columns scaled to unit length: beyond this condition number a combination of parameters is not in the data.
CONDITION_LIMIT = 1e7
MAXIMUM_REWEIGHTINGS = 30


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
    sections = scipy.signal.cheby1(
        DECIMATION_ORDER, DECIMATION_RIPPLE_DB, DECIMATION_EDGE / factor, output="sos"
    )
    filtered = scipy.signal.sosfiltfilt(sections, values, axis=0, padtype="odd", padlen=3 * DECIMATION_ORDER)
    result: FloatArray = filtered[decimated_index(n_sample, factor)]
    return result


def decimated_index(n_sample: int, factor: int) -> IntArray:
    """Return which samples `decimate` keeps: ``factor - 1 - (-n_sample mod factor)`` and every factor-th after."""
    return np.arange(factor - 1 - (-n_sample % factor), n_sample, factor)


def _ask_length(values: FloatArray, padding: int, what: str) -> None:
    if values.shape[0] <= padding:
        raise DataRejected(f"{what}: {values.shape[0]} samples are too few, more than {padding} are needed")


@dataclass(frozen=True)
class LinearFit:
    """Solution of an over-determined linear system with its uncertainty.

    `estimate` (n_parameter,), `covariance` (n_parameter, n_parameter) from the residual variance, `residual`
    (n_sample, n_axis) in the unit of the target, `deviation` (n_axis,) its standard deviation per axis,
    `relative_error` = |residual| / |target| over everything, `condition` of the column-scaled regressor.
    """

    estimate: FloatArray
    covariance: FloatArray
    residual: FloatArray
    deviation: FloatArray
    relative_error: float
    condition: float

    @property
    def standard_error(self) -> FloatArray:
        """Square roots of the variances, shape (n_parameter,)."""
        result: FloatArray = np.sqrt(np.diag(self.covariance))
        return result


def linear_least_squares(regressor: FloatArray, target: FloatArray, names: tuple[str, ...]) -> LinearFit:
    """Least squares over several axes, each weighted by its own residual variance.

    The equations of each axis are divided by the standard deviation of their residual (weighted IDIM-LS,
    Gautier 1997), over again until the weights stand still: after one pass a quiet axis would still carry the
    errors that a noisy one brought into the unweighted start. With one axis this is ordinary least squares. The
    covariance is that of white residuals: decimate down to the bandwidth of the motion before, or it claims too
    much.

    Parameters
    ----------
    regressor
        Shape (n_sample, n_axis, n_parameter).
    target
        Shape (n_sample, n_axis).
    names
        Parameter names for messages, n_parameter of them.

    Raises
    ------
    DataRejected
        If there are not more equations than parameters.
    NotIdentifiable
        If a combination of parameters leaves no trace in the data; the message names its members.
    """
    n_sample, n_axis, n_parameter = regressor.shape
    if n_sample * n_axis <= n_parameter:
        raise DataRejected(
            f"{n_sample * n_axis} equations cannot carry {n_parameter} parameters; record longer"
        )
    scale, rounding = np.ones(n_axis), 1e-12 * float(np.abs(target).max())
    for _ in range(MAXIMUM_REWEIGHTINGS):
        estimate, inverse_gram, condition = _solve(regressor, target, scale, names)
        residual = target - regressor @ estimate
        deviation = _deviation(residual, n_parameter)
        # A residual of nothing but rounding says nothing about the noise.
        if n_axis == 1 or (deviation <= rounding).any() or np.allclose(deviation, scale, rtol=1e-6, atol=0):
            break
        scale = deviation
    weighted = residual / scale
    variance = float((weighted**2).sum()) / (n_sample * n_axis - n_parameter)
    norm = float(np.linalg.norm(target))
    return LinearFit(
        estimate=estimate,
        covariance=variance * inverse_gram,
        residual=residual,
        deviation=deviation,
        relative_error=float(np.linalg.norm(residual)) / norm if norm > 0 else float("inf"),
        condition=condition,
    )


def _deviation(residual: FloatArray, n_parameter: int) -> FloatArray:
    n_sample, n_axis = residual.shape
    freedom = max(n_sample - n_parameter / n_axis, 1.0)
    result: FloatArray = np.sqrt((residual**2).sum(axis=0) / freedom)
    return result


def _solve(
    regressor: FloatArray, target: FloatArray, scale: FloatArray, names: tuple[str, ...]
) -> tuple[FloatArray, FloatArray, float]:
    """Return estimate, inverse of the weighted Gram matrix, and condition number of the scaled columns."""
    n_parameter = regressor.shape[2]
    a = (regressor / scale[:, None]).reshape(-1, n_parameter)
    b = (target / scale).reshape(-1)
    length = np.linalg.norm(a, axis=0)
    if (length == 0).any():
        unseen = ", ".join(name for name, norm in zip(names, length, strict=True) if norm == 0)
        raise NotIdentifiable(f"the motion does not excite {unseen}; move these axes or hold the parameters")
    _, values, rows = np.linalg.svd(a / length, full_matrices=False)
    condition = float(values[0] / values[-1]) if values[-1] > 0 else float("inf")
    if condition > CONDITION_LIMIT:
        members = np.flatnonzero(np.abs(rows[-1]) > 0.1 * np.abs(rows[-1]).max())
        raise NotIdentifiable(
            "the data cannot tell apart "
            + ", ".join(names[i] for i in members)
            + f" (condition number {condition:.1e}); hold some of them or record a richer motion"
        )
    estimate: FloatArray = scipy.linalg.lstsq(a / length, b)[0] / length
    inverse = (rows.T / values**2) @ rows / np.outer(length, length)
    return estimate, inverse, condition


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
