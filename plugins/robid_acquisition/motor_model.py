"""Torque of a DC motor from its voltage: a model of the motor, not a measurement.

    V = R i + kt w,   torque = kt i = kt/R V - kt^2/R w

with the winding's inductance left out, so that it holds below R/L; w is the speed of the motor.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid_acquisition.channel_map import Voltage, per_axis
from robid_core import BoolArray, DataRejected, FloatArray


def torque_from_voltage(
    voltage: FloatArray, law: Voltage, moving: Mapping[str, FloatArray], sample_time_s: float, n_covered: int
) -> FloatArray:
    """Return the torque at the motor in N m, shape (n_sample, n_axis).

    Parameters
    ----------
    voltage
        At the winding in V, (n_sample, n_axis), NaN at axes that are not covered.
    law
        Resistance and torque constant.
    moving
        Channels motor_speed or motor_position, at the motor's side, (n_sample, n_axis). A position is differentiated by
        central differences: at the frequency f the speed is then sin(2 pi f T) / (2 pi f T) of what it was.
    sample_time_s
        T.
    n_covered
        Number of axes that the voltage covers.

    Raises
    ------
    DataRejected
        If there is neither speed nor position.
    """
    if "motor_speed" in moving:
        speed = moving["motor_speed"]
    elif "motor_position" in moving:
        speed = np.gradient(moving["motor_position"], sample_time_s, axis=0, edge_order=2)
    else:
        raise DataRejected(
            "channels.motor_torque.voltage: it needs the channel motor_speed, or motor_position"
        )
    where = "channels.motor_torque.voltage"
    constant = per_axis(f"{where}.torque_constant", law.torque_constant, n_covered)
    admittance = constant / per_axis(f"{where}.resistance", law.resistance, n_covered)
    if n_covered < voltage.shape[1]:
        covered = np.asarray(~np.isnan(voltage).all(axis=0))
        constant, admittance = _spread(constant, covered), _spread(admittance, covered)
    result: FloatArray = admittance * (voltage - constant * speed)
    return result


def _spread(values: FloatArray, covered: BoolArray) -> FloatArray:
    result = np.full(len(covered), np.nan)
    result[covered] = values
    return result
