"""What no result may be, whoever computed it: something else than its class declares, values at infinity, nothing but
NaN, axes that run backwards, negative errors, covariances that no scatter has, clocks that stand still, fits without a
misfit, one name for two things, names for nothing.

Asked before a result is stored, of whole artifacts, since they may be built from parts that are checked elsewhere. A
field says in its declaration what it is: its type (`declared.py`), `array(..., rising=True)`,
`array(..., covariance=True)`, `array(..., known=True)`, `array(..., least=0.0)`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from robid_core.artifacts.artifact import Artifact
from robid_core.artifacts.declared import declarations, other_than
from robid_core.artifacts.dense_run import DenseRun
from robid_core.artifacts.fit import Fit
from robid_core.artifacts.from_arrays import HOLDS
from robid_core.artifacts.record import Record
from robid_core.artifacts.units import symbols_of
from robid_core.errors import DataRejected

NAMES = ("names", "axis_names")  # fields in which a name means one thing
PARAMETERS = frozenset({"n_parameter", "n_essential"})
NAMED = {"axis_names": frozenset({"n_axis"}), "names": PARAMETERS, "units": PARAMETERS, "groups": PARAMETERS}
CLOCKS = 1e-3  # by which two statements of a sampling time may differ
ROUNDING = 1e-6  # of a correlation: matrices that were inverted near their last digits are still covariances


def unsound(artifact: Artifact, place: str = "") -> Iterator[str]:
    """Yield what is wrong with an artifact and those within it: the field, and what about it."""
    place = place or type(artifact).__name__
    others = list(_undeclared(artifact, place))
    yield from others
    if others:
        return
    try:
        artifact.replace()  # checked as when it was built: it may have been changed or built in another way
    except (DataRejected, TypeError, ValueError) as error:
        yield str(error)
        return
    yield from _wrong_lengths(artifact, place)
    yield from _wrong_measurement(artifact, place)
    yield from _wrong_clock(artifact, place)
    yield from _wrong_evidence(artifact, place)
    for item in dataclasses.fields(artifact):
        value, where = getattr(artifact, item.name), f"{place}.{item.name}"
        if isinstance(value, np.ndarray) and "axes" in item.metadata:
            words = _wrong(value, item.metadata)
            if words:
                yield f"{where}: {words}"
        elif isinstance(value, Artifact):
            yield from unsound(value, where)
        elif item.name in NAMES:
            twice = sorted({name for name in value if value.count(name) > 1})
            if twice:
                yield f"{where}: {', '.join(twice)} stands twice"
        elif isinstance(value, Mapping | tuple):
            parts = value.items() if isinstance(value, Mapping) else enumerate(value)
            for key, part in parts:
                if isinstance(part, Artifact):
                    yield from unsound(part, f"{where}[{key}]")


def _undeclared(artifact: Artifact, place: str) -> Iterator[str]:
    """Yield which fields are missing, or hold something else than their class declares."""
    for name, declared in declarations(type(artifact)).items():
        if name not in {item.name for item in dataclasses.fields(artifact)}:
            continue
        if not hasattr(artifact, name):
            yield f"{place}.{name}: missing"
        elif words := other_than(declared, getattr(artifact, name)):
            yield f"{place}.{name}: {words}"


def _wrong_lengths(artifact: Artifact, place: str) -> Iterator[str]:
    """Yield which names are more or fewer than what they name."""
    fields = [(item, getattr(artifact, item.name)) for item in dataclasses.fields(artifact)]
    arrays = [(item.metadata["axes"], value) for item, value in fields if isinstance(value, np.ndarray)]
    lengths = {axis: length for axes, value in arrays for axis, length in zip(axes, value.shape, strict=True)}
    for item, names in fields:
        for axis in sorted(NAMED.get(item.name, frozenset()) & lengths.keys()):
            if len(names) != lengths[axis]:
                yield f"{place}.{item.name}: {len(names)} entries, but {axis} is {lengths[axis]}"


def _wrong_measurement(artifact: Artifact, place: str) -> Iterator[str]:
    """Yield what no measurement says: nothing at all, a hold that nobody knows, channels in units of something else."""
    hold = getattr(artifact, "torque_hold", HOLDS[0])
    if hold not in HOLDS:
        yield f"{place}.torque_hold: '{hold}', not {' or '.join(HOLDS)}"
    if isinstance(artifact, Record) and not artifact.runs:
        yield f"{place}.runs: empty"
    if not isinstance(artifact, DenseRun):
        return
    if not artifact.channels:
        yield f"{place}.channels: empty"
    step_s = float(np.diff(artifact.time_s).mean()) if len(artifact.time_s) > 1 else artifact.sample_time_s
    if abs(step_s - artifact.sample_time_s) > CLOCKS * abs(artifact.sample_time_s):
        yield f"{place}.time_s: {step_s:g} s between samples, but sample_time_s is {artifact.sample_time_s:g} s"
    for name, channel in artifact.channels.items():
        where = f"{place}.channels[{name}]"
        allowed = symbols_of(name)
        if allowed and channel.unit_symbol not in allowed:
            yield f"{where}: in {channel.unit_symbol or 'no unit'}; by its name it is in {' or '.join(allowed)}"
        if channel.values.shape[:-1] != artifact.valid.shape:
            yield f"{where}: values of shape {channel.values.shape}, but valid has {artifact.valid.shape}"


def _wrong(values: npt.NDArray[Any], metadata: Mapping[str, Any]) -> str:
    """Return what is wrong with an array, empty where nothing is."""
    if values.dtype.kind not in "fciu" or not values.size:
        return ""
    if np.isinf(values).any():
        first = tuple(int(index) for index in np.argwhere(np.isinf(values))[0])
        axes = ", ".join(f"{axis}={index}" for axis, index in zip(metadata["axes"], first, strict=True))
        return f"{int(np.isinf(values).sum())} values are infinite, the first at {axes}"
    if metadata.get("known") and not np.isfinite(values).any():
        return f"all {values.size} values are NaN"
    if metadata.get("rising") and not (np.diff(values) > 0).all():
        index = int(np.argmin(np.diff(values) > 0))
        return f"does not rise: {values[index]:g} is followed by {values[index + 1]:g}"
    least = metadata.get("least")
    if least is not None and (values < least).any():
        return f"{int((values < least).sum())} values are below {least:g}, the least {np.nanmin(values):g}"
    return no_covariance(values) if metadata.get("covariance") else ""


def _wrong_clock(artifact: Artifact, place: str) -> Iterator[str]:
    """Yield what is wrong with the time between samples, and with frequencies that it cannot hold."""
    step_s = getattr(artifact, "sample_time_s", None)
    if step_s is None:
        return
    if not 0 < step_s < np.inf:
        yield f"{place}.sample_time_s: {step_s:g} s between samples"
        return
    frequency = getattr(artifact, "frequency_hz", None)
    highest = 0.5 / step_s
    if frequency is not None and frequency.size and frequency.max() > highest * (1 + ROUNDING):
        yield f"{place}.frequency_hz: {frequency.max():g} Hz, beyond half the sampling rate, {highest:g} Hz"


def _wrong_evidence(artifact: Artifact, place: str) -> Iterator[str]:
    """Yield what no evidence for a fit is: less than nothing, more starts that agree than there were."""
    if not isinstance(artifact, Fit):
        return
    if artifact.misfit < 0 or (artifact.converged and not np.isfinite(artifact.misfit)):
        yield f"{place}.misfit: {artifact.misfit:g}; a mean square that a fit has reached is a number, 0 or more"
    if artifact.model_error is not None and not 0 <= artifact.model_error < np.inf:
        yield f"{place}.model_error: {artifact.model_error:g}; a relative error is a number, 0 or more"
    if not 0 <= artifact.n_agree <= artifact.n_starts:
        yield f"{place}.n_agree: {artifact.n_agree} of {artifact.n_starts} starts"


def no_covariance(matrices: npt.NDArray[Any]) -> str:
    """Say why matrices (..., n, n) are no covariances, empty where all are; NaN on a diagonal: not known.

    Rows are scaled to correlations first, so that units do not hide a negative eigenvalue.
    """
    flat = matrices.reshape(-1, *matrices.shape[-2:])
    variance = np.einsum("kii->ki", flat).real
    known = np.isfinite(variance)
    if (variance[known] < 0).any():
        return f"a variance is negative: {variance[known].min():g}"
    deviation = np.sqrt(np.where(known & (variance > 0), variance, 1.0))
    correlation = flat / (deviation[:, :, None] * deviation[:, None, :])
    pairs = known[:, :, None] & known[:, None, :]
    correlation = np.where(pairs, correlation, np.eye(flat.shape[-1]))
    correlation = correlation[np.isfinite(correlation).all(axis=(1, 2))]
    if not len(correlation):
        return ""
    skew = float(np.abs(correlation - correlation.conj().swapaxes(1, 2)).max())
    if skew > ROUNDING:
        return f"is no covariance: not symmetric, by {skew:.2g} of the deviations"
    least = float(np.linalg.eigvalsh(correlation)[:, 0].min())
    if least < -ROUNDING * flat.shape[-1]:
        return f"is no covariance: not positive, its least eigenvalue is {least:.2g} of the variances"
    return ""
