"""The minimiser against scipy, closed forms and bounds."""

import numpy as np
import pytest
from scipy.optimize import least_squares, lsq_linear

from robid_core.estimation.least_squares import levenberg_marquardt


class Curve:
    """y = a exp(-b t) + c, parameters free: a small problem with a curved valley."""

    def __init__(self, noise: float = 0.01) -> None:
        self.t = np.linspace(0, 4, 60)
        self.y = 2.0 * np.exp(-0.7 * self.t) + 0.3 + noise * np.random.default_rng(1).standard_normal(60)

    def residual(self, p: np.ndarray) -> np.ndarray:
        return p[0] * np.exp(-p[1] * self.t) + p[2] - self.y

    def cost(self, p: np.ndarray) -> float:
        return float(0.5 * (self.residual(p) ** 2).sum())

    def equations(self, p: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        e = np.exp(-p[1] * self.t)
        j = np.stack([e, -p[0] * self.t * e, np.ones_like(e)], axis=1)
        return self.cost(p), j.T @ self.residual(p), j.T @ j


@pytest.mark.parametrize("start", [(1.0, 1.0, 0.0), (5.0, 0.05, -2.0), (0.1, 4.0, 1.0)])
def test_the_minimum_is_the_one_that_scipy_finds(start: tuple[float, ...]) -> None:
    curve, wide = Curve(), np.full(3, 20.0)
    end = levenberg_marquardt(curve.equations, curve.cost, np.array(start), -wide, wide)
    oracle = least_squares(curve.residual, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert end.converged
    # The stop promises less than 1e-9 of the cost: p^T H p / 2 <= 1e-9 cost bounds the distance.
    distance = end.point - oracle.x
    assert 0.5 * distance @ end.gauss_newton @ distance < 1e-6 * end.cost


def test_a_bound_holds_and_the_others_adapt() -> None:
    curve = Curve()
    lower, upper = np.array([-9.0, 1.0, -9.0]), np.full(3, 9.0)
    end = levenberg_marquardt(curve.equations, curve.cost, np.array([1.0, 2.0, 0.0]), lower, upper)
    oracle = least_squares(curve.residual, [1.0, 2.0, 0.0], bounds=(lower, upper), xtol=1e-14, ftol=1e-14)
    assert end.point[1] == 1.0
    np.testing.assert_allclose(end.point, oracle.x, atol=1e-3)


@pytest.mark.parametrize("seed", range(8))
def test_in_a_box_correlated_unknowns_end_where_they_should(seed: int) -> None:
    """A linear problem whose unbounded minimum lies far outside: the oracle is scipy's bounded least squares."""
    generator = np.random.default_rng(seed)
    mixed = generator.standard_normal((30, 6)) @ (np.ones((6, 6)) + 0.05 * generator.standard_normal((6, 6)))
    target = mixed @ generator.uniform(-6, 6, 6) + generator.standard_normal(30)
    lower, upper = np.full(6, -1.0), np.full(6, 1.0)
    expected = lsq_linear(mixed, target, (lower, upper), tol=1e-14).cost

    def equations(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        rest = mixed @ x - target
        return float(0.5 * rest @ rest), mixed.T @ rest, mixed.T @ mixed

    found = levenberg_marquardt(equations, lambda x: equations(x)[0], np.zeros(6), lower, upper, 200)
    assert found.converged
    assert found.cost == pytest.approx(expected, rel=1e-6)


def test_a_budget_that_is_too_small_is_told() -> None:
    curve, wide = Curve(), np.full(3, 20.0)
    end = levenberg_marquardt(curve.equations, curve.cost, np.array([5.0, 0.05, -2.0]), -wide, wide, 2)
    assert not end.converged
    assert "2 iterations" in end.message


def test_a_step_into_nonsense_is_not_taken() -> None:
    """The cost is not a number beyond x = 1; the minimum at 0.9 is found from the safe side."""

    def cost(p: np.ndarray) -> float:
        return float("nan") if p[0] > 1 else float(0.5 * (np.exp(p[0]) - np.exp(0.9)) ** 2)

    def equations(p: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        r, j = np.exp(p[0]) - np.exp(0.9), np.exp(p[0])
        return cost(p), np.array([j * r]), np.array([[j * j]])

    end = levenberg_marquardt(equations, cost, np.array([-2.0]), np.array([-5.0]), np.array([5.0]))
    assert end.point[0] == pytest.approx(0.9, abs=1e-4)


def test_from_next_to_no_damping_a_short_step_takes_few_trials() -> None:
    """Only steps of a thousandth of what the derivative promises go downhill; by factors of four it is the 21st."""
    tried: list[float] = []

    def cost(p: np.ndarray) -> float:
        tried.append(float(p[0]))
        return 0.5 * (1 - p[0]) ** 2 if p[0] < 1.5e-3 else 2.0

    def equations(p: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        return 0.5 * (1 - p[0]) ** 2, np.array([p[0] - 1]), np.array([[1.0]])

    wide = np.array([10.0])
    levenberg_marquardt(equations, cost, np.zeros(1), -wide, wide, 1, damping=1e-9)
    assert 0 < tried[-1] < 1.5e-3
    assert len(tried) <= 10
