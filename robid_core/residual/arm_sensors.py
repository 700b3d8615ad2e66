"""Sensors behind the gears as further rows of the residual: encoders at the links, torque sensors in the joints.

Motor motion Q is measured, and what is behind the motors follows it: ``x = X X_m^-1 Q`` of the linear model, and what a
prescribed motion adds. An encoder shows the joint's coordinate, a torque sensor its spring and damper,
``(k + i w d) e^T x``. Noise of the motors' angles is in these rows as it is in those of the torques. Means are left
out: zeros of such sensors are not known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.artifacts import DenseRun
from robid_core.errors import ConfigurationError, DataRejected
from robid_core.estimation.torque.periodic import drift_of
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.mechanics import output_slopes
from robid_core.residual.columns import LinearSlopes, passive_motion
from robid_core.robot import Robot

POSITION, TORQUE = CHANNELS = ("joint_position", "joint_torque")


@dataclass(frozen=True)
class ArmSensor:
    """One sensor behind one gear."""

    channel: str
    axis: int


@dataclass(frozen=True, eq=False)
class ArmSpectra:
    """What sensors behind the gears show, rad and N m, zero in the mean."""

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

        `sensing` holds errors of the gains and delays, s, shape (2, n_sensor).
        """
        turn = np.exp(1j * omega[:, None] * sensing[1])
        difference: ComplexArray = turn * self.spectrum - (1 + sensing[0]) * predicted
        return difference

    def advancing(self, shown: ComplexArray, omega: FloatArray) -> ComplexArray:
        """Derivative, by the time by which samples come earlier, of spectra like the measured ones, their shape."""
        slope: ComplexArray = 1j * omega[:, None] * shown
        return slope

    # What a robot says of it

    def linear(self, robot: Robot, angle: FloatArray, omega: FloatArray, swing: ComplexArray) -> ComplexArray:
        """Spectra of the linear model for motor angles, (n_config, ..., n_bin, n_sensor), zero in the first bin.

        `angle` are the poses, rad, (n_config, n_axis), `swing` the spectra, (n_config, ..., n_bin, n_axis).
        """
        outputs, follow = self.outputs(robot, omega[1:]), passive_motion(robot, angle, omega[1:])
        shown = np.matmul(outputs, follow)
        found = np.zeros((*swing.shape[:-1], len(self.sensors)), dtype=np.complex128)
        found[..., 1:, :] = np.einsum("cfsa,c...fa->c...fs", shown, swing[..., 1:, :])
        return found

    def simulated(self, robot: Robot, motion: MotionSpectra, coordinates: FloatArray) -> ComplexArray:
        """Spectra of a prescribed motion's coordinates, (n_config * n_exp, n_time, n_coordinate)."""
        lanes = coordinates.reshape(*motion.angle.shape[:3], -1)
        outputs = self.outputs(robot, motion.omega)
        found: ComplexArray = np.einsum("fsn,cxfn->cxfs", outputs, motion.spectrum_of(lanes))
        found[:, :, 0] = 0.0
        return found

    def outputs(self, robot: Robot, omega: FloatArray) -> ComplexArray:
        """What each sensor shows of the coordinates, (n_bin, n_sensor, n_coordinate)."""
        mechanism, (stiffness, damping) = robot.mechanism, robot.spring_arrays()
        found = np.empty((len(omega), len(self.sensors), mechanism.n_coordinate), dtype=np.complex128)
        for k, sensor in enumerate(self.sensors):
            if sensor.channel == POSITION:
                found[:, k] = mechanism.constraint_map[mechanism.arm[sensor.axis]]
            else:
                s = gear_spring(robot, sensor.axis)
                found[:, k] = np.outer(stiffness[s] + 1j * omega * damping[s], mechanism.spring_directions[s])
        return found

    def slopes(
        self, robot: Robot, omega: FloatArray, swing: ComplexArray, linear: LinearSlopes
    ) -> ComplexArray:
        """Derivatives of one configuration, (n_bin, n_exp, n_sensor, n_change), bins above zero.

        Spectra of the motor angles, `swing`, have shape (n_bin, n_exp, n_axis).
        """
        outputs, change = self.outputs(robot, omega), linear.slopes.change
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
    for name in channels:
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
    spectra = np.stack(columns, axis=-1)
    spectra[..., 0, :] = 0.0
    mean = spectra.mean(axis=2)
    return ArmSpectra(tuple(sensors), mean, spectra - mean[:, :, None])


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
        if sensor.channel == TORQUE and not robot.mechanism.elastic_gear[sensor.axis]:
            raise ConfigurationError(
                f"arm_side: joint_torque of {robot.axis_names[sensor.axis]}: its gear is rigid, and only a spring's "
                "torque is predicted; leave that axis out of the channel"
            )


def gear_spring(robot: Robot, axis: int) -> int:
    """Return the number of an axis' gear among the springs."""
    return int(np.count_nonzero(robot.mechanism.elastic_gear[:axis]))
