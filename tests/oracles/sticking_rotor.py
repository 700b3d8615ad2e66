"""A motor under Coulomb friction that turns abruptly, or within a speed: by hand, nothing shared with robid.

A rotor with a body behind a rigid gear, a controller, steps of 0.05 ms. At each step abrupt friction either holds the
rotor, where the torque is below its level and the speed would change its sign, or brakes it by its level.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from robid_core import Record, Robot
from robid_core.robot import RobotDescription

STEP, FINE = 1e-3, 20
INERTIA, LEVEL, VISCOUS = 1e-3, 0.3, 1e-3  # kg m^2 at the motor, N m, N m s/rad
NOISE, TORQUE_NOISE = 1e-5, 0.004
PERIOD_S, SETTLE_S = 5.0, 2.0
LINES = np.arange(15, 200, 9)  # of PERIOD_S, beside one slow sine


@dataclass(frozen=True)
class Run:
    """What is measured, and whether the rotor was held, (n_sample,) each."""

    angle: np.ndarray
    torque: np.ndarray
    held: np.ndarray


def run(
    seed: int,
    *,
    n_period: int = 1,
    width: float = 0.0,
    ripple: float = 0.0,
    slow: float = 10.0,
    step: float = 0.0,
) -> Run:
    """Measure some periods of a multisine on a slow sine.

    Parameters
    ----------
    width
        Speed, rad/s, within which friction turns as a hyperbolic tangent; 0: abruptly.
    ripple
        Amplitude of a torque of order 7 a motor turn, N m.
    slow
        Amplitude of the slow sine, rad/s.
    step
        Of the encoder, rad; 0: fine.
    """
    drawn = np.random.default_rng(seed)
    phase = drawn.uniform(0, 2 * np.pi, len(LINES) + 1)
    n, n_settle = round(PERIOD_S / STEP) * n_period, round(SETTLE_S / STEP)
    time = STEP * (np.arange(n + n_settle) - n_settle)
    wanted = slow * np.sin(2 * np.pi * 2 / PERIOD_S * time + phase[-1])
    wanted += 0.5 * np.cos(2 * np.pi / PERIOD_S * np.outer(time, LINES) + phase[:-1]).sum(axis=1)
    angle, torque, held = _measured(wanted, width, ripple)
    angle, torque, held = (values[n_settle:] for values in (angle, torque, held))
    angle += NOISE * drawn.normal(size=n)
    angle = step * np.round(angle / step) if step else angle
    return Run(angle, torque + TORQUE_NOISE * drawn.normal(size=n), held)


@numba.njit
def _measured(wanted, width, ripple):  # type: ignore[no-untyped-def]
    n = len(wanted)
    angle, torque, held = np.zeros(n), np.zeros(n), np.zeros(n, dtype=np.bool_)
    h, q, w, integral = STEP / FINE, 0.0, 0.0, 0.0
    for k in range(n):
        integral += 2.0 * STEP * (wanted[k] - w)
        torque[k] = 0.2 * (wanted[k] - w) + integral
        angle[k] = q
        for _ in range(FINE):
            pull = torque[k] + ripple * np.sin(7 * q) - VISCOUS * w
            if width > 0:
                w += h * (pull - LEVEL * np.tanh(w / width)) / INERTIA
            else:
                free = w + h * pull / INERTIA
                w = np.sign(free) * max(abs(free) - h * LEVEL / INERTIA, 0.0)
                held[k] |= w == 0
            q += h * w
    return angle, torque, held


def record_of(runs: list[Run], *, n_period: int = 1) -> Record:
    """Experiments of one configuration as a record; periods where there are several."""
    told = robot()
    angle, torque = (
        np.stack([getattr(one, name) for one in runs])[:, :, None] for name in ("angle", "torque")
    )
    periods = {"period_s": PERIOD_S, "excited_hz": np.r_[2, LINES] / PERIOD_S} if n_period > 1 else {}
    return Record.from_arrays(
        motor_position=angle, motor_torque=torque, sample_time_s=STEP, axes="n_exp n_sample n_axis", robot=told,
        torque_hold="zero_order_hold", **periods
    )  # fmt: skip


def robot() -> Robot:
    """What is known of it: an inertia a tenth too small, friction a third."""
    axis = {
        "gear_ratio": 1.0,
        "rotor_inertia": 0.9e-3,
        "friction": {"coulomb": 0.2, "viscous": 1e-3},
        "sensors": {"position_noise": NOISE, "torque_noise": TORQUE_NOISE},
    }
    body = {"joint": "axis_1", "axis": (0.0, 0.0, 1.0), "mass": 1e-3, "centre_of_mass": (0.0, 0.0, 0.0),
            "inertia": ((1e-9, 0.0, 0.0), (0.0, 1e-9, 0.0), (0.0, 0.0, 1e-9))}  # fmt: skip
    described = {"robid_robot": 1, "name": "rotor", "bodies": (body,), "axes": {"axis_1": axis}}
    return Robot(RobotDescription.model_validate(described))
