"""Sensors behind the gears in a cut of a motion, under the window that torques and accelerations have.

What a cut adds to `arm_sensors`: a sensor's zero leaks into the lowest bins, and is an unknown of each experiment; what
rings from before the first sample is in these rows as it is in the torques; links follow the motors' angles and speeds,
which a window does not let integrate from accelerations, and only what they bend by is taken from those. A delay moves
the samples, and not the window.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray, IntArray
from robid_core.artifacts import DenseRun
from robid_core.errors import DataRejected
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.estimation.torque.windowed import WindowedMotion
from robid_core.residual.arm_sensors import (
    POSITION,
    ArmSensor,
    ArmSpectra,
    check_components,
    gear_spring,
)
from robid_core.residual.inertial_units import channels_of, shown_by_inertial
from robid_core.robot import Robot

SLOW = 100.0  # times slower than the first bin: there deflections and links follow quasi-statically


@dataclass(frozen=True, eq=False)
class WindowedArm(ArmSpectra):
    """What sensors behind the gears show of cuts, rad, N m, m/s^2 and rad/s, less the mean over each cut."""

    values: FloatArray
    """At the samples, (n_config, n_exp, n_time, n_sensor)."""
    motion: WindowedMotion

    @classmethod
    def of_run(cls, run: DenseRun, motion: WindowedMotion, channels: tuple[str, ...]) -> WindowedArm:
        """Transform channels behind the gears, of the axes that have them.

        Raises DataRejected where a channel is not there, or knows an axis in some of its samples only.
        """
        sensors, columns = [], []
        shape = motion.angle.shape[:2]
        for name in channels_of(channels):
            values = run.values(name)
            lanes = values.reshape(*shape, -1, values.shape[-1])[:, :, : motion.n_sample]
            known = np.isfinite(lanes)
            for axis in np.flatnonzero(known.any(axis=(0, 1, 2))).tolist():
                if not known[..., axis].all():
                    raise DataRejected(f"A05: a sample of {name} is missing or NaN; leave its experiment out")
                sensors.append(ArmSensor(name, axis))
                columns.append(lanes[..., axis])
        if not sensors:
            raise DataRejected(f"arm_side: no axis has a sample of {', '.join(channels)}")
        check_components(sensors)
        shown = np.stack(columns, axis=-1)
        shown = shown - shown.mean(axis=2, keepdims=True)
        spectrum = motion.spectrum_of(shown)
        return cls(tuple(sensors), spectrum, np.empty((*shape, 0, *spectrum.shape[2:])), shown, motion)

    def thinned(self, keep: IntArray) -> WindowedArm:
        """Return the same with some of the bins only."""
        spectrum, deviation = self.spectrum[..., keep, :], self.deviation[..., keep, :]
        return replace(self, spectrum=spectrum, deviation=deviation, motion=self.motion.thinned(keep))

    def first(self, motion: WindowedMotion) -> WindowedArm:
        """Return the first experiments of each configuration, as many as a motion has."""
        n = motion.angle.shape[1]
        return replace(
            self,
            spectrum=self.spectrum[:, :n],
            deviation=self.deviation[:, :n],
            values=self.values[:, :n],
            motion=motion,
        )

    def residual(self, predicted: ComplexArray, sensing: FloatArray, omega: FloatArray) -> ComplexArray:
        """Likewise, less what a zero of each experiment explains where every bin counts alike."""
        predicted = predicted @ self.mounting(sensing[2]).T
        difference: ComplexArray = self._earlier(sensing[1]) - (1 + sensing[0]) * predicted
        constant = self.motion.constant
        share = np.einsum("f,cxfs->cxs", constant.conj(), difference).real / np.vdot(constant, constant).real
        difference -= constant[:, None] * share[:, :, None]
        return difference

    def advancing(self, shown: ComplexArray, omega: FloatArray) -> ComplexArray:
        """Of the measured ones, whose zeros are small, less what a window that moves with the samples would add."""
        slope: ComplexArray = super().advancing(self.spectrum, omega) - self.motion.window_slope(self.values)
        return slope

    def _earlier(self, late: FloatArray) -> ComplexArray:
        """Spectra of the samples without delays, s, (n_sensor,)."""
        if not late.any():
            return self.spectrum

        def turn(omega: FloatArray) -> ComplexArray:
            found: ComplexArray = np.exp(-1j * omega[:, None] * late)
            return found

        return self.motion.spectrum_of(self.motion.divided(self.values, turn))

    # What a robot says of it

    @cached_property
    def _angle(self) -> ComplexArray:
        """Spectra of the motor angles under the window, rad, (n_config, n_exp, n_bin, n_axis)."""
        return self.motion.spectrum_of(self.motion.angle)

    @cached_property
    def _speed(self) -> ComplexArray:
        """Likewise of the motor speeds, rad/s."""
        return self.motion.spectrum_of(self.motion.rate(1))

    def bending(self, robot: Robot) -> ComplexArray:
        """Measured spectra less what rigid gears show: what a model of springs has to say."""
        found, mechanism = self.spectrum.copy(), robot.mechanism
        for k, sensor in enumerate(self.sensors):
            if sensor.channel == POSITION:
                gear = mechanism.constraint_map[mechanism.arm[sensor.axis], : robot.n_axis]
                rigid = self._angle @ gear
                found[..., k] -= rigid - self.motion.constant * rigid[..., :1] / self.motion.constant[0]
        return found

    def linear(self, robot: Robot, angle: FloatArray, omega: FloatArray, swing: ComplexArray) -> ComplexArray:
        """Spectra of the linear model, (n_config, n_exp, n_bin, n_sensor): links follow the angles and bend beside."""
        slow = omega[1] / SLOW
        still = self.follow(robot, angle, np.array([slow]))[:, 0]
        found = super().linear(robot, angle, omega, swing)
        found += np.einsum("csa,cxfa->cxfs", still, self._angle - swing)
        rates = [k for k, sensor in enumerate(self.sensors) if sensor.is_rate]
        if rates:
            beside = self._speed - 1j * omega[:, None] * swing
            found[..., rates] += np.einsum("csa,cxfa->cxfs", still[:, rates] / (1j * slow), beside)
        return found

    def simulated(self, robot: Robot, motion: MotionSpectra, coordinates: FloatArray) -> ComplexArray:
        """Spectra of a prescribed motion's coordinates, (n_config * n_exp, n_time, n_coordinate)."""
        mechanism, (stiffness, damping) = robot.mechanism, robot.spring_arrays()
        lanes = coordinates.reshape(*motion.angle.shape[:3], -1)
        shown = np.empty((*lanes.shape[:3], len(self.sensors)))
        units = {
            axis: np.moveaxis(shown_by_inertial(robot, axis, np.moveaxis(lanes, 2, 0), periodic=False), 0, 2)
            for axis in sorted({sensor.axis for sensor in self.sensors if sensor.is_inertial})
        }
        for k, sensor in enumerate(self.sensors):
            if sensor.is_inertial:
                shown[..., k] = units[sensor.axis][..., sensor.component]
                continue
            if sensor.channel == POSITION:
                shown[..., k] = lanes @ mechanism.constraint_map[mechanism.arm[sensor.axis]]
                continue
            s = gear_spring(robot, sensor.axis)
            bent = (lanes @ mechanism.spring_directions[s])[..., None]
            rate = motion.between(bent, 1, 1, 0.0)
            shown[..., k] = (stiffness[s] * bent + damping[s] * rate)[..., 0]
        return motion.spectrum_of(shown)

    def of_state(self, robot: Robot, angle: FloatArray, acceleration: FloatArray) -> FloatArray:
        """What sensors show of angles and rates behind motors that stand, (n_pose, n_sensor, 2 n_behind).

        `angle` are the poses, joint-side, rad, (n_pose, n_axis), `acceleration` is that of each state of the linear
        model, (n_pose, n_behind, 2 n_behind).
        """
        n, mechanism, (stiffness, damping) = robot.n_axis, robot.mechanism, robot.spring_arrays()
        found = np.zeros((len(angle), len(self.sensors), 2, mechanism.n_coordinate - n))
        shaken = np.zeros((len(angle), len(self.sensors), mechanism.n_coordinate - n))
        at_0_and_1 = self.outputs(robot, angle, np.array([0.0, 1.0]))[..., n:]
        for k, sensor in enumerate(self.sensors):
            if sensor.is_rate:
                found[:, k, 1] = at_0_and_1[:, 1, k].imag
            elif sensor.is_inertial:
                found[:, k, 0] = at_0_and_1[:, 0, k].real
                shaken[:, k] = (at_0_and_1[:, 0, k] - at_0_and_1[:, 1, k]).real
            elif sensor.channel == POSITION:
                found[:, k, 0] = mechanism.constraint_map[mechanism.arm[sensor.axis], n:]
            else:
                s = gear_spring(robot, sensor.axis)
                direction = mechanism.spring_directions[s, n:]
                found[:, k] = stiffness[s] * direction, damping[s] * direction
        of_states: FloatArray = found.reshape(*found.shape[:2], -1) + shaken @ acceleration
        return of_states

    def zeros(self) -> ComplexArray:
        """Spectra of a sensor's zero in all rows behind the gears, (n_bin, n_sensor, n_sensor)."""
        found: ComplexArray = self.motion.constant[:, None, None] * np.eye(len(self.sensors))
        return found
