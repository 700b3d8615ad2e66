"""Blocks of records that do not repeat: any cut of a motion, large moves included.

Deflections and their rates at the first sample of a cut are not measured. The prescribed motion begins with
quasi-static ones, later with those that the residual tells; what is left is a free vibration of the linear model, and
is projected out of each experiment: unknowns of its own that need no prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.errors import DataRejected
from robid_core.estimation.torque.shown_noise import MORE, shown_noise
from robid_core.estimation.torque.spectra import friction_spectra
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.windowed import WindowedMotion
from robid_core.mechanics import MotorMotion
from robid_core.parameters import FreeParameters
from robid_core.residual.arm_sensors import POSITION, TORQUE, check_sensors
from robid_core.residual.block import TorqueBlock
from robid_core.residual.cut_response import CutResponse
from robid_core.residual.free_vibration import deviation_of, free_vibration, rms_vibration, state_at_first
from robid_core.residual.inertial_units import inertial_noise
from robid_core.residual.moving_samples import MovingSamples
from robid_core.residual.noise_of_angles import noise_of_angles
from robid_core.residual.signals import added_torque, true_motion
from robid_core.residual.vibration_along_motion import moves_far, vibration_along
from robid_core.residual.windowed_arm import WindowedArm
from robid_core.robot import Robot
from robid_core.robot.side_by_side import prescribe_many

UNIFORM = 12  # step squared over the variance of what is rounded
WIDE = 1e3  # of what a row leaves: a sensor's zero is not known
FEW = 2  # experiments of each configuration in a first pass of prescribed motions


@dataclass(eq=False)
class WindowedBlock(TorqueBlock[WindowedMotion]):
    """Spectra of cuts under a window; their noise is that of the sensors in the robot file.

    Angles may show more noise than the file states, as most files that state none: that counts then.
    """

    arm: WindowedArm | None = field(default=None, kw_only=True)
    deviation: FloatArray | None = None
    """Of initial deflections and their rates from quasi-static ones, (n_config, n_exp, n_state)."""
    prescribed: MotorMotion | None = None
    """The motion in steps of the integrator, once it was asked for."""
    _last_rows: tuple[Robot, MotorMotion, FloatArray | None, ComplexArray] | None = field(
        init=False, default=None
    )
    """What this motion took of the last robot that was alone, and how it began: derivatives are taken about it."""
    _last_vibration: tuple[Robot, MotorMotion, ComplexArray] | None = field(init=False, default=None)
    """What deviations of the initial state add, and about which robot."""

    @classmethod
    def of_record(
        cls,
        robot: Robot,
        motion: WindowedMotion,
        laws: SpeedFunctions,
        arm: WindowedArm | None = None,
        moving: MovingSamples | None = None,
    ) -> WindowedBlock:
        """Prepare a block; `moving`: samples that count in the rows of the motors' torques.

        Raises DataRejected where the robot file has no noise of torque, or of a sensor behind the gears: a single cut
        cannot show it.
        """
        if not (robot.drives.torque_noise > 0).all():
            raise DataRejected(
                f"{robot.name}: a motion that does not repeat shows no noise, and the robot file has none; give each "
                "axis sensors: {torque_noise: ...}, the rms in N m of the measured torque at standstill (a record with "
                "periods shows it where it has lines, too: lines: auto beside period_s)"
            )
        if arm is not None:
            check_sensors(robot, arm.sensors)
            _check_noise(robot, arm)
        shown = shown_noise(motion.angle, motion.sample_time_s, float(motion.omega[-1]) / (2 * np.pi))
        told = angle_noise(robot)
        motion = replace(motion, angle_noise=np.where(shown > MORE * told, shown, told))
        recorded, motion = motion, true_motion(robot, motion)
        middle = 0.5 * (motion.angle.max(axis=(1, 2)) + motion.angle.min(axis=(1, 2)))
        friction, added = friction_spectra(motion, laws, motion.fine_speed()), added_torque(robot, motion)
        if moving is not None and arm is not None:
            moving = moving.with_sensors(len(arm.sensors))
        angle = robot.joint_angle(middle)
        return cls(robot, recorded, motion, laws, friction, added, angle, arm=arm, moving=moving)

    @property
    def moves_far(self) -> bool:
        """Whether the arm leaves what a linear model can tell."""
        return moves_far(self.robot, self.motion)

    def thinned(self, keep: npt.NDArray[np.int64]) -> WindowedBlock:
        """Likewise; of long ways the first experiments of each configuration are enough to begin with.

        With rests all bins: samples that count are told from others over time.
        """
        keep = keep if self.moving is None else np.arange(len(self.motion.bin))
        if not self.moves_far:
            return super().thinned(keep)
        motion = _first(self.motion, FEW)
        few = replace(
            self,
            recorded=_first(self.recorded, FEW),
            motion=motion,
            arm=None if self.arm is None else self.arm.first(motion),
            deviation=None,
            prescribed=None,
            friction=self.friction[:, :, :FEW],
            added=self.added[:, :FEW],
            moving=None if self.moving is None else self.moving.first(FEW),
        )
        return super(WindowedBlock, few).thinned(keep)

    def renew_signals(
        self, free: FreeParameters, coordinates: FloatArray, residual: ComplexArray, delay: FloatArray
    ) -> None:
        """Evaluate laws on signals anew; a motion that they change is prescribed anew."""
        super().renew_signals(free, coordinates, residual, delay)
        self.prescribed = None if self.signal_columns else self.prescribed

    def simulated_rows(self, robots: Sequence[Robot], final: bool) -> list[ComplexArray]:
        """Spectra of the torque that this motion takes of each robot, and of sensors behind its gears."""
        motion, last = self._prescribed(robots[0].step_s), self._last_rows
        if len(robots) > 1:
            return self._rows_of(robots, motion)
        (robot,) = robots
        if not (last and last[0] is robot and last[1] is motion and last[2] is self.deviation):
            (rows,) = self._rows_of(robots, motion)
            self._last_rows = last = robot, motion, self.deviation, rows
        return [last[3].copy()]

    def _rows_of(self, robots: Sequence[Robot], motion: MotorMotion) -> list[ComplexArray]:
        """Likewise, in steps of the integrator."""
        begin = motion.angle, motion.speed, self.deviation
        starts, seen = [state_at_first(robot, *begin) for robot in robots], self.arm is not None
        runs = prescribe_many(robots, motion, starts, keep_coordinates=seen)
        shape, step = self.motion.angle.shape, robots[0].step_s
        torques = [self.motion.spectrum_of_means(run.torque.reshape(shape), step) for run in runs]
        if self.arm is None:
            return torques
        rows = []
        for robot, run, torque in zip(robots, runs, torques, strict=True):
            assert run.coordinates is not None
            shown = self.arm.simulated(robot, self.motion, run.coordinates)
            rows.append(np.concatenate((torque, shown), axis=-1))
        return rows

    @property
    def bending(self) -> ComplexArray:
        """Measured spectra; of encoders at the links what rigid gears do not show."""
        if self.arm is None:
            return self.measured
        return np.concatenate((self.motion.torque_spectrum, self.arm.bending(self.robot)), axis=-1)

    def coordinates(self, robot: Robot) -> FloatArray:
        """All coordinates of a robot in this motion, (n_config * n_exp, n_sample, n_coordinate)."""
        motion = self._prescribed(robot.step_s)
        state = state_at_first(robot, motion.angle, motion.speed, self.deviation)
        run = robot.prescribe(motion, state, keep_coordinates=True)
        assert run.coordinates is not None
        return run.coordinates

    def _prescribed(self, step: float) -> MotorMotion:
        if self.prescribed is None:
            self.prescribed = self.motion.motor_motion(step)
        return self.prescribed

    def slopes_in_time(
        self, robot: Robot, others: Sequence[Robot], steps: Sequence[float]
    ) -> list[ComplexArray] | None:
        """Likewise, of motors' torques: where the arm stays near a pose, and no nonlinear spring bends."""
        if self.moves_far or self.arm is not None or robot.bending_forces or not self.initial_state_unknown:
            return None
        shape = self.motion.angle.shape
        moved = self.coordinates(robot).reshape(*shape[:3], -1)
        response, here = (
            CutResponse.of_motion(robot, self.angle, self.motion, moved),
            self.smooth_torque(robot),
        )
        return [
            (response.change(other.second_order(self.angle)) - (self.smooth_torque(other) - here)) / step
            for other, step in zip(others, steps, strict=True)
        ]

    @property
    def initial_state_unknown(self) -> bool:
        """So in a cut of a motion, where there is anything elastic behind the motors."""
        return self.robot.mechanism.n_coordinate > self.robot.n_axis

    def free_vibration(self, robot: Robot) -> ComplexArray | None:
        """Rows of unit deviations of the initial state, then of zeros, (n_config, n_exp, n_bin, n_row, n_unknown)."""
        parts = [self._vibration(robot)] if self.initial_state_unknown else []
        if self.arm is not None:
            zeros = np.pad(self.arm.zeros(), ((0, 0), (robot.n_axis, 0), (0, 0)))
            parts.append(np.broadcast_to(zeros, (*self.motion.angle.shape[:2], *zeros.shape)))
        return np.concatenate(parts, axis=-1) if parts else None

    def _vibration(self, robot: Robot) -> ComplexArray:
        """Rows of unit deviations of the initial state.

        Along the motion where the arm moves far or springs are bent; about the robot to which the motion was
        prescribed last, which is as good as any near it. Sensors behind the gears have the closed form alone.
        """
        last, far = self._last_rows, self.moves_far or bool(robot.bending_forces)
        if self.arm is not None or last is None or not far:
            return free_vibration(robot, self.motion, self.arm)
        about, moved, deviation, _ = last
        known = self._last_vibration
        if known is None or known[0] is not about or known[1] is not moved:
            rms = rms_vibration(about, self.angle, self.motion)
            found = vibration_along(
                about,
                self.motion,
                moved,
                deviation,
                rms,
                lambda torque: self.motion.spectrum_of_means(torque, about.step_s),
            )
            self._last_vibration = known = about, moved, found
        return known[2]

    def improve_initial_state(self, robot: Robot, residual: ComplexArray, whitener: ComplexArray) -> None:
        """Begin the next prescribed motion as residuals tell, so that a linear model is enough for what is left."""
        prior = rms_vibration(robot, self.angle, self.motion)
        shown, n_state = self.free_vibration(robot), prior.shape[1]
        assert shown is not None
        if self.moving is not None:
            shown = self.moving.of(shown)
        if self.arm is not None:
            power = (np.abs(residual[..., robot.n_axis :]) ** 2).sum(axis=2).mean(axis=1)
            prior = np.concatenate((prior, WIDE * np.sqrt(power)), axis=1)
        more = deviation_of(residual, shown, whitener, prior)[..., :n_state]
        self.deviation = more if self.deviation is None else self.deviation + more

    def go_on_from(self, other: WindowedBlock) -> None:
        """Begin with the initial states that another block found, where its robot bends in the same places."""
        super().go_on_from(other)
        if other.robot.mechanism.coordinate_names == self.robot.mechanism.coordinate_names:
            self.deviation = other.deviation

    def measured_noise(self, robot: Robot, coefficient: FloatArray) -> ComplexArray:
        """Covariance of the residual from the noise of the sensors, shape (n_bin, n_row, n_row)."""
        motion, told = self.motion, robot.drives.torque_noise**2
        if self.arm is not None:
            told = np.concatenate((told, _noise_behind(robot, self.arm) ** 2))
        moved = noise_of_angles(robot, self.angle, motion, self.arm, motion.angle_noise)
        return moved + np.diag(told / motion.n_sample)

    @property
    def noise_source(self) -> str:
        """In words."""
        told = "the noise of the sensors that the robot file states"
        more = (self.motion.angle_noise > MORE * angle_noise(self.robot)).any()
        return told + (", and of angles as their spectrum shows it" if more else "")

    @property
    def noise_freedom(self) -> float:
        """Complex degrees of freedom of the noise at each bin: it is told."""
        return float("inf")


def _noise_behind(robot: Robot, arm: WindowedArm) -> FloatArray:
    """Rms of each sensor's noise, rad, N m, m/s^2 and rad/s, (n_sensor,)."""
    drives = robot.drives
    told = {POSITION: drives.joint_position_noise, TORQUE: drives.joint_torque_noise}
    return np.array(
        [
            inertial_noise(robot, one.axis)[one.kind] if one.is_inertial else told[one.channel][one.axis]
            for one in arm.sensors
        ]
    )


def _check_noise(robot: Robot, arm: WindowedArm) -> None:
    for sensor, noise in zip(arm.sensors, _noise_behind(robot, arm), strict=True):
        if not noise > 0:
            word = f"{sensor.kind.removeprefix('link_')}_noise: ..."
            entry = f"inertial: {{{word}}}" if sensor.is_inertial else word
            raise DataRejected(
                f"{robot.name}: a motion that does not repeat shows no noise, and the robot file has none of "
                f"{sensor.kind}; give {robot.axis_names[sensor.axis]} sensors: {{{entry}}}, its rms at standstill"
            )


def angle_noise(robot: Robot) -> FloatArray:
    """Variance of measured motor angles, with that of the encoder's steps, rad^2, (n_axis,)."""
    counts = robot.drives.encoder_counts
    step = np.divide(2 * np.pi, counts, out=np.zeros_like(counts), where=counts > 0)
    variance: FloatArray = robot.drives.position_noise**2 + step**2 / UNIFORM
    return variance


def _first(motion: WindowedMotion, n: int) -> WindowedMotion:
    """Return the first experiments of each configuration."""
    return replace(
        motion,
        rates={},
        angle=motion.angle[:, :n],
        torque=motion.torque[:, :n],
        torque_spectrum=motion.torque_spectrum[:, :n],
        acceleration_spectrum=motion.acceleration_spectrum[:, :n],
    )
