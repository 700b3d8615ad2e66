"""Optimal weights against closed forms, their certificate, and rounding."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from robid_core import NotTrustworthy
from robid_design.weights import certificate_gap, criterion_value, optimal_weights, whole_experiments


def random_information(n_candidate: int, n: int, rank: int, seed: int) -> np.ndarray:
    a = np.random.default_rng(seed).standard_normal((n_candidate, n, rank))
    return a @ a.transpose(0, 2, 1)


def test_two_orthogonal_experiments_share_equally_for_d_and_by_root_for_a() -> None:
    """diag(4, 0) and diag(0, 1): D gives 1/2 each; A minimises 1/(4 w) + 1/(1 - w), w = 1/3."""
    information = np.array([[[4.0, 0], [0, 0]], [[0, 0], [0, 1.0]]])
    np.testing.assert_allclose(optimal_weights(information, "D"), [0.5, 0.5], atol=1e-4)
    np.testing.assert_allclose(optimal_weights(information, "A"), [1 / 3, 2 / 3], atol=1e-4)


def test_polynomial_regression_puts_its_weight_where_the_theory_does() -> None:
    """Quadratic regression on [-1, 1]: D-optimal at -1, 0, 1 with a third each (Kiefer and Wolfowitz 1960)."""
    x = np.linspace(-1, 1, 41)
    rows = np.stack([np.ones_like(x), x, x * x], axis=1)
    weight = optimal_weights(rows[:, :, None] * rows[:, None, :], "D")
    np.testing.assert_allclose(weight[[0, 20, 40]], 1 / 3, atol=1e-4)
    assert weight[[0, 20, 40]].sum() == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("criterion", ["D", "A"])
def test_the_certificate_bounds_what_any_other_weights_gain(criterion: str) -> None:
    information = random_information(60, 5, 3, 1)
    weight = optimal_weights(information, criterion)  # type: ignore[arg-type]
    gap = certificate_gap(information, weight, criterion)  # type: ignore[arg-type]
    # An interior-point solver stops near 1e-4 of the objective.
    assert -1e-6 < gap < 1e-2
    best = criterion_value(information, weight, criterion)  # type: ignore[arg-type]
    rng = np.random.default_rng(2)
    for other in rng.dirichlet(np.full(60, 0.1), 200):
        assert criterion_value(information, other, criterion) <= best * (1 + gap)  # type: ignore[arg-type]


@pytest.mark.parametrize("criterion", ["D", "A"])
@pytest.mark.parametrize("spread", [1e-2, 1e-3, 1e-4, 1e-6, 0.0])
@pytest.mark.parametrize("n", [1, 2, 6])
def test_candidates_that_are_nearly_alike_have_optimal_weights(n: int, spread: float, criterion: str) -> None:
    """All poses of one axis are: the solver stopped at spreads of 1e-2 to 1e-4."""
    base = random_information(1, n, n + 1, 4)
    information = base + spread * np.trace(base[0]) / n**2 * random_information(50, n, n, 5)
    weight = optimal_weights(information, criterion)  # type: ignore[arg-type]
    assert weight.sum() == pytest.approx(1.0)
    assert certificate_gap(information, weight, criterion) < 1e-4  # type: ignore[arg-type]


@pytest.mark.parametrize("criterion", ["D", "A"])
def test_springs_of_very_different_stiffness_have_optimal_weights(criterion: str) -> None:
    """Parameters in units a million apart; A then counts one of them only."""
    scale = np.array([1e-3, 1.0, 1e3])
    information = random_information(40, 3, 2, 6) * scale[:, None] * scale
    weight = optimal_weights(information, criterion)  # type: ignore[arg-type]
    assert certificate_gap(information, weight, criterion) < 1e-3  # type: ignore[arg-type]


def test_a_solver_that_stops_is_refused_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    import cvxpy

    def stop(*_: object, **__: object) -> None:
        raise cvxpy.SolverError("Solver 'CLARABEL' failed. Try another solver.")

    monkeypatch.setattr(cvxpy.Problem, "solve", stop)
    with pytest.raises(NotTrustworthy, match="the solver says 'Solver 'CLARABEL' failed'; are some springs"):
        optimal_weights(random_information(5, 2, 2, 1), "D")


def test_a_spring_that_no_candidate_determines_is_refused_in_a_sentence() -> None:
    with pytest.raises(NotTrustworthy, match="are some springs determined by no candidate"):
        optimal_weights(np.tile(np.diag([1.0, 0.0]), (3, 1, 1)), "A")


def test_weights_that_are_not_optimal_have_a_gap() -> None:
    information = random_information(60, 5, 3, 1)
    assert certificate_gap(information, np.full(60, 1 / 60), "D") > 0.1


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(0, 1), min_size=1, max_size=30).filter(lambda w: sum(w) > 1e-3), st.integers(1, 40))
def test_rounding_spends_every_experiment_on_supported_candidates(
    weights: list[float], experiments: int
) -> None:
    weight = np.array(weights) / sum(weights)
    count = whole_experiments(weight, experiments)
    assert count.sum() == experiments
    assert (count >= 0).all()
    assert not (count[weight == 0] > 0).any()


def test_a_candidate_of_next_to_no_weight_is_not_measured() -> None:
    """It took an experiment of eight with a weight of 0.005 %."""
    assert whole_experiments(np.array([0.6, 5e-5, 0.39995]), 8).tolist() == [5, 0, 3]
    assert whole_experiments(np.full(1000, 1e-3), 4).sum() == 4  # all are as small


def test_rounding_of_many_experiments_is_nearly_proportional() -> None:
    """Pukelsheim and Rieder: no share is off by a whole experiment or more."""
    weight = np.random.default_rng(3).dirichlet(np.ones(7))
    assert np.abs(whole_experiments(weight, 1000) - 1000 * weight).max() < 1 + 7 / 2 * weight.max()
