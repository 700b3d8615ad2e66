"""Blocks of periodic records: whole periods, noise by their differences, motion without beginning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.estimation.torque.periodic import PeriodicMotion, friction_deviation
from robid_core.estimation.torque.shown_noise import MORE, shown_noise
from robid_core.estimation.torque.spectra import MOTION_BAND_HZ, friction_spectra
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.weights import HALF_WINDOW, covariance_of
from robid_core.mechanics import MotorMotion, Simulation, SimulationState, periodic_motion
from robid_core.residual.arm_sensors import ArmSpectra, check_sensors
from robid_core.residual.block import TorqueBlock
from robid_core.residual.columns import passive_motion
from robid_core.residual.impedance import impedance
from robid_core.residual.motor_laws import braking_torque, viscous_of_motors
from robid_core.residual.moving_samples import MovingSamples
from robid_core.residual.noise_of_angles import noise_of_angles
from robid_core.residual.signals import added_torque, true_motion
from robid_core.robot import Robot
from robid_core.robot.side_by_side import prescribe_many

FIRST_PERIODS = 3  # until it has rung out, from the linear motion
NEXT_PERIODS = 2  # likewise, from where the last run ended
STEADY = 0.1  # of the noise: two periods that differ by less are alike, what rang has rung out
EXACT = 1e-5  # of the rms torque: noise below it counts as that
REMAINS = 0.02  # of a difference between two motions, where its derivative is taken
SMALLEST = 1e-30  # (N m)^2
LONGEST_S = 30.0  # of motion: what has not rung out then never will
ROUNDS = 4  # of NEXT_PERIODS: what differs by more than noise in all, and does not shrink, never repeats
NOISE = 1.0  # of the noise: what two periods differ by
FEWEST = 0.5  # of the experiments: where fewer repeat, none is left out
ALIKE = 2.0  # times the power that is left of other experiments, or less: explained as well as they are


@dataclass(eq=False)
class PeriodicBlock(TorqueBlock[PeriodicMotion]):
    """Spectra of periods, the mean of those measured."""

    repeated_noise: FloatArray
    """Variance of what each period's angles err by alike, as by steps of an encoder, rad^2, (n_axis,)."""
    friction_deviation: ComplexArray
    """Functions of each period's speed less their mean, (n_law, n_config, n_exp, n_period, n_bin, n_axis)."""
    law_deviation: ComplexArray | None = field(init=False, default=None)
    """Likewise, of laws on motors, (n_config, n_exp, n_period, n_bin, n_axis); None: there are none."""
    state: SimulationState | None = None
    """Where the last prescribed motion ended, less where the linear model would be."""
    periods: int = field(init=False, default=NEXT_PERIODS)
    """Until a motion beside the last one has rung out."""
    rattles: npt.NDArray[np.bool_] = field(init=False)
    """Experiments that the last robot does not repeat from period to period, (n_config, n_exp)."""
    left_out: npt.NDArray[np.bool_] = field(init=False)
    """Experiments that some robot did not repeat and that none has explained since, (n_config, n_exp)."""
    smooth: tuple[PeriodicMotion, MotorMotion] | None = field(init=False, default=None)
    """A motion, and what of it is prescribed."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.rattles = np.zeros(self.motion.angle.shape[:2], dtype=bool)
        self.left_out = self.rattles.copy()

    @classmethod
    def of_record(
        cls,
        robot: Robot,
        motion: PeriodicMotion,
        laws: SpeedFunctions,
        arm: ArmSpectra | None = None,
        moving: MovingSamples | None = None,
    ) -> PeriodicBlock:
        """Prepare a block; `moving`: samples that count in the rows of the motors' torques."""
        shown = shown_noise(motion.angle, motion.sample_time_s, float(motion.omega[-1]) / (2 * np.pi))
        repeated = np.where(shown > MORE * motion.angle_noise, shown - motion.angle_noise, 0.0)
        motion = replace(motion, angle_noise=motion.angle_noise + repeated)
        recorded, motion = motion, true_motion(robot, motion)
        angle = robot.joint_angle(motion.angle.mean(axis=(1, 2)))
        friction, added = friction_spectra(motion, laws, motion.fine_speed()), added_torque(robot, motion)
        deviation = friction_deviation(motion, laws)
        if arm is not None:
            check_sensors(robot, arm.sensors)
            moving = None if moving is None else moving.with_sensors(len(arm.sensors))
        return cls(
            robot, recorded, motion, laws, friction, added, angle, repeated, deviation, arm=arm, moving=moving
        )

    def thinned(self, keep: npt.NDArray[np.int64]) -> PeriodicBlock:
        """Return the block with some of its bins, before any motion was prescribed; with sticks with all of them."""
        keep = keep if self.moving is None else np.arange(len(self.motion.bin))
        return replace(super().thinned(keep), friction_deviation=self.friction_deviation[..., keep, :])

    def simulated_rows(self, robots: Sequence[Robot], final: bool) -> list[ComplexArray]:
        """Spectra of the torque that this motion takes of each robot, and of sensors behind its gears."""
        motion, whole = self.motion, self._smooth(robots[0].step_s)
        n_sample = motion.angle.shape[2]
        periods = FIRST_PERIODS if self.state is None else NEXT_PERIODS if final else self.periods
        linear = [linear_state(robot, motion, whole) for robot in robots]
        starts = linear if self.state is None else [_shifted(state, self.state, 1.0) for state in linear]
        seen = self.arm is not None
        runs = prescribe_many(robots, whole, starts, periods=periods, keep_coordinates=seen)
        if final:
            runs = [self._rung_out(robots[0], whole, runs[0])]
            self.state = _shifted(runs[0].state, linear[0], -1.0)
        steady = [run.torque[:, -n_sample:].reshape(motion.angle.shape) for run in runs]
        torques = [motion.spectrum_of_means(torque, robots[0].step_s) for torque in steady]
        if self.arm is None:
            return torques
        rows = []
        for robot, run, torque in zip(robots, runs, torques, strict=True):
            assert run.coordinates is not None
            shown = self.arm.simulated(robot, motion, run.coordinates[:, -n_sample:])
            rows.append(np.concatenate((torque, shown), axis=-1))
        return rows

    def _rung_out(self, robot: Robot, whole: MotorMotion, run: Simulation) -> Simulation:
        """Go on with a motion until a period is like the one before: a gap rings for seconds, however short they are.

        How fast that was tells how many periods a motion beside this one takes. Within a wide gap an arm may rattle
        for ever, otherwise in each period, though the machine repeated its motion: that is said of the experiment.
        """
        motion, n_sample = self.motion, self.motion.angle.shape[2]
        noise = (np.abs(motion.torque_deviation) ** 2).mean(axis=(0, 1, 2, 3))
        most = max(1, int(LONGEST_S / (n_sample * motion.sample_time_s)) // NEXT_PERIODS)
        each, changes = list[FloatArray](), list[float]()
        while True:
            last, before = run.torque[:, -n_sample:], run.torque[:, -2 * n_sample : -n_sample]
            spectra = (motion.spectrum_of(one.reshape(motion.angle.shape)) for one in (last, last - before))
            size, moved = ((np.abs(one) ** 2).mean(axis=2) for one in spectra)
            least = np.maximum(noise, EXACT**2 * size.mean(axis=(0, 1)) + SMALLEST)
            each.append(np.sqrt((moved / least).max(axis=-1)))
            self.rattles = _never_repeats(each)
            changes.append(float(np.sqrt((moved[kept := _most(~self.rattles)].mean(axis=0) / least).max())))
            rounds = max(most, ROUNDS) if (each[-1][kept] > NOISE).any() else most
            if changes[-1] <= STEADY or len(changes) >= rounds:
                break
            seen = self.arm is not None
            run = robot.prescribe(whole, run.state, periods=NEXT_PERIODS, keep_coordinates=seen)
        if self.rattles[kept].any():  # more periods are no better
            self.periods = NEXT_PERIODS
        elif len(changes) > 1:
            self.periods = periods_until(REMAINS, changes[-1] / changes[-2], most * NEXT_PERIODS)
        self.left_out |= self.rattles
        return run

    @property
    def used(self) -> npt.NDArray[np.bool_] | None:
        """Experiments that count, (n_config, n_exp); None: all."""
        kept = _most(~self.left_out, ~self.rattles)
        return None if kept.all() else kept

    def take_back(self, left: FloatArray) -> None:
        """Let experiments count again that the last robot repeats, and explains about as well as others.

        Beside a motion that never repeats there may be one that does, and is not that of the machine. `left`: mean
        power of the residual in the noise, (n_config, n_exp).
        """
        others = left[~self.left_out]
        explained = left <= ALIKE * np.median(others) if others.size else np.ones_like(self.left_out)
        self.left_out &= self.rattles | ~explained

    def renew_friction(self, robot: Robot, coefficient: FloatArray) -> None:
        """Likewise, with what the noise of each period's angles does to laws on motors."""
        super().renew_friction(robot, coefficient)
        self.law_deviation = None
        if self.on_motors:
            motion, found = self.motion, np.zeros_like(self.motion.torque_deviation)
            viscous = viscous_of_motors(robot)  # is in the linear model
            for period in range(found.shape[2]):
                speed = motion.speed_of_period(period)
                moved = [laws.at(speed[c : c + 1]) for c, laws in enumerate(self.on_motors)]
                found[:, :, period] = braking_torque(moved, motion)
                found[:, :, period] -= motion.held_spectrum(viscous * speed)
            self.law_deviation = found - found.mean(axis=2, keepdims=True)

    def coordinates(self, robot: Robot) -> FloatArray:
        """All coordinates of a robot in this motion, (n_config * n_exp, n_sample, n_coordinate).

        It may lack laws that this block's robot has.
        """
        whole = self._smooth(robot.step_s)
        state = linear_state(robot, self.motion, whole)
        if self.state is not None:
            state = _shifted(state, _transferred(self.state, self.robot, robot), 1.0)
        run = robot.prescribe(whole, state, keep_coordinates=True)
        assert run.coordinates is not None
        return run.coordinates

    def go_on_from(self, other: PeriodicBlock) -> None:
        """Begin where another block's motions ended; coordinates and laws that its robot lacks begin on their own.

        Experiments are left out because of springs with which a model rattles: a robot that lacks one of them has to
        explain them all.
        """
        super().go_on_from(other)
        if other.state is not None:
            self.state = _transferred(other.state, other.robot, self.robot)
            if _springs(other.robot) <= _springs(self.robot):
                self.left_out = other.left_out.copy()
            self.periods = other.periods

    def _smooth(self, step: float) -> MotorMotion:
        """One period of the motors in the integrator's steps, one lane an experiment."""
        motion = self.motion
        if self.smooth is None or self.smooth[0] is not motion:
            angle = motion.angle.reshape(-1, *motion.angle.shape[2:])
            self.smooth = motion, periodic_motion(angle, motion.sample_time_s, step, MOTION_BAND_HZ)
        return self.smooth[1]

    def measured_noise(self, robot: Robot, coefficient: FloatArray) -> ComplexArray:
        """Covariance of the residual from differences between periods, shape (n_bin, n_row, n_row).

        Noise of the angles is in it as it comes through inertia, springs and friction, what all have alike, too.
        """
        motion = self.motion
        z = impedance(robot, self.angle, motion)
        moved = np.matmul(z[:, None, None], motion.acceleration_deviation[..., None])[..., 0]
        for law, size in zip(self.friction_deviation, coefficient[:-1], strict=True):
            moved += law * size
        if self.law_deviation is not None:
            moved += self.law_deviation
        n_config, n_exp, n_period = motion.torque_deviation.shape[:3]
        freedom = n_config * n_exp * n_period * (n_period - 1)
        left = motion.torque_deviation - moved
        alike: ComplexArray | float = 0.0
        if self.repeated_noise.any():
            alike = noise_of_angles(robot, self.angle, motion, self.arm, self.repeated_noise)
        if self.arm is None:
            return covariance_of(self._of_periods_at_full_power(left), freedom) + alike
        swing = np.zeros_like(left)
        swing[..., 1:, :] = -motion.acceleration_deviation[..., 1:, :] / motion.omega[1:, None] ** 2
        shown = self.arm.deviation - self.arm.linear(robot, self.angle, motion.omega, swing)
        rows, n_axis = self._of_periods_at_full_power(np.concatenate((left, shown), axis=-1)), robot.n_axis
        covariance = covariance_of(rows, freedom) + alike
        covariance[0, :n_axis, n_axis:] = covariance[0, n_axis:, :n_axis] = (
            0.0  # sensors do not show the mean
        )
        return covariance

    def _of_periods_at_full_power(self, rows: ComplexArray) -> ComplexArray:
        """`at_full_power` of rows of each period, (n_config, n_exp, n_period, n_bin, n_row)."""
        if self.moving is None:
            return rows
        return np.stack([self.at_full_power(period) for period in np.moveaxis(rows, 2, 0)], axis=2)

    @property
    def noise_source(self) -> str:
        """In words."""
        alike = ", and of angles as their spectrum shows it" if self.repeated_noise.any() else ""
        return f"differences between periods{alike}"

    @property
    def noise_freedom(self) -> float:
        """Complex degrees of freedom of the noise at each bin, by the row of which least counts."""
        n_config, n_exp, n_period = self.motion.torque_deviation.shape[:3]
        counts = 1.0 if self.moving is None else float((self.moving.weight**2).mean(axis=(0, 1, 2)).min())
        return max(float(n_config * n_exp * (n_period - 1) * (2 * HALF_WINDOW + 1) * counts), 1.0)


def _most(*masks: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return the first mask that keeps enough of the experiments; all of them where none does."""
    return next((mask for mask in masks if mask.mean() >= FEWEST), np.ones_like(masks[0]))


def _never_repeats(changes: Sequence[FloatArray]) -> npt.NDArray[np.bool_]:
    """Whether what two periods differ by, in noise, neither vanishes nor shrinks, from round to round, (...,) each."""
    if len(changes) < ROUNDS:
        return np.zeros(changes[-1].shape, dtype=bool)
    grew = (np.diff(changes[-ROUNDS:], axis=0) > 0).any(axis=0)
    rattles: npt.NDArray[np.bool_] = grew & (np.min(changes[-ROUNDS:], axis=0) > NOISE)
    return rattles


def periods_until(remains: float, kept: float, most: int) -> int:
    """Periods after which a share of a difference is left, of which NEXT_PERIODS keep another share; `most` at most."""
    wanted = NEXT_PERIODS * np.log(remains) / np.log(kept) if kept < 1 else np.inf
    return int(np.ceil(min(max(wanted, NEXT_PERIODS), max(most, NEXT_PERIODS))))


def _shifted(state: SimulationState, by: SimulationState, way: float) -> SimulationState:
    """Return a state that lies beside another by what is told, or by its opposite; laws remember what the other does.

    Parameters change where a linear model swings; what a nonlinear one does beyond hardly changes with them.
    """
    return replace(
        state if way < 0 else by,
        position=state.position + way * by.position,
        speed=state.speed + way * by.speed,
    )


def _transferred(state: SimulationState, before: Robot, robot: Robot) -> SimulationState:
    """Return a state, less where a linear model would be, for another robot, by names of coordinates and laws."""
    names, known = robot.mechanism.coordinate_names, before.mechanism.coordinate_names
    here = [i for i, name in enumerate(names) if name in known]
    there = [known.index(names[i]) for i in here]

    def of_coordinates(values: FloatArray) -> FloatArray:
        found = np.zeros((len(values), len(names)))
        found[:, here] = values[:, there]
        return found

    known_laws = _memories(before)
    parts = np.split(state.law_state, np.cumsum([size for *_, size in known_laws]), axis=1)
    remembered = dict(zip(known_laws, parts, strict=False))
    laws = [remembered.get(key, np.zeros((len(state.position), key[-1]))) for key in _memories(robot)]
    return replace(
        state,
        position=of_coordinates(state.position),
        speed=of_coordinates(state.speed),
        acceleration=of_coordinates(state.acceleration),
        law_state=np.concatenate((np.empty((len(state.position), 0)), *laws), axis=1),
    )


def _springs(robot: Robot) -> set[str]:
    """Labels of the laws that make springs nonlinear."""
    return {term.label for term in robot.bending_forces}


def _memories(robot: Robot) -> list[tuple[str, int, int]]:
    """Laws of forces in the order of their states: label, number among the terms of that label, size of the memory."""
    labels = [term.label for term in robot.forces]
    return [(term.label, labels[:i].count(term.label), term.n_state) for i, term in enumerate(robot.forces)]


def linear_state(robot: Robot, motion: PeriodicMotion, whole: MotorMotion) -> SimulationState:
    """State at the first sample of everything behind the motors, in the periodic motion of the linear model."""
    angle = robot.joint_angle(motion.angle.mean(axis=(1, 2)))
    state = robot.standing(robot.joint_angle(whole.angle)).moving(robot.mechanism, whole.speed)
    n_config, n_exp, _, n_axis = motion.angle.shape
    rest = robot.equilibrium(angle).position
    per_motor = passive_motion(robot, angle, motion.omega[1:])
    swing = np.einsum("cfna,cxfa->cxfn", per_motor[:, :, n_axis:], motion.angle_spectrum[:, :, 1:])
    behind = rest[:, None, n_axis:] + 2 * swing.real.sum(axis=2)
    rate = 2 * (1j * motion.omega[1:, None] * swing).real.sum(axis=2)
    position, speed = state.position.copy(), state.speed.copy()
    position[:, n_axis:] = behind.reshape(n_config * n_exp, -1)
    speed[:, n_axis:] = rate.reshape(n_config * n_exp, -1)
    return replace(state, position=position, speed=speed)
