"""The truth of a simulated plant reaches the page and nothing else."""

from __future__ import annotations

from typing import Any

import pytest

from robid_core import Estimator, Fit, PluginError, Truth


def test_the_page_sees_the_truth(world: Any) -> None:
    world.run()
    assert " 2.0 " in (world.folder / "artifacts" / "page.html").read_text()


def test_no_other_kind_of_stage_can_ask_for_it() -> None:
    class Cheat(Estimator):
        def run(self, truth: Truth) -> Fit:
            raise NotImplementedError

    with pytest.raises(PluginError, match="only a report may see the truth"):
        Cheat.lends()


def test_no_artifact_but_the_page_depends_on_it(world: Any) -> None:
    world.run("stages.acquire.with.noise=0.3")
    before = world.hashes()
    world.run("stages.acquire.with.noise=0.3", "drives.with.stiffness=5.0")
    after = world.hashes()
    assert {name for name in after if after[name] != before[name]} == {"page.html"}
