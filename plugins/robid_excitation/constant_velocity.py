"""Sweeps at constant speeds for friction: each axis runs a ladder of speeds to and fro, the others hold still.

The profiles are in `estimation.excitation.velocity_sweep`, and so is what finds the plateaus again in a recorded
reference (`plateaus`). Such a motion is not for a frequency response: it has no lines, and it need not be repeated.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from robid_core import (
    Configurations,
    Context,
    Excitation,
    ExcitationDesign,
    FloatArray,
    MotionRefused,
    Robot,
)
from robid_core.estimation.excitation.fourier_trajectory import Limits
from robid_core.estimation.excitation.velocity_sweep import (
    SETTLE_RAD,
    SETTLE_S,
    Sweep,
    SweepTimes,
    highest_speed,
    plan_sweep,
    sweeps_reference,
)
from robid_core.estimation.rigid.rigid_torque import RigidDrives, motor_inertia, motor_torque
from robid_core.residual import rigid_drives
from robid_excitation.prediction import Level, clear
from robid_excitation.rigid import motion_limits, refuse_without_room

NEARLY = 0.9  # share of the way to a joint limit that is used by default: the loops lag behind and overshoot
PLACES = 9  # along the sweep at which inertia and gravity are looked at
SHORTEST_RAMP_S = 0.05


def motor_room(limits: Limits, drives: RigidDrives, angle: FloatArray, axis: int, together: bool) -> float:
    """How far a motor may turn to either side of a configuration, rad; infinite where nothing limits it.

    A motor of a coupled wrist moves several joints; where all motors run together they share what a joint has.
    """
    centre, motion = np.linalg.solve(drives.gear, angle), np.abs(drives.gear[:, axis])
    sharing = np.count_nonzero(drives.gear, axis=1) if together else np.ones(len(angle))
    joint = np.minimum(limits.joint_upper - angle, angle - limits.joint_lower)
    moved = motion > 0
    own = min(limits.upper[axis] - centre[axis], centre[axis] - limits.lower[axis])
    return float(min(own, (joint[moved] / motion[moved] / sharing[moved]).min()))


def ramp_acceleration(
    limits: Limits, drives: RigidDrives, angle: FloatArray, axis: int, room: float, share: float, speed: float
) -> float:
    """Acceleration that a share of the torque gives which is left beside gravity and friction at a speed, rad/s^2.

    At the places along the sweep where gravity and inertia are largest; zero or less where nothing is left.
    """
    centre = np.linalg.solve(drives.gear, angle)
    places = np.tile(centre, (PLACES, 1))
    places[:, axis] += np.linspace(-1.0, 1.0, PLACES) * (room if np.isfinite(room) else np.pi)
    still = np.zeros_like(places)
    held = np.abs(motor_torque(drives, places, still, still)[:, axis]).max()
    friction = drives.coulomb[axis] + drives.viscous[axis] * speed
    left = limits.torque[axis] - held - friction
    inertia = motor_inertia(drives, places)[:, axis].max()
    return float(min(limits.acceleration[axis], share * left / inertia))


class ConstantVelocity(ExcitationDesign):
    """Speed references for friction: a ladder of constant speeds, both directions, one experiment for each axis.

    Each speed is held for whole motor turns where time and travel allow, so that ripple averages out; ramps have no
    step in acceleration. Every sweep goes to and fro over the same angles, where gravity is the same. One period is
    enough: `acquire: {use: acquisition.drives, with: {periods: 1, settle_periods: 0}}`.

        excite:
          use: excitation.constant_velocity
          with: {steps: 8, lowest_share: 0.005, highest_share: 0.5}
    """

    speeds_rad_s: tuple[PositiveFloat, ...] | None = Field(default=None, min_length=1)
    """Motor speeds of all axes, rad/s; by default a ladder between the shares of each axis' speed limit."""
    steps: int = Field(default=8, ge=2, le=100)
    """Speeds of the ladder, at a constant ratio."""
    lowest_share: float = Field(default=0.005, gt=0, lt=1)
    """Lowest speed, as a share of the speed limit."""
    highest_share: float = Field(default=0.5, gt=0, le=1)
    """Highest speed, as a share of the speed limit; less where the travel does not allow it."""
    together: bool = False
    """All axes at once in a single experiment, in place of one after another."""
    reach_rad: PositiveFloat | None = None
    """How far a joint may go from its configuration, rad (m); by default nine tenths of the way to its nearer limit."""
    plateau_s: PositiveFloat = 0.5
    """Shortest time that is measured at a speed, s."""
    longest_s: PositiveFloat = 4.0
    """Longest time for whole motor turns, s; a speed that needs longer for a turn is measured for `plateau_s`."""
    settle_s: NonNegativeFloat = SETTLE_S
    """Time at constant speed before and after what is measured, s: the loops settle, both directions see the same."""
    settle_rad: NonNegativeFloat = SETTLE_RAD
    """Motor angle at constant speed on top of that, rad: at low speed a reversed motor breaks away late."""
    rest_s: NonNegativeFloat = 0.2
    """Standstill at every turning point, s."""
    ramp_share: float = Field(default=0.3, gt=0, le=1)
    """Share of the torque left by gravity and friction that the ramps take."""
    margin: float = Field(default=0.9, gt=0, le=1)
    """Share of the torque, speed and acceleration limits that may be used."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.lowest_share >= self.highest_share:
            raise ValueError(
                f"lowest_share: {self.lowest_share:g} is not below highest_share: {self.highest_share:g}"
            )
        if self.longest_s < self.plateau_s:
            raise ValueError(f"longest_s: {self.longest_s:g} s is less than plateau_s: {self.plateau_s:g} s")
        return self

    @property
    def n_speed(self) -> int:
        """Speeds of each axis."""
        return self.steps if self.speeds_rad_s is None else len(self.speeds_rad_s)

    @property
    def excites_lines(self) -> bool:
        """No: the motion is not for a frequency response."""
        return False

    def plan_lines(self, upstream: Mapping[str, Any]) -> list[str]:
        """Say what will be asked of the robot, for `robid plan`."""
        counts = [getattr(stage, "count", None) for stage in upstream.values()]
        count = next((f"{number} configurations, " for number in counts if isinstance(number, int)), "")
        ladder = f"from {self.lowest_share:.3g} to {self.highest_share:.3g} of the speed limits"
        if self.speeds_rad_s is not None:
            ladder = f"from {min(self.speeds_rad_s):g} to {max(self.speeds_rad_s):g} rad/s of the motors"
        how = "all axes together" if self.together else "one axis after another"
        reach = "nine tenths of the way to a limit" if self.reach_rad is None else f"{self.reach_rad:g} rad"
        least_s = 2 * self.n_speed * (self.plateau_s + 2 * self.settle_s + self.rest_s)
        return [
            f"{count}{how}, {self.n_speed} speeds in both directions, {ladder}: {2 * self.n_speed} plateaus an axis",
            f"travel up to {reach} to either side, at least {least_s:.3g} s an experiment; no frequency response",
        ]

    def run(self, configurations: Configurations, robot: Robot, context: Context) -> Excitation:
        """Make the sweeps of all configurations and clear them by simulation."""
        drives, angles = rigid_drives(robot), configurations.angle
        profiles: dict[tuple[int, int], FloatArray] = {}
        for number, angle in enumerate(angles):
            for axis in range(robot.n_axis):
                profile, words = self._profile(robot, drives, angle, axis, f"configuration {number + 1}")
                profiles[number, axis] = profile
                context.log.info("configuration %d, %s: %s", number + 1, robot.axis_names[axis], words)
        self._warn_of_slow_loops(robot, context)
        n_exp = 1 if self.together else robot.n_axis
        longest = max(len(profile) for profile in profiles.values())
        reference = np.zeros((len(angles), 1, n_exp, longest, robot.n_axis))
        for (number, axis), profile in profiles.items():
            reference[number, 0, 0 if self.together else axis, : len(profile), axis] = profile
        highest = float(np.abs(reference).max())
        level = Level(
            "speeds_rad_s with a highest speed of" if self.speeds_rad_s else "a highest speed of",
            highest,
            0.0,
        )
        nothing = np.zeros((len(angles), 1, 1, longest, robot.n_axis))
        line = np.zeros(0, dtype=np.int64)
        cleared = clear(reference, nothing, angles, robot, line, self.margin, level)
        return Excitation(
            axis_names=robot.axis_names,
            sample_time_s=robot.sample_time_s,
            slow_sine_bin=0,
            line=line,
            reference=reference,
            slow_sine_speed=np.zeros(robot.n_axis),
            **cleared.artifact_fields(),
        )

    def _profile(
        self, robot: Robot, drives: RigidDrives, angle: FloatArray, axis: int, place: str
    ) -> tuple[FloatArray, str]:
        """Speed of one axis in one configuration, rad/s, and words about it."""
        reach = np.full(robot.n_axis, np.inf if self.reach_rad is None else self.reach_rad)
        limits = motion_limits(robot, angle, reach, self.margin)
        refuse_without_room(robot, drives, limits, angle, place)
        room = motor_room(limits, drives, angle, axis, self.together)
        if self.reach_rad is None:
            room *= NEARLY
        name, top = robot.axis_names[axis], self.highest_share * robot.drives.speed_limit[axis]
        if self.speeds_rad_s is not None:
            top = max(self.speeds_rad_s)
        acceleration = ramp_acceleration(limits, drives, angle, axis, room, self.ramp_share, top)
        if not acceleration > 0:
            raise MotionRefused(
                f"{place}: {name}: gravity and friction at {top:.4g} rad/s leave no torque for the ramps; take another "
                "configuration, less reach_rad or a lower highest speed"
            )
        times = SweepTimes(
            robot.sample_time_s,
            acceleration,
            SHORTEST_RAMP_S,
            self.plateau_s,
            self.longest_s,
            self.settle_s,
            self.settle_rad,
        )
        sweeps = [
            self._sweep(speed, times, room, f"{place}: {name}")
            for speed in self._ladder(times, room, top, axis, robot)
        ]
        profile = sweeps_reference(sweeps, robot.sample_time_s, self.rest_s, acceleration)
        travel = max(sweep.travel(robot.sample_time_s) for sweep in sweeps)
        turning = sum(sweep.whole_turns > 0 for sweep in sweeps)
        words = (
            f"{2 * len(sweeps)} plateaus from {sweeps[0].speed:.4g} to {sweeps[-1].speed:.4g} rad/s, {turning} of "
            f"{len(sweeps)} speeds over whole motor turns, travel {travel:.4g} rad at the motor, "
            f"{len(profile) * robot.sample_time_s:.4g} s"
        )
        return profile, words

    def _warn_of_slow_loops(self, robot: Robot, context: Context) -> None:
        """Say where the nominal speed loops need longer to settle than they are given."""
        d = robot.drives
        for axis, name in enumerate(robot.axis_names):
            if not d.integral_gain[axis] > 0:
                continue
            angle, time_s = (
                2 * d.coulomb[axis] / d.integral_gain[axis],
                d.speed_gain[axis] / d.integral_gain[axis],
            )
            if angle > self.settle_rad or 3 * time_s > self.settle_s:
                context.log.warning(
                    "%s breaks away %.3g rad after a reversal and settles with a time constant of %.3g s; "
                    "settle_rad: %.3g and settle_s: %.3g leave it enough",
                    name,
                    angle,
                    time_s,
                    max(angle, self.settle_rad),
                    max(3 * time_s, self.settle_s),
                )

    def _ladder(self, times: SweepTimes, room: float, top: float, axis: int, robot: Robot) -> list[float]:
        if self.speeds_rad_s is not None:
            return sorted(self.speeds_rad_s)
        highest = min(top, highest_speed(times, 2 * room))
        lowest = self.lowest_share * robot.drives.speed_limit[axis]
        if highest <= lowest:
            raise MotionRefused(
                f"{robot.axis_names[axis]}: the travel of {2 * room:.4g} rad at the motor allows {highest:.4g} rad/s, "
                f"less than the lowest speed of {lowest:.4g} rad/s; lower lowest_share, or give more room"
            )
        return [float(speed) for speed in np.geomspace(lowest, highest, self.steps)]

    def _sweep(self, speed: float, times: SweepTimes, room: float, place: str) -> Sweep:
        sweep = plan_sweep(speed, times, 2 * room)
        if sweep is None:
            raise MotionRefused(
                f"{place}: {speed:.4g} rad/s does not fit into the travel of {2 * room:.4g} rad at the motor; "
                f"the highest that does is {highest_speed(times, 2 * room):.4g} rad/s; lower it, or give more room"
            )
        return sweep
