"""Sensors behind the gears as further rows of the residual: encoders, torque sensors, inertial units on links.

Motor motion Q is measured, and what is behind the motors follows it: ``x = X X_m^-1 Q`` of the linear model, and what a
prescribed motion adds. An encoder shows the joint's coordinate, a torque sensor its spring and damper,
``(k + i w d) e^T x``, an inertial unit acceleration and rate of turn of its link (`mechanics.inertial_sensor`). Noise
of the motors' angles is in these rows as it is in those of the torques. Means are left out: zeros of such sensors are
not known. Nor is how an inertial unit is turned on its link: by a small rotation R it shows ``R^T v``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.artifacts import DenseRun
from robid_core.errors import ConfigurationError, DataRejected
from robid_core.estimation.torque.periodic import drift_of
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.mechanics import output_slopes
from robid_core.residual.columns import LinearSlopes, passive_motion
from robid_core.residual.inertial_units import (
    INERTIAL,
    TURN_RATE,
    channels_of,
    inertial_of,
    shown_by_inertial,
)
from robid_core.robot import Robot

POSITION, TORQUE = "joint_position", "joint_torque"
TURN = 1e-6  # rad: rotations are differentiated by it, to 1e-10


@dataclass(frozen=True)
class ArmSensor:
    """One sensor behind one gear, or one component of an inertial unit on its link."""

    channel: str
    axis: int

    @property
    def kind(self) -> str:
        """The channel's name without a component."""
        return self.channel[:-2] if self.is_inertial else self.channel

    @property
    def is_inertial(self) -> bool:
        """Whether it is on a link."""
        return self.channel.startswith(INERTIAL)

    @property
    def is_rate(self) -> bool:
        """Whether it shows how fast a link turns."""
        return self.kind == TURN_RATE

    @property
    def component(self) -> int:
        """Which of the six components of an inertial unit it is, accelerations first."""
        return 3 * INERTIAL.index(self.kind) + "xyz".index(self.channel[-1])


@dataclass(frozen=True, eq=False)
class ArmSpectra:
    """What sensors behind the gears show, rad, N m, m/s^2 and rad/s, zero in the mean."""

    sensors: tuple[ArmSensor, ...]
    spectrum: ComplexArray
    """Mean of the periods, shape (n_config, n_exp, n_bin, n_sensor)."""
    deviation: ComplexArray
    """Each period's spectrum less their mean, shape (n_config, n_exp, n_period, n_bin, n_sensor)."""

    def thinned(self, keep: IntArray) -> ArmSpectra:
        """Return the same with some of the bins only."""
        return replace(self, spectrum=self.spectrum[..., keep, :], deviation=self.deviation[..., keep, :])

    def residual(self, predicted: ComplexArray, sensing: FloatArray, omega: FloatArray) -> ComplexArray:
        """Measured less predicted spectra, (n_config, n_exp, n_bin, n_sensor).

        `sensing` holds errors of the gains, delays, s, and angles of the mounting, rad, shape (3, n_sensor).
        """
        turn = np.exp(1j * omega[:, None] * sensing[1])
        predicted = predicted @ self.mounting(sensing[2]).T
        difference: ComplexArray = turn * self.spectrum - (1 + sensing[0]) * predicted
        return difference

    @cached_property
    def units(self) -> tuple[list[int], ...]:
        """Numbers of the three sensors of each kind on each link, x, y and z."""
        place = {(one.channel, one.axis): k for k, one in enumerate(self.sensors)}
        of = dict.fromkeys((one.kind, one.axis) for one in self.sensors if one.is_inertial)
        return tuple([place[name, axis] for name in channels_of([kind])] for kind, axis in of)

    def mounting(self, angle: FloatArray) -> FloatArray:
        """What sensors show of what they would show were they turned as told, (n_sensor, n_sensor).

        `angle` holds for each component of an inertial unit that of the rotation vector by which the unit is turned,
        rad, (n_sensor,).
        """
        found = np.eye(len(self.sensors))
        for three in self.units:
            found[np.ix_(three, three)] = Rotation.from_rotvec(angle[three]).as_matrix().T
        return found

    def mounting_slopes(self, angle: FloatArray) -> list[FloatArray]:
        """Derivatives of `mounting`, central differences, by each angle of inertial units in the order of sensors."""
        found = []
        for k in (k for k, one in enumerate(self.sensors) if one.is_inertial):
            step = np.zeros(len(self.sensors))
            step[k] = TURN
            found.append((self.mounting(angle + step) - self.mounting(angle - step)) / (2 * TURN))
        return found

    def advancing(self, shown: ComplexArray, omega: FloatArray) -> ComplexArray:
        """Derivative, by the time by which samples come earlier, of spectra like the measured ones, their shape."""
        slope: ComplexArray = 1j * omega[:, None] * shown
        return slope

    # What a robot says of it

    def follow(self, robot: Robot, angle: FloatArray, omega: FloatArray) -> ComplexArray:
        """What sensors show per motor angle, (n_config, n_omega, n_sensor, n_axis)."""
        shown: ComplexArray = np.matmul(
            self.outputs(robot, angle, omega), passive_motion(robot, angle, omega)
        )
        return shown

    def linear(self, robot: Robot, angle: FloatArray, omega: FloatArray, swing: ComplexArray) -> ComplexArray:
        """Spectra of the linear model for motor angles, (n_config, ..., n_bin, n_sensor), zero in the first bin.

        `angle` are the poses, rad, (n_config, n_axis), `swing` the spectra, (n_config, ..., n_bin, n_axis).
        """
        shown = self.follow(robot, angle, omega[1:])
        found = np.zeros((*swing.shape[:-1], len(self.sensors)), dtype=np.complex128)
        found[..., 1:, :] = np.einsum("cfsa,c...fa->c...fs", shown, swing[..., 1:, :])
        return found

    def simulated(self, robot: Robot, motion: MotionSpectra, coordinates: FloatArray) -> ComplexArray:
        """Spectra of a prescribed motion's coordinates, (n_config * n_exp, n_time, n_coordinate)."""
        lanes = coordinates.reshape(*motion.angle.shape[:3], -1)
        outputs = self.outputs(robot, None, motion.omega)[0]
        found: ComplexArray = np.einsum("fsn,cxfn->cxfs", outputs, motion.spectrum_of(lanes))
        for axis in sorted({one.axis for one in self.sensors if one.is_inertial}):
            shown = shown_by_inertial(robot, axis, np.moveaxis(lanes, 2, 0), periodic=True)
            spectra = motion.spectrum_of(np.moveaxis(shown, 0, 2))
            for k, sensor in enumerate(self.sensors):
                if sensor.is_inertial and sensor.axis == axis:
                    found[..., k] = spectra[..., sensor.component]
        found[:, :, 0] = 0.0
        return found

    def outputs(self, robot: Robot, angle: FloatArray | None, omega: FloatArray) -> ComplexArray:
        """What each sensor shows of the coordinates, (n_config, n_bin, n_sensor, n_coordinate).

        `angle` are the poses, rad, (n_config, n_axis): inertial units see their links turn in them. Without poses
        there is one configuration, and nothing in the rows of such units.
        """
        mechanism, (stiffness, damping) = robot.mechanism, robot.spring_arrays()
        n_config = 1 if angle is None else len(angle)
        found = np.zeros(
            (n_config, len(omega), len(self.sensors), mechanism.n_coordinate), dtype=np.complex128
        )
        inertial = {} if angle is None else self._inertial_outputs(robot, angle, omega)
        for k, sensor in enumerate(self.sensors):
            if sensor.is_inertial:
                if inertial:
                    found[:, :, k] = inertial[sensor.axis][:, :, sensor.component]
            elif sensor.channel == POSITION:
                found[:, :, k] = mechanism.constraint_map[mechanism.arm[sensor.axis]]
            else:
                s = gear_spring(robot, sensor.axis)
                found[:, :, k] = np.outer(
                    stiffness[s] + 1j * omega * damping[s], mechanism.spring_directions[s]
                )
        return found

    def _inertial_outputs(
        self, robot: Robot, angle: FloatArray, omega: FloatArray
    ) -> dict[int, ComplexArray]:
        """By the axis of an inertial unit what it shows of the coordinates, (n_config, n_bin, 6, n_coordinate)."""
        axes = sorted({sensor.axis for sensor in self.sensors if sensor.is_inertial})
        if not axes:
            return {}
        joints = robot.mechanism.constraint_map
        rest = robot.equilibrium(angle).position @ joints.T
        return {axis: inertial_of(robot, axis).linear(robot.chain, rest, omega) @ joints for axis in axes}

    def slopes(
        self, robot: Robot, angle: FloatArray, omega: FloatArray, swing: ComplexArray, linear: LinearSlopes
    ) -> ComplexArray:
        """Derivatives of one configuration, (n_bin, n_exp, n_sensor, n_change), bins above zero.

        Its pose, `angle`, has shape (n_axis,), spectra of the motor angles, `swing`, (n_bin, n_exp, n_axis). That an
        inertial unit is turned where the arm sags more is left out.
        """
        (outputs,), change = self.outputs(robot, angle[None], omega), linear.slopes.change
        found, moving = output_slopes(linear.model, linear.slopes, omega, swing, outputs)
        for k, sensor in enumerate(self.sensors):
            if sensor.channel == TORQUE:
                s = gear_spring(robot, sensor.axis)
                bent = np.einsum("n,fnx->fx", robot.mechanism.spring_directions[s], moving)
                size = change.stiffness[:, s] + 1j * omega[:, None] * change.damping[:, s]
                found[:, :, k] += bent[..., None] * size[:, None]
        return found


def arm_spectra_of(run: DenseRun, discard: int, n_bin: int, channels: Sequence[str]) -> ArmSpectra:
    """Transform channels behind the gears of a periodic run, of the axes that have them.

    Raises
    ------
    DataRejected
        Where a channel is not there, or knows an axis in some of its samples only.
    """
    sensors, columns = [], []
    for name in channels_of(channels):
        values = run.values(name)[:, :, :, discard:]
        n_config, _, _, n_period, n_sample, _ = values.shape
        known = np.isfinite(values)
        for axis in np.flatnonzero(known.any(axis=(0, 1, 2, 3, 4))).tolist():
            if not known[..., axis].all():
                raise DataRejected(f"A05: a sample of {name} is missing or NaN; drop its period")
            rows = values[..., axis].reshape(n_config, -1, n_period, n_sample, 1)
            if name == POSITION:
                rows = rows - drift_of(rows) * ((np.arange(n_sample) + 0.5) / n_sample - 0.5)[:, None]
            sensors.append(ArmSensor(name, axis))
            columns.append(np.fft.rfft(rows[..., 0], axis=3)[..., :n_bin] / n_sample)
    if not sensors:
        raise DataRejected(f"arm_side: no axis has a sample of {', '.join(channels)}")
    check_components(sensors)
    spectra = np.stack(columns, axis=-1)
    spectra[..., 0, :] = 0.0
    mean = spectra.mean(axis=2)
    return ArmSpectra(tuple(sensors), mean, spectra - mean[:, :, None])


def check_components(sensors: Sequence[ArmSensor]) -> None:
    """Refuse inertial units of which a component is missing; DataRejected."""
    have = {(sensor.channel, sensor.axis) for sensor in sensors}
    for sensor in sensors:
        lacking = [name for name in channels_of([sensor.kind]) if (name, sensor.axis) not in have]
        if lacking:
            raise DataRejected(
                f"arm_side: {sensor.kind} of one axis has no {' and no '.join(lacking)}: units are turned a little on "
                "their links, and each component shows a part of the others; map all three"
            )


def check_sensors(robot: Robot, sensors: Sequence[ArmSensor]) -> None:
    """Refuse sensors of which a robot cannot say what they show; ConfigurationError."""
    if any(sensor.channel == TORQUE for sensor in sensors) and robot.bending_forces:
        raise ConfigurationError(
            "arm_side: joint_torque is predicted by springs and dampers of gears, and effects act beside them in "
            f"{robot.name}; leave joint_torque out"
        )
    if any(term.channel == "position" for term in robot.signals):
        raise ConfigurationError(
            f"arm_side: {robot.name} has laws on measured motor angles, beside which sensors behind the gears are not "
            "predicted; leave arm_side out"
        )
    for sensor in sensors:
        if sensor.is_inertial:
            inertial_of(robot, sensor.axis)
        if sensor.channel == TORQUE and not robot.mechanism.elastic_gear[sensor.axis]:
            raise ConfigurationError(
                f"arm_side: joint_torque of {robot.axis_names[sensor.axis]}: its gear is rigid, and only a spring's "
                "torque is predicted; leave that axis out of the channel"
            )


def gear_spring(robot: Robot, axis: int) -> int:
    """Return the number of an axis' gear among the springs."""
    return int(np.count_nonzero(robot.mechanism.elastic_gear[:axis]))
