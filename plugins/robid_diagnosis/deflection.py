"""What encoders at motors and links say of gears: their deflection against the torque, with bounds, and no more.

Axis by axis the difference of both angles is fitted with a time shift of the channels, the gear's compliance and what
hangs back when direction or torque turn (`link_encoder.py`). What is said is what holds in every block of the
recording and under every choice that these data do not decide; a stiffness has an upper bound only where some
deflection is sure.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from robid_core import DataRejected, Diagnosis, DiagnosisStage, FloatArray, ParameterTable, Record, Robot
from robid_diagnosis.link_encoder import AxisMotion, Deflection, deflection_of, is_computed

FEWEST = 400  # samples of an axis
OWN = 0.02  # of the torque's square: less beside angle, speed and direction is not told from them
ERRORS = 1.96  # in half an interval of 95 %


class GearDeflection(DiagnosisStage):
    """Bounds of each gear's stiffness and lost motion, from encoders on both sides of it.

    The record has `joint_position` beside motor angle and torque, of all axes or of some. Give it the robot of a fit:
    how much of the torque is friction before the gear bounds what may be lost motion. A link channel that was computed
    from the motor's is refused; a time shift between the two is reported as such, never as stiffness or damping.

    Example::

        encoders: {use: diagnosis.deflection, inputs: {record: acquire, robot: fit}}
    """

    highest_hz: PositiveFloat = 10.0
    """Above, the arm's own vibration would be taken for the gear's."""
    blocks: Annotated[int, Field(ge=5, le=100)] = 10
    """Parts of the recording of which each is left out once."""
    skip_s: NonNegativeFloat = 0.1
    """Left out at both ends of each experiment."""
    torque_error: Annotated[float, Field(ge=0, lt=1)] = 0.05
    """Share by which recorded torques may be wrong: a motor's constant falls as its magnets get warm."""

    def run(self, record: Record, robot: Robot) -> Diagnosis:
        """Fit every axis that has both encoders, and say what that carries."""
        lines, names, units, rows = list[str](), list[str](), list[str](), list[tuple[float, float]]()
        for axis, name in enumerate(robot.axis_names):
            motions = motions_of(record, robot, axis)
            if not motions:
                continue
            found = self._of_axis(motions, robot, axis)
            if isinstance(found, str):
                lines.append(f"{name}: {found}.")
                continue
            lines.append(f"{name}: {_sentence(found)}.")
            prismatic = robot.parameter_unit(f"friction.{name}.viscous") == "N s/m"
            length, per_force = ("m", "m/N") if prismatic else ("rad", "rad/(N m)")
            for noun, unit, interval in (
                ("gear_compliance", per_force, found.compliance),
                ("time_shift", "s", found.shift_s),
                ("reversal", length, found.reversal),
                *((("play", length, found.play),) if found.play else ()),
            ):
                names.append(f"{noun}.{name}")
                units.append(unit)
                rows.append((interval.middle, interval.half / ERRORS))
        if not lines:
            raise DataRejected(
                "diagnosis.deflection: no axis has an angle of its link; map the encoder behind the gear as "
                "joint_position: {column: ..., side: joint}, with axes: [...] where some axes have none"
            )
        silent = [name for name in robot.axis_names if not any(line.startswith(f"{name}:") for line in lines)]
        if silent:
            lines.append(f"{', '.join(silent)}: no encoder behind the gear.")
        value, error = np.array(rows).reshape(-1, 2).T
        return Diagnosis(
            method="encoders at motors and links",
            verdict="\n".join(lines),
            values=ParameterTable(
                names=tuple(names),
                units=tuple(units),
                groups=("deflection",) * len(names),
                start=np.zeros(len(names)),
                estimate=value,
                standard_error=error,
                reported=np.ones(len(names), dtype=bool),
                at_bound=np.zeros(len(names), dtype=bool),
            ),
        )

    def _of_axis(self, motions: list[AxisMotion], robot: Robot, axis: int) -> Deflection | str:
        """Return what was found, or why nothing can be."""
        if all(is_computed(one.motor, one.link) for one in motions):
            return (
                "the link's angle is the motor's to its last digit: computed, or too coarse to show a deflection. "
                "It says nothing of the gear"
            )
        friction = float(
            np.abs(np.linalg.inv(robot.drives.gear.T) @ np.diag(robot.drives.coulomb))[axis].sum()
        )
        found = deflection_of(motions, self.highest_hz, self.skip_s, self.blocks, friction, self.torque_error)
        if found.own < OWN:
            return (
                f"the torque is a function of angle, speed and direction to {100 * found.own:.1g} %: a deflection by "
                "torque looks like a time shift or an encoder's error; record a motion of several frequencies"
            )
        if found.compliance.high <= 0:
            return (
                "the link runs ahead where the torque pushes, beyond any doubt: no gear does that. The channel was "
                "filtered or computed, or the signs of torque and angle do not agree"
            )
        return found


def motions_of(record: Record, robot: Robot, axis: int) -> list[AxisMotion]:
    """Both angles and the torque of one axis at the joint, of all experiments; none where the link has no encoder.

    Raises DataRejected where a channel is missing, has holes, or is too short.
    """
    found = []
    inverse = np.linalg.inv(robot.drives.gear)
    rotor = float((inverse.T @ np.diag(robot.drives.rotor_inertia) @ inverse)[axis, axis])
    for run in record.runs:
        signals = run.lanes("motor_position"), run.lanes("motor_torque"), run.lanes("joint_position")
        for motor, torque, link in zip(*signals, strict=True):
            if not np.isfinite(link[:, axis]).any():
                continue
            one = AxisMotion(
                robot.joint_angle(motor)[:, axis],
                link[:, axis],
                (torque @ inverse)[:, axis],
                rotor,
                run.sample_time_s,
            )
            _check(one, robot.axis_names[axis])
            found.append(one)
    return found


def _check(one: AxisMotion, name: str) -> None:
    channels: tuple[FloatArray, ...] = (one.motor, one.link, one.torque)
    if not all(np.isfinite(values).all() for values in channels):
        raise DataRejected(
            f"diagnosis.deflection: a channel of {name} has holes; cut the recording there, or read it with "
            "gaps: split"
        )
    if len(one.motor) < FEWEST:
        raise DataRejected(
            f"diagnosis.deflection: {len(one.motor)} samples of {name}; it needs {FEWEST} in one piece"
        )
    if np.ptp(one.motor) == 0:
        raise DataRejected(
            f"diagnosis.deflection: {name} does not move; leave it out of joint_position (axes: [...])"
        )


def _sentence(found: Deflection) -> str:
    """Say what was found at one axis."""
    c = found.compliance
    unit = "N m/rad"
    stiffness = (
        f"gear stiffness {1 / c.high:.2g} to {1 / c.low:.2g} {unit}"
        if c.low > 0
        else f"gear stiffness at least {1 / c.high:.2g} {unit}; these data give no upper bound"
    )
    late = found.shift_s
    way = "comes late" if late.middle > 0 else "comes early"
    shift = (
        f"the link's channel {way} by {1e3 * abs(late.middle):.3g} ± {1e3 * late.half:.1g} ms, damping included: "
        "a time shift, and no stiffness"
        if abs(late.middle) > late.half
        else f"no time shift between the channels beyond {1e3 * (abs(late.middle) + late.half):.2g} ms"
    )
    return (
        f"{stiffness}; {shift}; {_lost('when the direction turns', found.reversal.low, found.reversal.high)}; "
        + (
            _lost("when the torque turns", found.play.low, found.play.high)
            if found.play
            else "the torque does not turn, play cannot be seen"
        )
        + f"; deflection {1e6 * found.size:.3g} urad rms, {1e6 * found.left:.3g} of it unexplained"
    )


def _lost(when: str, low: float, high: float) -> str:
    """Lost motion as far as it is bounded."""
    if high <= 0:
        return f"{when} the link runs ahead: no lost motion does that"
    if low > 0:
        return f"{when} {1e6 * low:.2g} to {1e6 * high:.2g} urad of lost motion"
    return f"{when} at most {1e6 * high:.2g} urad of lost motion"
