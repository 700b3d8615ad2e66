"""A recorded motion that the recorded torque cannot give this robot, most often for a wrong unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core import DataRejected, FloatArray, Record, Robot

SPAN_S = 5e-3  # of differences: at those of samples the noise of an encoder is larger than a motion
IMPOSSIBLE = 10.0  # times the recorded torque, taken by a rotor alone


def check_possible(records: Sequence[Record], robot: Robot) -> None:
    """Refuse motions for which the rotor of an axis alone takes many times the torque that was recorded (DataRejected).

    A simulation of them leaves all bounds at once, or explains nothing of the torque.
    """
    inertia = np.array([robot.parameter(f"rotor_inertia.{axis}") for axis in robot.axis_names])
    runs = [run for record in records for run in record.runs]
    speeds, needed = list[FloatArray](), list[FloatArray]()
    for run in runs:
        step = max(1, round(SPAN_S / run.sample_time_s))
        speeds.append(np.diff(run.lanes("motor_position")[:, ::step], axis=1) / (step * run.sample_time_s))
        needed.append(inertia * np.diff(speeds[-1], axis=1) / (step * run.sample_time_s))
    ratio = _rms(needed) / np.maximum(_rms([run.lanes("motor_torque") for run in runs]), 1e-300)
    worst = int(np.argmax(ratio))
    if not ratio[worst] > IMPOSSIBLE:
        return
    unit = runs[0].channel("motor_position").unit_symbol
    fastest = max(float(np.abs(speed[..., worst]).max()) for speed in speeds)
    raise DataRejected(
        f"the recorded motion is impossible for {robot.name}: {robot.axis_names[worst]} would turn at up to "
        f"{fastest:.2g} {unit}/s, and its rotor alone take {ratio[worst]:.2g} times the recorded torque; most likely "
        f"the unit or scale of motor_position is wrong (encoder counts or degrees taken for {unit}?)"
    )


def _rms(lanes: Sequence[FloatArray]) -> FloatArray:
    """Of all runs, (n_axis,)."""
    flat = np.concatenate([one.reshape(-1, one.shape[-1]) for one in lanes])
    found: FloatArray = np.sqrt((flat**2).mean(axis=0))
    return found
