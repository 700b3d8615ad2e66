"""What is left over each variable: shares against laws of known form, and against what a hidden friction law does."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Context, Record, Robot
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects
from robid_diagnosis.residual_curves import _shares, means_over, parts_of

N = 20_000


def test_a_law_is_told_by_its_share_and_its_symmetry() -> None:
    """Residual x + 0.5 |x| + noise of x uniform in (-1, 1): squares 1/3, 0.25/3 and 1/4 of the noise."""
    generator = np.random.default_rng(1)
    x = generator.uniform(-1, 1, N)
    residual = x + 0.5 * np.abs(x) + 0.5 * generator.standard_normal(N)
    parts = parts_of(x, signed=True)
    share, odd, even = _shares(residual, parts, True, N)
    whole = 1 / 3 + 0.25 / 3 + 0.25
    # The mean over a part of width w misses w^2 / 12 of a slope of one: 2e-4 here; noise of a share is 1 / sqrt(N).
    assert share == pytest.approx((1 / 3 + 0.25 / 3) / whole, abs=0.02)
    assert odd == pytest.approx(1 / 3 / whole, abs=0.02)
    assert even == pytest.approx(0.25 / 3 / whole, abs=0.02)
    np.testing.assert_allclose(
        means_over(residual, parts)[-3:], 1.5 * means_over(np.abs(x), parts)[-3:], atol=0.1
    )


def test_noise_is_no_function_of_anything() -> None:
    """Beyond chance nothing is left: shares scatter by sqrt(2 parts) / N."""
    generator = np.random.default_rng(2)
    for signed in (True, False):
        parts = parts_of(generator.standard_normal(N), signed)
        assert sum(len(part) for part in parts) == N
        assert _shares(generator.standard_normal(N), parts, signed, N)[0] < 5 * np.sqrt(80) / N


def test_of_hidden_friction_that_grows_with_load_the_load_tells_most(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record]
) -> None:
    """A line over the size of the load before, noise after; over frequency the torque stands above both."""
    slope = 0.04
    values = {"coulomb": 0.0, "load_coulomb": slope, "load_excess": 0.0}
    plant = plant_of(told, 3).with_effect("hidden", "friction.load_dependent", "axis_1", values=values)
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    diagnosis = Effects(only=("friction.load_dependent",)).run((measured(plant, 4),), told, context)
    curves = {curve.variable.partition(",")[0]: curve for curve in diagnosis.residuals}
    assert {curve.axis for curve in diagnosis.residuals} == {"axis_1"}
    known = {name: curve.share for name, curve in curves.items() if np.isfinite(curve.share)}
    assert max(known, key=lambda name: known[name]) == "friction over size of the load"
    over_load = curves["friction over size of the load"]
    found, _ = np.polyfit(over_load.abscissa, over_load.refitted, 1)
    # Values that were refitted take a part of it, and at zero speed friction turns round.
    assert 0.75 * slope < found < slope
    assert np.abs(over_load.extended).max() < 0.05 * np.abs(over_load.refitted).max()
    over_frequency = curves["frequency"]
    assert over_frequency.measured is not None
    assert (over_frequency.extended < over_frequency.measured).all()
    assert np.linalg.norm(over_frequency.refitted) > 5 * np.linalg.norm(over_frequency.extended)
