"""What is left where a cause acts: chance where the law is right, more where it is only near to the right one."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable

import numpy as np
import pytest
import scipy

from robid_core import Context, FloatArray, Record, Robot
from robid_core.residual.moving_samples import fading
from robid_core.stage import map_in_process
from robid_diagnosis.completeness import CAUSE, REMAINS
from robid_diagnosis.effects import Effects
from robid_diagnosis.remainder import chance_of_remainder

N_ROW = 6000
DRAWS = 400
ALL = np.ones(N_ROW)


@pytest.fixture(scope="module")
def changed() -> FloatArray:
    """What a law changed in each of many frequencies: a lot in a few, next to nothing in most."""
    return np.random.default_rng(1).standard_normal(N_ROW) * np.exp(np.linspace(1.0, -5.0, N_ROW))


def test_of_noise_alone_the_probability_is_as_it_says(changed: FloatArray) -> None:
    """Uniform: a Kolmogorov-Smirnov distance of 400 draws is above 0.0976 once in a thousand times."""
    generator = np.random.default_rng(2)
    chances = [
        chance_of_remainder(generator.standard_normal(N_ROW), 0.5 * changed, ALL) for _ in range(DRAWS)
    ]
    assert scipy.stats.kstest(chances, "uniform").statistic < 0.0976


def test_of_noise_of_which_a_part_counts_the_probability_is_as_it_says() -> None:
    """Samples of which two fifths are left out, in stretches, and a band that fades: as beside turns of an axis.

    Squares of neighbouring bins are not independent then, and faded ones are small.
    """
    generator, n = np.random.default_rng(6), 4000
    weight = scipy.ndimage.uniform_filter1d((np.arange(n) % 500 >= 200).astype(float), 20, mode="wrap")
    fade = fading(n // 2)
    share = np.tile((weight**2).mean() * fade**2, 2)
    changed = np.exp(-np.linspace(0.0, 40.0, n // 2)) * generator.standard_normal((2, n // 2))

    def noise() -> FloatArray:
        white = np.fft.irfft(fade * np.fft.rfft(generator.standard_normal(n))[: n // 2], n=n)
        bins = np.fft.rfft(weight * white)[: n // 2]
        return np.concatenate((bins.real, bins.imag)) / np.sqrt(n / 2)

    chances = [chance_of_remainder(noise(), 0.5 * changed.ravel(), share) for _ in range(DRAWS)]
    assert scipy.stats.kstest(chances, "uniform").statistic < 0.0976


def test_a_remainder_that_the_misfit_hides_is_seen_where_the_law_acts(changed: FloatArray) -> None:
    """Three tenths of the change are left: a test of the mean square of all takes that for chance rather."""
    generator = np.random.default_rng(3)
    left = generator.standard_normal(N_ROW) + 0.3 * changed * np.sign(generator.standard_normal(N_ROW))
    of_all = scipy.stats.chi2.sf((left**2).sum(), N_ROW)
    assert chance_of_remainder(left, changed, ALL) < min(REMAINS, 1e-3 * of_all)


def test_an_error_of_three_percent_of_the_law_is_no_remainder(changed: FloatArray) -> None:
    generator, strong = np.random.default_rng(4), 100 * changed
    left = generator.standard_normal(N_ROW) + 0.03 * strong
    assert chance_of_remainder(left, strong, ALL) > 0.5
    assert chance_of_remainder(left + 0.1 * strong, strong, ALL) < 1e-6


def test_noise_of_any_size_and_what_was_not_measured_say_nothing(changed: FloatArray) -> None:
    generator = np.random.default_rng(5)
    left, counts = generator.standard_normal(N_ROW), np.arange(N_ROW) % 3 > 0
    chance = chance_of_remainder(left[counts], changed[counts], ALL[counts])
    assert chance_of_remainder(left * counts, changed, ALL) == pytest.approx(chance)
    for size in (1.0, 1e3):
        assert chance_of_remainder(size * left, size * changed, ALL) == pytest.approx(
            chance_of_remainder(left, changed, ALL)
        )
    assert chance_of_remainder(left, np.zeros(N_ROW), ALL) == 1.0


@pytest.mark.parametrize(("use", "kind"), [("friction.dahl", "cause"), ("friction.breakaway", "partial")])
def test_a_law_that_is_near_to_the_right_one_is_a_part(
    told: Robot,
    plant_of: Callable[[Robot, int], Robot],
    measured: Callable[..., Record],
    use: str,
    kind: str,
) -> None:
    """Friction that is larger near rest explains most of what bristles do, as much as free functions of speed would.

    The misfit of all data is one beside it: only what is left where it acts says that it is not all.
    """
    values = {"coulomb": 0.006, "stiffness": 0.1}
    plant = plant_of(told, 3).with_effect("bristles", "friction.dahl", "axis_1", values=values)
    context = Context(np.random.default_rng(1), map_in_process, lambda *_: None, logging.getLogger("test"))
    diagnosis = Effects(only=(use,), separate=False, response_check=()).run(
        (measured(plant, 5),), told, context
    )
    (finding,) = diagnosis.findings
    assert (finding.effect, finding.kind) == (use, kind)
    assert finding.share > CAUSE  # which alone would not say so
    misfit = re.search(r", ([\d.]+) with what was found", diagnosis.verdict)
    assert misfit
    assert float(misfit[1]) < 1.0
