"""--from, --until and --force."""

from __future__ import annotations

from typing import Any

import pytest

from robid_core.errors import ConfigurationError
from robid_core.run import ALL

ORDER = ["where", "acquire", "frf", "fit", "choose", "page"]


def test_until_runs_what_a_stage_needs_and_no_more(world: Any) -> None:
    world.run(last="frf")
    assert world.ran() == ["where", "acquire", "frf"]
    world.run()
    assert world.ran() == ["fit", "choose", "page"]


def test_until_leaves_what_it_does_not_need(world: Any) -> None:
    result = world.run(last="where")
    assert result.outcomes == {"where": "made"}


def test_from_refuses_where_an_earlier_stage_is_not_up_to_date(world: Any) -> None:
    with pytest.raises(ConfigurationError, match=r"needs the output of 'frf', .*never made.*--from frf"):
        world.run(first="fit")
    world.run()
    world.ran()
    with pytest.raises(ConfigurationError, match=r"setting power: 2 -> 3"):
        world.run("stages.frf.with.power=3", first="fit")
    assert world.ran() == []


def test_from_runs_what_depends_on_a_stage(world: Any) -> None:
    world.run()
    world.ran()
    world.run("stages.fit.with.outcome=not converged", "stages.page.with.title=x", first="fit")
    assert world.ran() == ["fit", "choose", "page"]


def test_from_and_until_the_wrong_way_round_are_refused(world: Any) -> None:
    with pytest.raises(ConfigurationError, match="swap them"):
        world.run(first="fit", last="where")


def test_force_makes_one_stage_again(world: Any) -> None:
    world.run()
    world.ran()
    result = world.run(force=("fit",))
    assert world.ran() == ["fit"]
    assert result.outcomes["fit"] == "same"


def test_force_makes_every_chosen_stage_again_with_the_same_bytes(world: Any) -> None:
    world.run()
    before = world.hashes()
    world.ran()
    world.run(force=(ALL,), first="frf")
    assert world.ran() == ["frf", "fit", "choose", "page"]
    assert world.hashes() == before
