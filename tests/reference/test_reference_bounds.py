"""Cramer-Rao bounds are what the maximum likelihood estimate of a linear plant reaches."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from reference.best_linear_approximation import moments_of
from reference.bounds import ParameterBound, noise_covariance, parameter_bound, response_variance
from reference.plants import reference_plant

from robid_core import Robot

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

FREQUENCY_HZ = np.geomspace(4.0, 60.0, 16)
N_SAMPLE = 8000


def complex_gaussian(shape: tuple[int, ...], generator: np.random.Generator) -> ComplexArray:
    """Circular complex Gaussian numbers of variance 1."""
    parts = generator.standard_normal((2, *shape)) / np.sqrt(2)
    result: ComplexArray = parts[0] + 1j * parts[1]
    return result


class Case:
    """Plant 1 in three poses, without friction but with damping for it."""

    def __init__(self) -> None:
        plant = reference_plant(1)
        springs = {
            name: value
            for name, value in plant.robot.parameters().items()
            if plant.robot.parameter_kind(name) in ("stiffness", "damping")
        }
        self.robot, self.pose = plant.nominal.with_parameters(springs), plant.pose[:3]
        self.motor_damping = np.tile(3 * self.robot.drives.viscous, (3, 1))
        self.response = self.robot.response(self.pose, FREQUENCY_HZ, self.motor_damping)
        generator = np.random.default_rng(0)
        # Inputs that are neither orthogonal nor of one size: nothing is hidden by a diagonal Gram matrix.
        mixed = np.eye(6) + 0.4 * complex_gaussian((3, len(FREQUENCY_HZ), 6, 6), generator)
        self.u = 0.01 * self.robot.drives.torque_limit[:, None] * mixed  # (n_pose, n_freq, n_axis, n_exp)
        self.gram = self.u @ self.u.conj().swapaxes(-1, -2)
        self.noise = noise_covariance(self.robot, self.response, FREQUENCY_HZ, N_SAMPLE)

    def bound(self) -> ParameterBound:
        """Bound from this one set of experiments."""
        return parameter_bound(self.robot, self.pose, FREQUENCY_HZ, self.gram, self.noise, self.motor_damping)


@pytest.fixture(scope="module")
def case() -> Case:
    return Case()


def test_ratio_of_averages_reaches_the_bound_of_the_response(case: Case) -> None:
    n_run, n_block = 300, 4
    generator = np.random.default_rng(1)
    d, g, u = case.robot.drives, case.response[0], case.u[0]
    shape = (n_run, n_block, *u.shape)
    noise_of_angle = -((2 * np.pi * FREQUENCY_HZ[:, None]) ** 2) * np.hypot(
        d.position_noise, 2 * np.pi / d.encoder_counts / np.sqrt(12)
    )
    measured_u = u + d.torque_noise[:, None] / np.sqrt(N_SAMPLE) * complex_gaussian(shape, generator)
    measured_y = g @ u + noise_of_angle[..., None] / np.sqrt(N_SAMPLE) * complex_gaussian(shape, generator)
    error = (
        np.stack(
            [
                moments_of(measured_u[run], measured_y[run], np.broadcast_to(u, shape[1:])).response
                for run in range(n_run)
            ]
        )
        - g
    )
    bound = response_variance(n_block * case.gram[0], case.noise[0])
    # 300 runs on 16 lines: deviation 1.4 % at most (entries of a line may go together); the ratio is biased by the
    # square of the inputs' relative noise, below 1e-4.
    ratio = np.mean(np.abs(error) ** 2 / bound, axis=0)
    assert ratio.mean() == pytest.approx(1, abs=5 / np.sqrt(n_run * len(FREQUENCY_HZ)))
    # No output or input is left out: by entry, 5 deviations of 300 runs on 16 lines.
    assert ratio.mean(axis=0) == pytest.approx(np.ones((6, 6)), abs=5 / np.sqrt(n_run * len(FREQUENCY_HZ)))


def with_logarithms(case: Case, names: tuple[str, ...], shift: FloatArray) -> tuple[Robot, FloatArray]:
    """Robot and motor damping with parameters multiplied by exp(shift)."""
    known = case.robot.parameters()
    factor = dict(zip(names, np.exp(shift), strict=True))
    robot = case.robot.with_parameters({n: known[n] * f for n, f in factor.items() if n in known})
    own = np.array([factor[f"motor_damping.{name}"] for name in case.robot.axis_names])
    return robot, case.motor_damping * own


def maximum_likelihood(case: Case, names: tuple[str, ...], measured: ComplexArray) -> FloatArray:
    """Logarithms of the parameters relative to the truth, by Fisher scoring from a start 1 % off."""
    shift = np.full(len(names), 0.01)
    weight = np.linalg.inv(case.noise)
    s = 2j * np.pi * FREQUENCY_HZ
    for _ in range(10):
        robot, damping = with_logarithms(case, names, shift)
        gradient = robot.response_with_gradient(case.pose, FREQUENCY_HZ, damping)
        misfit = measured - gradient.response
        stiffness, spring_damping = robot.spring_arrays()
        # d G = -factor x x^T; its part along C^-1 misfit S (S: Gram matrix of the inputs).
        along = weight @ misfit @ case.gram
        spring, motor = (
            np.einsum("pfsi,pfij,pfsj->pfs", x.conj(), along, x.conj())
            for x in (gradient.spring_vectors, gradient.motor_vectors)
        )
        slope = -2 * np.concatenate(
            [
                stiffness * spring.sum(axis=(0, 1)).real,
                spring_damping * np.einsum("f,pfs->s", s.conj(), spring).real,
                np.einsum("f,ps,pfs->s", s.conj(), damping, motor).real,
            ]
        )
        here = parameter_bound(robot, case.pose, FREQUENCY_HZ, case.gram, case.noise, damping)
        step = here.covariance @ slope
        shift = shift + step
        if np.abs(step).max() < 1e-3 * here.standard_error().min():
            return np.asarray(shift)
    raise AssertionError("the likelihood has no maximum near the truth")


def test_maximum_likelihood_of_a_linear_plant_reaches_the_bound_of_its_parameters(case: Case) -> None:
    bound = case.bound()
    information = np.linalg.inv(bound.covariance)
    generator = np.random.default_rng(2)
    n_run, n = 40, len(bound.names)
    roots = np.linalg.cholesky(case.noise), np.linalg.cholesky(np.linalg.inv(case.gram))
    errors = []
    for _ in range(n_run):
        noise = complex_gaussian(case.response.shape, generator)
        # Covariance (U U^H)^-T (x) C_V of vec(G) by columns: C_V^(1/2) N B^H with B B^H = (U U^H)^-1.
        measured = case.response + roots[0] @ noise @ roots[1].conj().swapaxes(-1, -2)
        errors.append(maximum_likelihood(case, bound.names, measured))
    squares = np.einsum("rp,pq,rq->r", errors, information, errors)
    # Chi-square of n = 30 degrees of freedom in each of 40 runs: the mean over both is 1 with a deviation of 4 %;
    # 1 % more for the sag that the bound leaves fixed.
    assert squares.mean() / n == pytest.approx(1, abs=5 * np.sqrt(2 / (n * n_run)) + 0.01)
    # By parameter: variance over bound from 40 runs, chi-square within 1e-5 over 30 parameters.
    ratio = np.mean(np.square(errors), axis=0) / np.diag(bound.covariance)
    assert 0.35 < ratio.min() < ratio.max() < 2.4


def test_bound_is_that_of_differences_of_the_response_with_the_sag_moving(case: Case) -> None:
    bound = case.bound()
    change = 1e-4
    slopes = []
    for direction in np.eye(len(bound.names)):
        ends = []
        for sign in (1, -1):
            robot, damping = with_logarithms(case, bound.names, sign * change * direction)
            ends.append(robot.response(case.pose, FREQUENCY_HZ, damping))
        slopes.append((ends[0] - ends[1]) / (2 * change))
    jacobian = np.moveaxis(np.array(slopes).swapaxes(-1, -2).reshape(len(slopes), -1, 36), 0, -1)
    inverse = np.linalg.inv(case.gram).conj()
    covariance = np.einsum("pfjl,pfik->pfjilk", inverse, case.noise).reshape(-1, 36, 36)
    weighted = np.linalg.solve(covariance, jacobian)
    dense = np.linalg.inv(2 * np.einsum("fep,feq->pq", jacobian.conj(), weighted).real)
    names = case.robot.stiffness_names
    exact = np.sqrt(np.diag(dense))[: len(names)]
    assert bound.standard_error(*names) == pytest.approx(exact, rel=0.005)


def test_bound_falls_with_the_root_of_experiments_and_of_periods(case: Case) -> None:
    once = case.bound().standard_error()
    noise = noise_covariance(case.robot, case.response, FREQUENCY_HZ, N_SAMPLE, n_period=2)
    args = (case.robot, case.pose, FREQUENCY_HZ)
    again = parameter_bound(*args, 2 * case.gram, noise, case.motor_damping).standard_error()
    assert again == pytest.approx(once / 2, rel=1e-6)
