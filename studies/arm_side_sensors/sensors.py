"""What sensors behind the gears add to motor angles and torques: information about springs, and a check of it.

At each line a robot's linear model answers the reported torque u in all sensors, ``y = G(p) u + e``; noise of the
torque reaches all sensors alike, so that ``C = N + G S G^H`` with N the noise of the sensors and S that of the torque.
Information is ``2 Re (dG u)^H C^-1 (dG u)`` over lines, experiments and poses, and what drawings promise of bodies.
Friction is viscous, and the arm moves little: what both do beyond is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from robid_core import ComplexArray, FloatArray, FreeParameters, Robot

STEP = 1e-3  # of differences, in natural scales
BODIES = 0.01  # what a drawing promises, relative
SEPARATE = ("stiffness", "damping")
LARGEST = 1e4  # factor on an amplitude that is looked at


@dataclass(frozen=True)
class Sensor:
    """Outputs of the linear model, with the noise of a sample of each."""

    outputs: tuple[str, ...]
    noise: float
    """Rms of a sample, in the unit of the outputs."""


MOTOR = Sensor(("motor_angle",), 1e-4)  # rad at the motor, a resolver
ADDED = {
    "link encoders": Sensor(("arm_angle",), 5e-6),  # rad at the joint, one second of arc
    "joint torque sensors": Sensor(("joint_torque",), 0.5),  # N m, a thousandth of a strain gauge's range
    "accelerometer at axis_6": Sensor(("frame_acceleration.axis_6",), 0.02),  # m/s^2, micromechanical
    "accelerometer at axis_3": Sensor(("frame_acceleration.axis_3",), 0.02),
}
SETS: dict[str, tuple[str, ...]] = {
    "motor side only": (),
    **{name: (name,) for name in ADDED},
    "link encoders and joint torque sensors": ("link encoders", "joint torque sensors"),
    "all": tuple(ADDED),
}


@dataclass(frozen=True, eq=False)
class Experiment:
    """Poses, lines and torques of all experiments, and the noise of the reported torque."""

    angle: FloatArray
    """Shape (n_config, n_axis), rad."""
    frequency_hz: FloatArray
    torque: ComplexArray
    """Spectra with the scale of a mean over samples, N m, shape (n_config, n_exp, n_line, n_axis)."""
    n_sample: int
    """All samples of an experiment, its periods together."""
    torque_noise: float
    """Rms of a sample, as a share of the torque's limit."""


def experiment(robot: Robot, seed: int, n_config: int = 4, n_line: int = 40) -> Experiment:
    """Multisines from 4 to 80 Hz with a tenth of each motor's torque limit, rms; 16 s of each."""
    draw = np.random.default_rng(seed)
    angle = draw.uniform(-0.8, 0.8, (n_config, robot.n_axis))
    limit, n_exp = robot.drives.torque_limit, robot.n_axis
    phase = draw.uniform(0, 2 * np.pi, (n_config, n_exp, n_line, robot.n_axis))
    rms = 0.1 * limit
    torque = rms / np.sqrt(2 * n_line) * np.exp(1j * phase)  # power of a real sine: 2 |U|^2
    n_sample = round(16.0 / robot.sample_time_s)
    return Experiment(angle, np.geomspace(4.0, 80.0, n_line), torque, n_sample, 1e-3)


@dataclass(frozen=True, eq=False)
class Study:
    """A robot, what is unknown of it, and what is measured."""

    robot: Robot
    experiment: Experiment
    sensors: tuple[Sensor, ...]

    @cached_property
    def free(self) -> FreeParameters:
        """Springs and dampers as they are wide, bodies and rotors as drawings promise."""
        kinds = {name: self.robot.parameter_kind(name) for name in self.robot.layout}
        names = [n for n, kind in kinds.items() if kind in (*SEPARATE, "inertia") or n.endswith(".viscous")]
        bodies = {name: BODIES for name in names if kinds[name] == "inertia"}
        return FreeParameters.of_robot(self.robot, names, bodies)

    @property
    def springs(self) -> list[int]:
        """Numbers of the springs among the unknowns."""
        return [i for i, n in enumerate(self.free.names) if self.robot.parameter_kind(n) == "stiffness"]

    @cached_property
    def spread(self) -> FloatArray:
        """Noise of each output, rms of a sample, (n_out,)."""
        model = self.robot.linearize(self.experiment.angle[0], self._outputs)
        kinds = {output: sensor.noise for sensor in self.sensors for output in sensor.outputs}
        return np.array([kinds[name.rpartition(".")[0]] for name in model.output_names])

    @property
    def _outputs(self) -> tuple[str, ...]:
        return tuple(output for sensor in self.sensors for output in sensor.outputs)

    def response(self, point: FloatArray) -> ComplexArray:
        """Response of all outputs, (n_config, n_line, n_out, n_axis)."""
        robot, found = self.free.robot_at(point), []
        shift = 2j * np.pi * self.experiment.frequency_hz[:, None, None]
        for angle in self.experiment.angle:
            model = robot.linearize(angle, self._outputs)
            state = np.linalg.solve(
                shift * np.eye(len(model.a)) - model.a, model.b[None].astype(np.complex128)
            )
            found.append(model.c @ state + model.d)
        return np.stack(found)

    @cached_property
    def derivatives(self) -> ComplexArray:
        """Of the outputs' spectra, (n_config, n_exp, n_line, n_out, n_unknown)."""
        columns = []
        for i in range(len(self.free.names)):
            step = STEP * np.eye(len(self.free.names))[i]
            change = (self.response(step) - self.response(-step)) / (2 * STEP)
            columns.append(np.einsum("clyu,cxlu->cxly", change, self.experiment.torque))
        return np.stack(columns, axis=-1)

    def covariance(self, point: FloatArray) -> ComplexArray:
        """Of a line of the outputs' spectra, (n_config, n_line, n_out, n_out)."""
        response = self.response(point)
        reported = (self.experiment.torque_noise * self.robot.drives.torque_limit) ** 2
        common = (response * reported) @ response.conj().swapaxes(-1, -2)
        return (np.diag(self.spread**2) + common) / self.experiment.n_sample

    @cached_property
    def information(self) -> FloatArray:
        """Of the data alone, (n_unknown, n_unknown)."""
        slopes = rows(self.derivatives, self.covariance(np.zeros(len(self.free.names))))
        result: FloatArray = slopes.T @ slopes
        return result

    def chosen(self, names: Sequence[str]) -> Study:
        """Return the study with the motor side and some of the added sensors; derivatives are kept."""
        sensors = (MOTOR, *(ADDED[name] for name in names))
        wanted = [output for sensor in sensors for output in sensor.outputs]
        model = self.robot.linearize(self.experiment.angle[0], self._outputs)
        kept = [i for i, name in enumerate(model.output_names) if name.rpartition(".")[0] in wanted]
        other = replace(self, sensors=sensors)
        vars(other)["derivatives"] = self.derivatives[..., kept, :]
        return other


def rows(spectra: ComplexArray, covariance: ComplexArray) -> FloatArray:
    """Spectra (n_config, n_exp, n_line, n_out, n) in standard deviations, real and imaginary parts, (n_row, n)."""
    white = np.linalg.solve(np.linalg.cholesky(covariance)[:, None], spectra) * np.sqrt(2.0)
    flat = white.reshape(-1, spectra.shape[-1])
    return np.concatenate((flat.real, flat.imag))


def errors(study: Study, amplitude: float = 1.0) -> FloatArray:
    """Relative standard error of each spring with torques so many times larger, (n_spring,)."""
    inverse = scipy.linalg.inv(amplitude**2 * study.information + np.diag(1 / study.free.prior**2))
    slope = study.free.jacobian(np.zeros(len(study.free.names)))[study.springs]
    own = np.einsum("si,ij,sj->s", slope, inverse, slope)
    result: FloatArray = np.sqrt(own) / study.free.start[study.springs]
    return result


def amplitude_for(study: Study, wanted: FloatArray) -> FloatArray:
    """Factor on all torques with which each spring's error is as wanted, (n_spring,); LARGEST where none is enough."""
    found = []
    for k, error in enumerate(wanted.tolist()):
        low, high = -np.log(LARGEST), np.log(LARGEST)
        for _ in range(30):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if errors(study, float(np.exp(middle)))[k] > error else (low, middle)
        found.append(float(np.exp(high)))
    return np.array(found)


def deviations(study: Study, seed: int, rounds: int = 6) -> FloatArray:
    """Springs of a fit to simulated noisy spectra, less the true ones, in stated errors, (n_spring,).

    Drawings are off as far as they promise. It begins at the truth: the scatter is looked at, not the way there.
    """
    draw, n = np.random.default_rng(seed), len(study.free.names)
    true, told = np.zeros(n), np.minimum(study.free.prior, BODIES) * draw.standard_normal(n)
    data = study.experiment
    variance = (data.torque_noise * study.robot.drives.torque_limit) ** 2 / data.n_sample
    acting = data.torque + np.sqrt(variance / 2) * _noise(draw, data.torque.shape)
    spectra = np.einsum("clyu,cxlu->cxly", study.response(true), acting)
    spectra += study.spread / np.sqrt(2 * data.n_sample) * _noise(draw, spectra.shape)
    precision, point = np.diag(1 / study.free.prior**2), true
    for _ in range(rounds):
        # Noise of the torque nearly cancels between sensors: by the present response, not by that of the told robot.
        covariance = study.covariance(point)
        predicted = np.einsum("clyu,cxlu->cxly", study.response(point), data.torque)
        left = rows((spectra - predicted)[..., None], covariance)[:, 0]
        slopes = rows(study.derivatives, covariance)
        hessian = slopes.T @ slopes + precision
        point = point + np.linalg.solve(hessian, slopes.T @ left - precision @ (point - told))
    spread = np.sqrt(np.diag(np.linalg.inv(hessian)))
    result: FloatArray = ((point - true) / spread)[study.springs]
    return result


def _noise(draw: np.random.Generator, shape: tuple[int, ...]) -> ComplexArray:
    """Complex noise of unit variance in real and imaginary part."""
    result: ComplexArray = draw.standard_normal(shape) + 1j * draw.standard_normal(shape)
    return result
