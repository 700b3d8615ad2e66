"""The lag of a torque from phases that are its own, in noise, and beside resonances that are told wrong."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.estimation.response.torque_lag import torque_lag

STEP = 1e-3
OMEGA = 2 * np.pi * np.linspace(30, 60, 120)


@pytest.mark.parametrize("samples", [-12.3, -0.4, 0.0, 0.9, 7.25])
def test_a_lag_is_read_off_the_phase_though_it_wraps(samples: float) -> None:
    phase = np.angle(np.exp(1j * OMEGA * STEP * samples))
    assert torque_lag(OMEGA, phase, STEP).samples == pytest.approx(samples, abs=1e-6)


def test_the_stated_error_covers_the_scatter_of_draws() -> None:
    """Bins with independent noise: the error is stated for four that share theirs, twice as much."""
    draw = np.random.default_rng(0)
    lags = [torque_lag(OMEGA, OMEGA * STEP * 0.9 + 0.1 * draw.standard_normal(120), STEP) for _ in range(100)]
    scatter = np.std([one.samples for one in lags])
    assert np.mean([one.samples for one in lags]) == pytest.approx(0.9, abs=4 * scatter / 10)
    assert 0.8 < np.mean([one.error for one in lags]) / (2 * scatter) < 1.25
    assert np.mean([one.scatter for one in lags]) == pytest.approx(0.1, rel=0.1)


def test_a_resonance_between_its_told_and_its_true_place_turns_nothing() -> None:
    """The phase is half a turn off in a sixth of the bins."""
    phase = OMEGA * STEP * 0.9
    phase[40:60] += np.pi
    assert torque_lag(OMEGA, phase, STEP).samples == pytest.approx(0.9, abs=0.01)
