"""Records and responses from arrays that somebody has in memory: named axes, units, nothing guessed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.artifacts.dense_run import Channel
from robid_core.artifacts.units import QUANTITIES, UNITS, symbols_of
from robid_core.errors import DataRejected

HOLDS = ("zero_order_hold", "continuous")
"""How torque goes from sample to sample."""

AXES = ("n_config", "n_block", "n_exp", "n_period", "n_sample", "n_axis")
RESPONSE_AXES = ("n_config", "n_freq", "n_out", "n_in")
ACCELERATION = "(rad/s^2)/(N m)"
# Unit of a response -> power of i w that makes an acceleration of it.
RESPONSE_UNITS = {ACCELERATION: 0, "(rad/s)/(N m)": 1, "rad/(N m)": 2}
FACTORS = 1e-6  # of the largest variance: what is left is no rounding


class Axes(Protocol):
    """What a robot says of its axes."""

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the motors' axes, in order."""

    def joint_angle(self, motor_angle: npt.ArrayLike) -> FloatArray:
        """Return motor angles (..., n_axis) seen through the gear."""


def dense(name: str, values: npt.ArrayLike, axes: str, period: int | None) -> FloatArray:
    """Return values with all of `AXES`, those that are not named of length one.

    Parameters
    ----------
    name
        Of the channel, for messages.
    values
        With the axes that `axes` names, in that order; one axis of one motor may lack `n_axis`.
    axes
        Words of `AXES`; empty: `n_sample n_axis`, `n_sample` alone, or all six.
    period
        Samples of one period, where periods stand one after another along `n_sample`; None: they do not.
    """
    array = np.asarray(values, dtype=np.float64)
    by_size = {1: "n_sample", 2: "n_sample n_axis", 6: " ".join(AXES)}
    array = _in_order(name, array, axes, axes or by_size.get(array.ndim, ""), AXES, "n_exp n_sample n_axis")
    if period is None:
        return array
    n_sample = array.shape[4]
    if array.shape[3] != 1 or n_sample % period or not period:
        raise DataRejected(
            f"{name}: {array.shape[3]} x {n_sample} samples are no whole number of periods of {period} samples; cut "
            "the arrays to whole periods, or leave period_s out"
        )
    return array.reshape(*array.shape[:3], n_sample // period, period, array.shape[5])


def _in_order(
    name: str, array: npt.NDArray[Any], axes: str, named: str, known: Sequence[str], example: str
) -> npt.NDArray[Any]:
    """Return an array with all `known` axes in their order, those that are not `named` of length one.

    `axes` is what was said of them, `example` what might be, for messages.
    """
    words = named.split()
    if len(words) != array.ndim or len(set(words)) != len(words) or not set(words) <= set(known):
        told = f"axes='{axes}'" if axes else "no axes named"
        raise DataRejected(
            f"{name}: shape {array.shape} with {told}; name each of its {array.ndim} axes, "
            f'as axes="{example}", out of {", ".join(known)}'
        )
    order = [word for word in known if word in words]
    array = array.transpose([words.index(word) for word in order])
    return np.expand_dims(array, [k for k, word in enumerate(known) if word not in words])


def channel(name: str, values: FloatArray, unit: str | None) -> Channel:
    """Return a channel in SI units; its name says what it holds and on which side of the gear."""
    allowed = symbols_of(name)
    if unit is None:
        if not allowed:
            raise DataRejected(
                f"{name}: its name does not say what it holds; give units={{'{name}': ...}}, or a name with one of "
                f"{', '.join(QUANTITIES)} in it"
            )
        unit = allowed[0]
    if unit not in UNITS:
        raise DataRejected(f"{name}: unit '{unit}' is not known; there are: {', '.join(UNITS)}")
    symbol, factor = UNITS[unit]
    if allowed and symbol not in allowed:
        hint = "; multiply by the torque constant first" if symbol == "A" else ""
        raise DataRejected(f"{name}: {unit} is no unit of it; it is in {' or '.join(allowed)}{hint}")
    return Channel("joint" if name.startswith("joint") else "motor", symbol, values * factor)


def names_of_axes(robot: Axes | None, axis_names: Sequence[str], n_axis: int) -> tuple[str, ...]:
    """Return the names of the axes, as given, of the robot, or axis_1, axis_2, ...; DataRejected for another number."""
    known = tuple(axis_names) or (robot.axis_names if robot is not None else ())
    names = known or tuple(f"axis_{number}" for number in range(1, n_axis + 1))
    if len(names) != n_axis:
        raise DataRejected(
            f"the arrays have {n_axis} axes, and {len(names)} are named ({', '.join(names)}); name as many, "
            "and say which axis of the arrays is n_axis"
        )
    return names


def angles(
    angle: npt.ArrayLike | None, robot: Axes | None, position: FloatArray | None, n_config: int, n_axis: int
) -> FloatArray:
    """Return motor angles seen through the gear, (n_config, n_axis): as given, or of the robot and where it stood."""
    if angle is not None:
        found: FloatArray = np.asarray(angle, dtype=np.float64).reshape(-1, n_axis)
        if len(found) != n_config:
            raise DataRejected(f"angle: {len(found)} rows for {n_config} configurations; give one for each")
        return found
    if robot is None or position is None:
        raise DataRejected(
            "where the robot stood is not known; give robot=, whose gears the motor angles are seen through, or "
            "angle=, joint side, (n_config, n_axis)"
        )
    return robot.joint_angle(np.nanmean(position, axis=(1, 2, 3, 4)))


def hold(name: str) -> str:
    """Return how torque goes from sample to sample; DataRejected where there is no such way."""
    if name not in HOLDS:
        raise DataRejected(f"torque_hold: '{name}', not {' or '.join(HOLDS)}")
    return name


def common_shape(channels: Mapping[str, FloatArray]) -> tuple[int, ...]:
    """Return the shape that all channels have; DataRejected where they differ."""
    shapes = {name: values.shape for name, values in channels.items()}
    if len(set(shapes.values())) > 1:
        told = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise DataRejected(f"the channels differ in shape, as ({', '.join(AXES)}): {told}")
    return next(iter(shapes.values()))


def response(values: npt.ArrayLike, frequency_hz: FloatArray, unit: str, axes: str = "") -> ComplexArray:
    """Return a response (n_config, n_freq, n_out, n_in) from torque to acceleration; `axes` as in `_full`."""
    if unit not in RESPONSE_UNITS:
        raise DataRejected(f"unit '{unit}' is not known; there are: {', '.join(RESPONSE_UNITS)}")
    array = _full(np.asarray(values, dtype=np.complex128), len(frequency_hz), "response", axes)
    factor = (2j * np.pi * frequency_hz) ** RESPONSE_UNITS[unit]
    return np.asarray(array * factor[:, None, None], dtype=np.complex128)


def factored_variance(
    deviation: npt.ArrayLike, frequency_hz: FloatArray, unit: str, shape: tuple[int, ...], axes: str = ""
) -> tuple[ComplexArray, ComplexArray]:
    """Return the factors (inputs, outputs) of a covariance whose standard deviations of entries are given.

    Entries are taken as uncorrelated: `conj(inputs) (x) outputs` is diagonal. DataRejected where the variances at a
    line are no product of one number for each output and one for each input. `axes` as in `_full`.
    """
    given = np.asarray(deviation, dtype=np.float64)
    spread = np.broadcast_to(
        _full(given, len(frequency_hz), "deviation", axes) if given.ndim else given, shape
    )
    size: FloatArray = spread * (2 * np.pi * frequency_hz[:, None, None]) ** RESPONSE_UNITS[unit]
    if not (np.isfinite(size).all() and (size > 0).all()):
        raise DataRejected("deviation: standard deviations must be finite and positive")
    variance = size**2
    outputs = variance.mean(axis=3)
    inputs = variance.mean(axis=2) / variance.mean(axis=(2, 3))[..., None]
    left = np.abs(outputs[..., :, None] * inputs[..., None, :] - variance).max(axis=(2, 3))
    if (left > FACTORS * variance.max(axis=(2, 3))).any():
        raise DataRejected(
            "deviation: an Frf keeps one factor for each output and one for each input, and these variances are no "
            "such product; give the same deviation for all inputs of an output (their root mean square)"
        )
    return _diagonal(inputs), _diagonal(outputs)


def _full(array: npt.NDArray[Any], n_freq: int, name: str, axes: str) -> npt.NDArray[Any]:
    """Return an array with all of `RESPONSE_AXES`; without words on its axes it may lack the first or the last two."""
    if axes:
        array = _in_order(name, array, axes, axes, RESPONSE_AXES, "n_out n_in n_freq")
        wanted = f"as ({', '.join(RESPONSE_AXES)}), by axes='{axes}', has not"
    else:
        array = array[:, None, None] if array.ndim == 1 else array
        array = array[None] if array.ndim == 3 else array
        wanted = "is none of (n_freq,), (n_freq, n_axis, n_axis) and (n_config, n_freq, n_axis, n_axis) with"
    if array.ndim != 4 or array.shape[1] != n_freq or array.shape[2] != array.shape[3]:
        raise DataRejected(
            f"{name}: shape {array.shape} {wanted} {n_freq} frequencies and as many outputs as inputs; name its axes "
            'in their order, as axes="n_out n_in n_freq"'
        )
    return array


def _diagonal(values: FloatArray) -> ComplexArray:
    identity: ComplexArray = np.eye(values.shape[-1], dtype=np.complex128)
    result: ComplexArray = identity * values[..., None]
    return result


def bins(frequencies_hz: Iterable[float], period_s: float) -> npt.NDArray[np.int64]:
    """Return the bins of excited frequencies; DataRejected where one does not fit into the period."""
    wanted = np.asarray(list(frequencies_hz), dtype=np.float64) * period_s
    off = np.abs(wanted - wanted.round()) > 1e-6 * np.maximum(wanted, 1.0)
    if off.any():
        raise DataRejected(
            f"excited_hz: {wanted[off][0] / period_s:g} Hz has no whole number of cycles in a period of {period_s:g} s"
        )
    found: npt.NDArray[np.int64] = np.unique(wanted.round().astype(np.int64))
    return found
