"""The law of an effect drawn: force over speed or deflection, or what becomes of a signal."""

from __future__ import annotations

import numpy as np

from generated_pages.chart import Curve, chart
from robid_core import FloatArray, ForceEffect, Robot, SignalEffect
from robid_core.mechanics import ForceTerm, SignalTerm
from robid_core.mechanics.law_along import law_along, signal_along

STEP = 2.5e-4
STYLES = ("first", "second", "third")
TURN = 2 * np.pi

# Where a law is seen best: amplitude of a sine of position (rad) and its frequency (Hz); forces are drawn over speed
# where the force does not depend on the way there, and over position where it does.
SLIDING = (30.0 / TURN, 1.0)  # 30 rad/s
PRESLIDING = (0.03, 1.0)
DEFLECTION = (1.5e-3, 5.0)
SWING = (1.5, 0.5)
OVER_POSITION = {"friction.dahl", "friction.lugre", "friction.elasto_plastic", "friction.breakaway"}
HYSTERESIS_REACH = {
    "friction.dahl": PRESLIDING,
    "friction.lugre": PRESLIDING,
    "friction.elasto_plastic": PRESLIDING,
}
WITH_THE_SPRING = {  # what they do is seen in the torque of the whole gear
    "transmission.backlash",
    "transmission.piecewise_linear",
    "transmission.soft_zone",
    "transmission.spring_damper",
}
LOADS = {
    "friction.load_dependent": (0.0, 10.0, 20.0),
    "friction.quadratic_load": (0.0, 5.0, 10.0),
}  # N m at the motor


def law_picture(name: str, robot: Robot, effect: type[ForceEffect] | type[SignalEffect]) -> str:
    """Return the chart of the law that the robot has under the label `cause`."""
    if issubclass(effect, ForceEffect):
        (term, *_) = (term for term in robot.forces if term.label == "cause")
        return _of_force(name, term, robot)
    (signal,) = (term for term in robot.signals if term.label == "cause")
    return _of_signal(name, signal, effect)


def _sine(amplitude: float, frequency: float, periods: int = 1) -> tuple[FloatArray, FloatArray]:
    """Position and velocity in the middle of steps, shape (1, n_sample); the last period is kept."""
    n = round(1 / (frequency * STEP))
    phase = TURN * (np.arange(n * periods) + 0.5) / n
    position, velocity = amplitude * np.sin(phase), amplitude * TURN * frequency * np.cos(phase)
    return position[None], velocity[None]


def _of_force(name: str, term: ForceTerm, robot: Robot) -> str:
    group = name.partition(".")[0]
    if group == "friction":
        over_position = name in OVER_POSITION
        motion = _sine(*(HYSTERESIS_REACH.get(name, PRESLIDING) if over_position else SLIDING))
        curves = []
        for i, load in enumerate(LOADS.get(name, (0.0,))):
            run = law_along(term, *motion, load, STEP, settle=motion[0].shape[1])
            x = motion[0] if over_position else motion[1]
            label = f"load {load:g} N m" if name in LOADS else ""
            curves.append(Curve(x[0], run.force[0], STYLES[i], label))
        return chart(
            "Law", "motor angle, rad" if over_position else "motor speed, rad/s", "torque, N m", curves
        )
    if name == "transmission.kinematic_error":
        angle = np.linspace(0, TURN, 400)[None]
        run = law_along(term, angle, 0 * angle, 0.0, 0.0)
        return chart("Law", "motor angle, rad", "torque in the gear, N m", [Curve(angle[0], run.force[0])])
    if group == "transmission":
        motion = _sine(*DEFLECTION)
        run = law_along(term, *motion, 0.0, STEP, settle=motion[0].shape[1])
        if name not in WITH_THE_SPRING:
            added = [Curve(1e3 * motion[0][0], run.force[0])]
            return chart("Added to the spring's torque", "deflection, mrad", "torque, N m", added)
        gear = robot.description.axes["axis_1"].gear
        assert gear is not None
        spring = gear.stiffness * motion[0][0]
        return chart(
            "Torque of the gear",
            "deflection, mrad",
            "torque, N m",
            [
                Curve(1e3 * motion[0][0], spring, "reference", "linear spring"),
                Curve(1e3 * motion[0][0], spring + run.force[0], "first", "with the effect"),
            ],
        )
    motion = _sine(*SWING)
    run = law_along(term, *motion, 0.0, STEP, settle=motion[0].shape[1])
    return chart("Law", "joint angle, rad", "torque, N m", [Curve(motion[0][0], run.force[0])])


def _of_signal(name: str, term: SignalTerm, effect: type[SignalEffect]) -> str:
    unit = {"torque": "N m", "torque_measurement": "N m", "position": "rad"}[term.channel]
    turn, still = np.linspace(0, TURN, 400)[None], np.zeros((1, 400))
    rows = {parameter.name for parameter in effect.parameters}
    if name.endswith("noise"):
        return ""
    if "order" in rows:
        base = turn if term.channel == "position" else still
        out = signal_along(term, base, turn, still, STEP)
        return chart("Added to the signal", "motor angle, rad", unit, [Curve(turn[0], out[0] - base[0])])
    if name in ("drive.current_loop", "sensing.delay"):
        step = STEP if term.channel == "torque" else 1e-3
        n = 16 if term.channel == "torque" else 8
        ramp = np.clip(np.arange(n) - 2.0, 0, 1 if term.channel == "torque" else np.inf)[None]
        out = signal_along(term, ramp, 0 * ramp, 0 * ramp, step)
        time = 1e3 * step * np.arange(n)
        curves = [Curve(time, ramp[0], "reference", "before"), Curve(time, out[0], "first", "after")]
        return chart("Signal over time", "time, ms", unit, curves)
    if name == "drive.core_loss":
        torque = np.linspace(-20, 20, 400)[None]
        curves = [
            Curve(
                torque[0],
                (signal_along(term, torque, 0 * torque, 0 * torque + v, STEP) - torque)[0],
                style,
                f"{v:+g} rad/s",
            )
            for v, style in ((50.0, "first"), (-50.0, "second"))
        ]
        return chart("Added to the torque", "commanded torque, N m", unit, curves)
    reach = {"torque": 30.0, "torque_measurement": 30.0, "position": 5e-4}[term.channel]
    before = np.linspace(-reach, reach, 400)[None]
    after = signal_along(term, before, still, still, 1.0)
    if "error" in rows:
        return chart("Added to the signal", f"before, {unit}", unit, [Curve(before[0], (after - before)[0])])
    curves = [
        Curve(before[0], before[0], "reference", "unchanged"),
        Curve(before[0], after[0], "first", "after the effect"),
    ]
    return chart("Signal", f"before, {unit}", f"after, {unit}", curves)
