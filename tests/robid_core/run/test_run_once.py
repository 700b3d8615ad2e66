"""A run makes what is missing, keeps what is there, and says why."""

from __future__ import annotations

from typing import Any

ORDER = ["where", "acquire", "frf", "fit", "choose", "page"]


def test_first_run_makes_every_stage_in_order(world: Any) -> None:
    result = world.run()
    assert world.ran() == ORDER
    assert result.outcomes == dict.fromkeys(ORDER, "made")
    assert result.exit_code == 0
    names = [path.name for path in sorted((world.folder / "artifacts").iterdir())]
    assert names == ["acquire.h5", "choose.h5", "fit.h5", "frf.h5", "page.html", "where.h5"]


def test_second_run_does_nothing_and_says_so(world: Any) -> None:
    world.run()
    before = world.hashes()
    world.ran()
    result = world.run()
    assert world.ran() == []
    assert result.idle
    assert result.outcomes == dict.fromkeys(ORDER, "kept")
    assert world.hashes() == before
