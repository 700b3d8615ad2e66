"""One record under one variant of the robot: what was measured, and what torque the model gives for its motion.

``e^(i w d) T = Z(p) A + g(p) + N + sum_k c_k Phi_k``: T and A are spectra of measured torque and acceleration, Z the
inverse response of the linear model and g what holds its weight, N what a prescribed motion of the nonlinear model adds
(held while the unknowns move, renewed between passes), Phi_k functions of the measured speed, d the torque's delay.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, Literal, Self, TypeVar

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.effect import SignalEffect
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.weights import covariance_of, whitener
from robid_core.parameters import FreeParameters
from robid_core.residual.arm_sensors import ArmSpectra
from robid_core.residual.between_samples import friction_between_samples
from robid_core.residual.columns import BodyDerivatives
from robid_core.residual.impedance import impedance
from robid_core.residual.motor_laws import MotorLaws, braking_beside, motor_effects, motor_laws, renewed
from robid_core.residual.moving_samples import MovingSamples
from robid_core.residual.signals import SignalColumn, added_torque, signal_columns, true_motion
from robid_core.residual.simulated_columns import SimulatedColumn, simulated_columns
from robid_core.robot import Robot
from robid_core.robot.effects import channel_gain

M = TypeVar("M", bound=MotionSpectra)


@dataclass(eq=False)
class TorqueBlock(ABC, Generic[M]):
    """Measured spectra of one record, and what the robot under which it was measured gives for them."""

    robot: Robot
    """Without Coulomb friction at the motors; the free parameters are set on it."""
    recorded: M
    """As the sensors told it."""
    motion: M
    """Without what laws on signals make of it."""
    laws: SpeedFunctions
    """Functions of speed that stand for friction."""
    friction: ComplexArray
    """Spectra of these functions and of a constant, shape (n_law + 1, n_config, n_exp, n_bin, n_axis)."""
    added: ComplexArray
    """What laws on motor torques add to the commanded ones, shape (n_config, n_exp, n_bin, n_axis)."""
    angle: FloatArray
    """Joint-side angles about which the model is linear, rad, shape (n_config, n_axis)."""
    arm: ArmSpectra | None = field(default=None, kw_only=True)
    """What sensors behind the gears show: rows after those of the motors' torques. None: there are none."""
    moving: MovingSamples | None = field(default=None, kw_only=True)
    """Samples that count in each row, of a motion with rests; None: all."""
    remainder: ComplexArray = field(init=False)
    """Shape (n_config, n_exp, n_bin, n_row)."""
    reported: ComplexArray | None = field(init=False, default=None)
    """Gain of laws on reported torques, (n_bin, n_axis); None: there is none. Residuals and derivatives are told as
    they are reported: noise is, and a gain that is taken off a record must not make it smaller."""
    commanded: ComplexArray = field(init=False)
    """Expected torques about which laws on motor torques were evaluated, no delay, (n_config, n_exp, n_bin, n_axis)."""
    drive_gain: ComplexArray | None = field(init=False, default=None)
    """What acts over what is commanded by these laws, (n_bin, n_axis); None: there is none. What is compared are
    commands: where a model asks for another torque, it asks for that over this gain as another command."""
    on_motors: tuple[MotorLaws, ...] = field(init=False, default=())
    """Effects that brake motors by their own speed, of each configuration; none where there are none."""
    braking: ComplexArray = field(init=False)
    """Their torque, but for what the linear model has of it, shape of `added`."""
    unresolved: ComplexArray = field(init=False)
    """Covariance of what samples do not resolve of friction, (n_bin, n_row, n_row)."""
    about: FloatArray | None = field(init=False, default=None)
    """Coordinates at which the remainder was taken, shape (n_free,)."""
    simulated: tuple[SimulatedColumn, ...] = field(init=False, default=())
    by_motion: Literal["least", "bent", "all"] = field(init=False, default="bent")
    """Which derivatives are those of prescribed motions: only those that nothing else knows, those for springs and
    dampers of a robot with nonlinear springs, too, or those for all springs, dampers and bodies."""
    signal_columns: tuple[SignalColumn, ...] = field(init=False, default=())
    signals_about: FloatArray | None = field(init=False, default=None)
    """Coordinates at which laws on signals were evaluated, shape (n_free,)."""
    bodies: BodyDerivatives | None = field(init=False, default=None)
    """Derivatives by inertial parameters where they were last taken."""
    _differentiated: tuple[FreeParameters, M, str, FloatArray] | None = field(init=False, default=None)
    """Parameters, motion, kind and coordinates, (n_free,), of the derivatives that were taken last."""
    _last_robot: tuple[FreeParameters, FloatArray, Robot] | None = field(init=False, default=None)
    """That of the last coordinates, (n_free,): one point is asked about many times."""
    _last_linear: tuple[Robot, M, ComplexArray] | None = field(init=False, default=None)
    """Rows of the linear model for the last robot and motion."""

    def __post_init__(self) -> None:
        self.remainder = np.zeros_like(self.measured)
        self.commanded = np.zeros_like(self.motion.torque_spectrum)
        self.braking = np.zeros_like(self.motion.torque_spectrum)
        _, _, n_bin, n_row = self.remainder.shape
        self.unresolved = np.zeros((n_bin, n_row, n_row), dtype=np.complex128)

    @property
    def measured(self) -> ComplexArray:
        """Spectra of the motors' torques, then of sensors behind the gears, (n_config, n_exp, n_bin, n_row)."""
        torque = self.motion.torque_spectrum
        return torque if self.arm is None else np.concatenate((torque, self.arm.spectrum), axis=-1)

    @property
    def bending(self) -> ComplexArray:
        """Measured spectra that a model error is relative to, likewise."""
        return self.measured

    # What kinds of records differ in

    @abstractmethod
    def simulated_rows(self, robots: Sequence[Robot], final: bool) -> list[ComplexArray]:
        """Spectra of the torque that this motion takes of each robot, smooth between samples, and of sensors behind it.

        Shape (n_config, n_exp, n_bin, n_row) each. `final` tells that there is one robot, that of the present point,
        not one beside it.
        """

    @abstractmethod
    def coordinates(self, robot: Robot) -> FloatArray:
        """All coordinates of a robot in this motion at the samples, as the last prescribed motion left them.

        Shape (n_config * n_exp, n_sample, n_coordinate), rad or m.
        """

    @abstractmethod
    def measured_noise(self, robot: Robot, coefficient: FloatArray) -> ComplexArray:
        """Covariance that sensors leave in the residual, (n_bin, n_row, n_row); arguments as of `predicted`."""

    @property
    @abstractmethod
    def noise_source(self) -> str:
        """What the misfit is measured against, in words."""

    @property
    @abstractmethod
    def noise_freedom(self) -> float:
        """Complex degrees of freedom of the noise at each bin."""

    @property
    def moves_far(self) -> bool:
        """Whether the arm leaves what a linear model can tell."""
        return False

    @property
    def linear_is_enough(self) -> bool:
        """Whether the linear model knows the derivatives; in a cut a window treats angle and acceleration apart."""
        return not (self.moves_far or self.initial_state_unknown)

    @property
    def initial_state_unknown(self) -> bool:
        """Whether the state behind the motors at the first sample is unknown."""
        return False

    @property
    def used(self) -> npt.NDArray[np.bool_] | None:
        """Experiments that count, (n_config, n_exp); None: all.

        Left out are those in which a robot rattles without end, though the machine repeated its motion.
        """
        return None

    @property
    def share(self) -> FloatArray:
        """Share of the data that count in each bin and row, (n_config, n_exp, n_bin, n_row)."""
        return np.ones(self.remainder.shape) if self.moving is None else self.moving.share

    def counted(self, rows: ComplexArray) -> ComplexArray:
        """Return what of residuals or measured rows counts, (n_config, n_exp, n_bin, n_row)."""
        return rows if self.moving is None else self.moving.of(rows)

    def at_full_power(self, rows: ComplexArray) -> ComplexArray:
        """Likewise, as large as if all samples counted: what covariances are taken of."""
        return rows if self.moving is None else self.moving.at_full_power(rows)

    def take_back(self, left: FloatArray) -> None:
        """Let experiments count again that the last robot explains as well as others.

        `left`: mean power of the residual in the noise, (n_config, n_exp).
        """

    def free_vibration(self, robot: Robot) -> ComplexArray | None:
        """Rows of the free vibration from an unknown initial state, and of zeros; None where the motion repeats.

        Shape (n_config, n_exp, n_bin, n_row, n_state).
        """
        return None

    def improve_initial_state(self, robot: Robot, residual: ComplexArray, whitener: ComplexArray) -> None:
        """Begin the next prescribed motion as residuals tell, (n_config, n_exp, n_bin, n_row)."""

    def go_on_from(self, other: Self) -> None:
        """Begin where another block of the same record ended; its robot differs little."""
        self.bodies = other.bodies

    def noise(self, robot: Robot, coefficient: FloatArray) -> ComplexArray:
        """Covariance of the residual where the model is right, (n_bin, n_row, n_row); arguments as of `predicted`."""
        return self.measured_noise(robot, coefficient) + self.unresolved

    def renew_friction(self, robot: Robot, coefficient: FloatArray) -> None:
        """Evaluate the functions of speed anew, with what friction and held torque do to the speed between samples.

        Arguments as of `predicted`.
        """
        n_axis = robot.n_axis
        known = self.motion, self.laws, self.angle, coefficient
        on_motors = motor_laws(robot, self.motion, self.coordinates)
        self.friction, unresolved, self.on_motors = friction_between_samples(robot, *known, on_motors)
        self.braking = braking_beside(self.on_motors, robot, self.motion, self.linear_torque)
        rows = np.zeros_like(self.remainder)
        rows[..., :n_axis] = unresolved
        self.unresolved[:, :n_axis, :n_axis] = covariance_of(self.at_full_power(rows)[..., :n_axis])

    def thinned(self, keep: IntArray) -> Self:
        """Return the block with some of its bins, before any motion was prescribed."""
        return replace(
            self,
            recorded=self.recorded.thinned(keep),
            motion=self.motion.thinned(keep),
            friction=self.friction[:, :, :, keep],
            added=self.added[:, :, keep],
            arm=None if self.arm is None else self.arm.thinned(keep),
        )

    def robot_at(self, free: FreeParameters, coordinates: FloatArray) -> Robot:
        """Return this block's robot with the free parameters at some coordinates: the last one, asked for again."""
        last = self._last_robot
        if last is None or last[0] is not free or not np.array_equal(last[1], coordinates):
            self._last_robot = last = free, coordinates.copy(), free.set_on(self.robot, coordinates)
        return last[2]

    # Torque

    def predicted(self, robot: Robot, coordinates: FloatArray, coefficient: FloatArray) -> ComplexArray:
        """Spectra without delays, torques and sensors behind the gears, shape (n_config, n_exp, n_bin, n_row).

        Parameters
        ----------
        robot
            At these coordinates of the free parameters.
        coordinates
            Shape (n_free,).
        coefficient
            Of the functions of speed, N m, shape (n_law, n_axis).
        """
        rows = self.linear_rows(robot)
        rows += self.remainder
        if self.about is not None:
            for column in self.simulated:
                rows += (coordinates - self.about)[column.index] * column.remainder
        torque = rows[..., : robot.n_axis]
        torque += self.braking
        for law, size in zip(self.friction, coefficient, strict=True):
            torque += law * size
        torque -= self.added
        if self.signals_about is not None:
            for of_signal in self.signal_columns:
                torque += (coordinates - self.signals_about)[of_signal.index] * of_signal.torque
        if self.drive_gain is not None:
            torque -= self.commanded
            torque /= self.drive_gain
            torque += self.commanded
        return rows

    def linear_torque(self, robot: Robot) -> ComplexArray:
        """Torque spectra of a robot's linear model, (n_config, n_exp, n_bin, n_axis)."""
        z = impedance(robot, self.angle, self.motion)
        torque: ComplexArray = np.matmul(z[:, None], self.motion.acceleration_spectrum[..., None])[..., 0]
        torque += self._weight_torque(robot)
        return torque

    def linear_rows(self, robot: Robot) -> ComplexArray:
        """Spectra of a robot's linear model, torques and sensors behind the gears, (n_config, n_exp, n_bin, n_row)."""
        motion, last = self.motion, self._last_linear
        if last is None or last[0] is not robot or last[1] is not motion:
            rows = self.linear_torque(robot)
            if self.arm is not None:
                shown = self.arm.linear(robot, self.angle, motion.omega, motion.angle_spectrum)
                rows = np.concatenate((rows, shown), axis=-1)
            self._last_linear = last = robot, motion, rows
        return last[2].copy()

    def residual(
        self, predicted: ComplexArray, delay: FloatArray, sensing: FloatArray | None = None
    ) -> ComplexArray:
        """Measured spectra, delays taken off, less predicted ones, (n_config, n_exp, n_bin, n_row).

        `delay` of the torques has shape (1,), or (n_axis,); `sensing` holds errors of the gains, delays and mounting
        angles of sensors behind the gears, (3, n_sensor).
        """
        n_axis = self.robot.n_axis
        difference: ComplexArray = self.motion.advanced_torque(delay) - predicted[..., :n_axis]
        if self.reported is not None:
            difference *= self.reported
        if self.arm is None:
            return difference
        sensing = np.zeros((3, len(self.arm.sensors))) if sensing is None else sensing
        behind = self.arm.residual(predicted[..., n_axis:], sensing, self.motion.omega)
        return np.concatenate((difference, behind), axis=-1)

    def expected(self, residual: ComplexArray, delay: FloatArray) -> M:
        """Return the motion with the torques that the model predicts: measured without their delay and residual."""
        return self.motion.less(self._as_acting(residual), delay)

    def _as_acting(self, residual: ComplexArray) -> ComplexArray:
        """Residuals of torques before laws on reported ones, their shape."""
        return residual if self.reported is None else residual / self.reported

    def renew_signals(
        self, free: FreeParameters, coordinates: FloatArray, residual: ComplexArray, delay: FloatArray
    ) -> None:
        """Evaluate laws on signals anew, and their derivatives.

        Along the torque that is expected: a law in proportion to the measured one would fit its noise; where a law on
        the motor torque is not invertible, along the recorded one. `residual` and `delay` belong to these coordinates.
        """
        robot = self.robot_at(free, coordinates)
        if not robot.signals:
            return
        self.motion = true_motion(robot, self.recorded)
        only_recorded = [
            bound.place.axis
            for bound in robot.effects
            if issubclass(bound.effect, SignalEffect) and not bound.effect.invertible
        ]
        residual = residual[..., : robot.n_axis].copy()
        residual[..., only_recorded] = 0.0
        expected = self.expected(residual, delay)
        self.added = added_torque(robot, expected)
        if any(term.channel == "torque" for term in robot.signals):
            self.commanded = self.motion.advanced_torque(delay) - self._as_acting(residual)
            self.drive_gain = channel_gain(robot, "torque", self.motion.omega)
            self.drive_gain[:, only_recorded] = 1.0
        z = impedance(robot, self.angle, self.motion)
        self.signal_columns = signal_columns(free, coordinates, robot, expected, z)
        self.signals_about = coordinates.copy()
        if any(term.channel == "torque_measurement" for term in robot.signals):
            self.reported = channel_gain(robot, "torque_measurement", self.motion.omega)

    def renew(self, free: FreeParameters, coordinates: FloatArray) -> None:
        """Prescribe the measured motion to the model; effects on motors go on at the speeds that are known of them."""
        robot, self.about = self.robot_at(free, coordinates), coordinates.copy()
        (self.remainder,) = self.remainders([robot], final=True)
        self.on_motors = renewed(self.on_motors, robot, self.motion, self.coordinates)
        self.braking = braking_beside(self.on_motors, robot, self.motion, self.linear_torque)

    def differentiate(self, free: FreeParameters, coordinates: FloatArray) -> None:
        """Take the derivatives that the linear model's spectra do not know, after `renew`; once at each point."""
        last = self._differentiated
        same = last is not None and last[0] is free and last[1] is self.motion and last[2] == self.by_motion
        if last is None or not same or self.initial_state_unknown or not np.array_equal(last[3], coordinates):
            self.simulated = simulated_columns(self, free, coordinates)
            self._differentiated = free, self.motion, self.by_motion, coordinates.copy()

    def slopes_in_time(
        self, robot: Robot, others: Sequence[Robot], steps: Sequence[float]
    ) -> list[ComplexArray] | None:
        """Derivatives of the remainder by the linear model over time, where that knows them; None: it does not.

        `others` are the robot with one parameter moved by a step each; (n_config, n_exp, n_bin, n_row) each.
        """
        return None

    def remainders(self, robots: Sequence[Robot], final: bool) -> list[ComplexArray]:
        """What the linear model leaves out of the torque: moving inertia, gravity along the motion, nonlinear springs.

        Prescribed motion less the linear model, both of a smooth motion between the samples, so that what a held torque
        does there cancels. Without effects on motors. Arguments as of `simulated_rows`.
        """
        robots = [robot.without_effect(*motor_effects(robot)) for robot in robots]
        motion, found = self.motion, self.simulated_rows(robots, final)
        for robot, rows in zip(robots, found, strict=True):
            torque, shown = rows[..., : robot.n_axis], rows[..., robot.n_axis :]
            torque -= self.smooth_torque(robot)
            torque -= self._weight_torque(robot)
            if self.arm is not None:
                shown -= self.arm.linear(robot, self.angle, motion.omega, motion.angle_spectrum)
        return found

    def smooth_torque(self, robot: Robot) -> ComplexArray:
        """Spectra of the linear model's torque where it is smooth between samples, no weight, as of `linear_torque`."""
        smooth = impedance(robot, self.angle, self.motion, "continuous") / self.motion.hold[:, None, None]
        torque: ComplexArray = np.matmul(smooth[:, None], self.motion.acceleration_spectrum[..., None])[
            ..., 0
        ]
        return torque

    def _weight_torque(self, robot: Robot) -> ComplexArray:
        """Spectra of what holds the arm where it is linearised, shape (n_config, 1, n_bin, n_axis)."""
        return self.motion.constant[:, None] * robot.gravity_torque(self.angle)[:, None, None]

    def weight(self, robot: Robot, coefficient: FloatArray, model_error: float) -> ComplexArray:
        """Whitener of the noise and of a model error relative to what is measured, (n_bin, n_row, n_row)."""
        rows = self.bending
        size = covariance_of(rows)
        size[0] = (np.abs(rows[:, :, 0]) ** 2).mean(axis=(0, 1))  # no neighbour of the lowest bins
        return whitener(self.noise(robot, coefficient) + model_error**2 * size * np.eye(size.shape[-1]))
