"""The diagnosis against what is hidden in MuJoCo's plants: a small sample always, a larger one with `-m full`."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import scipy

from blind.cases import LEAST, _clean, _search, _shown
from blind.experiments import Experiments
from blind.foreign_plant import STEPS, ForeignPlant, Unbounded
from blind.judging import judged
from blind.kinds import LAWS, Plant
from blind.plan import Wanted, asked, plan
from blind.robots import base_robot, told_robot, true_robot
from blind.standing import Base
from blind.strangers import diagnosed, measured
from blind.strength import Ruler
from blind.table import late_by, wilson

FIRST = 910_000
SAMPLE = (Wanted("nothing", FIRST), Wanted("strong", FIRST + 1, 1, ("friction.load_dependent",)))
RIGHT = 0.85  # of strong laws on one axis: what is claimed
STRANGE = 0.03  # of robots that nobody met: alarms, as is claimed
ESTIMATED = (
    0.8  # of an error that is 1.4 % of the noise, of a law of strength 200: twenty estimates cost 0.14 %
)
RARE = 0.01  # probability of a count as low, were the claim true


@pytest.mark.full
@pytest.mark.parametrize("wanted", SAMPLE, ids=["nothing", "load_dependent"])
def test_a_hidden_law_is_named_first_and_none_where_there_is_none(wanted: Wanted) -> None:
    """The law is as strong as was asked for; no other one is named beside it, and the delay is found."""
    row = judged(wanted, "test")
    assert row["right"] == "True", row
    assert row["extras"] == "0"
    if wanted.kinds:
        low, high = wanted.strength
        assert low <= float(row["strengths"]) <= high
        assert ESTIMATED < float(row["gain_own"]) < 2 - ESTIMATED
    if row["found_late"]:
        assert late_by(row) < 0.02


@pytest.mark.parametrize("seed", [FIRST, pytest.param(FIRST + 1, marks=pytest.mark.full)])
def test_nothing_is_found_on_a_robot_that_nobody_met(seed: int) -> None:
    told, record = measured(seed)
    assert not diagnosed(told, record).findings


@pytest.mark.full
def test_on_robots_that_nobody_met_alarms_are_rare() -> None:
    """Forty of them: as many alarms as chance leaves of a share of three percent."""
    alarms = sum(bool(diagnosed(*measured(seed)).findings) for seed in range(FIRST + 2, FIRST + 42))
    assert scipy.stats.binom.sf(alarms - 1, 40, STRANGE) > RARE


@pytest.mark.full
def test_of_all_kinds_most_are_named() -> None:
    """Two cases of each law: the count of right ones is what chance leaves of the claim; none where there is none."""
    kinds = [(kind, FIRST + 10 + i) for i, kind in enumerate((*LAWS, *LAWS))]
    rows = [judged(Wanted("strong", seed, 1, (kind,)), "test") for kind, seed in kinds]
    right = sum(row["right"] == "True" for row in rows)
    assert scipy.stats.binom.cdf(right, len(rows), RIGHT) > RARE, rows
    nothing = [judged(Wanted("nothing", FIRST + 100 + i), "test") for i in range(6)]
    assert not sum(int(row["alarms"]) for row in nothing)


@pytest.mark.full
def test_what_is_too_stiff_for_the_steps_is_simulated_with_more_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rocking base that decays too fast: the explicit method needs steps below 2.8 of its time constants.

    The torque is then that of twice as many steps, within a thousandth of the largest.
    """
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings to a file
    robot = base_robot(6)
    stiff = Base(True, (4e8, 4e8), (4e5, 4e5), mass=100, height=0.1, radius=0.3)
    drawn = Experiments.drawn(robot, "multisine", np.random.default_rng(FIRST))
    short = replace(drawn, poses=drawn.poses[:1], references=drawn.references[:1, :60], each=1)
    with pytest.raises(Unbounded):
        ForeignPlant(robot, (), 0.0, stiff).measure(short.references[0], short.poses[0], None)
    _, torque, _ = _shown(Plant(robot, (), stiff), short, 0.0, None)
    _, finer, _ = _shown(Plant(robot, (), stiff), short, 0.0, None, 16 * STEPS)
    assert np.abs(torque - finer).max() < 1e-3 * np.abs(finer).max()


def test_a_plant_that_is_unstable_counts_as_too_strong() -> None:
    """Strength grows with the square of the size until the plant leaves all bounds; the search ends below that."""
    size, strength = _search(lambda one: 100 * one**2 if one < 3 else np.inf, 500.0, (400.0, 600.0), 8.0)
    assert 400 <= strength <= 600
    assert size < 3


@pytest.mark.parametrize("motion", ["multisine", "moves"])
def test_what_is_not_there_has_no_strength(motion: Literal["multisine", "moves"]) -> None:
    """Torques half a sample late: what two simulators disagree in is taken off under a window, too (26 if not)."""
    generator = np.random.default_rng(FIRST)
    truth = true_robot(told_robot(base_robot(1), generator), generator)
    few = Experiments.drawn(truth, motion, generator).first()
    clean = _clean(Plant(truth), truth, few, 0.5)
    ruler = Ruler.of_records(truth, clean, few.with_noise(clean, truth, generator), 0.5)
    assert ruler.strength(clean).total(1.0) < LEAST


def test_a_small_share_of_the_plan_is_a_small_score() -> None:
    """Half of it has all strata, half of the pairs have one axis, and no seed is used twice."""
    counts = {name: math.ceil(0.1 * n) for name, n in asked()["counts"].items()}
    cases = plan(counts, 1)
    assert len({(one.stratum, one.seed) for one in cases}) == len(cases)
    begun = cases[: len(cases) // 2]
    assert {one.stratum for one in begun} == set(counts)
    alone = [one for one in cases if one.stratum == "pairs"]
    assert all(len(set(one.kinds)) == 2 for one in alone)
    assert sum(one.n_axis == 1 for one in alone) == len(alone) / 2


def test_half_of_a_score_has_one_axis_and_a_quarter_six() -> None:
    """Within three percent of all cases; every law is hidden in robots of one, two and six axes."""
    cases = plan(asked()["counts"], 1)
    share = {n: sum(one.n_axis == n for one in cases) / len(cases) for n in (1, 2, 6)}
    assert share == pytest.approx({1: 0.5, 2: 0.25, 6: 0.25}, abs=0.03)
    strong = [one for one in cases if one.stratum == "strong"]
    assert all({one.n_axis for one in strong if one.kinds == (kind,)} == {1, 2, 6} for kind in LAWS)


def test_wilsons_interval_is_that_of_the_paper() -> None:
    """Closed form: centre (p + z^2 / 2n) / (1 + z^2 / n)."""
    n, hits, z = 40, 37, scipy.stats.norm.ppf(0.975)
    p = hits / n
    centre = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * math.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    assert wilson(hits, n) == pytest.approx((centre - half, centre + half), abs=1e-9)
