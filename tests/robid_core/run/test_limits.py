"""A deadline and a memory limit, where they are asked for (R10, R11)."""

from __future__ import annotations

import subprocess
from typing import Any

import pytest

from robid_core.errors import NotTrustworthy, PluginError


def test_limits_that_are_kept_change_no_byte(world: Any) -> None:
    world.run()
    before = world.hashes()
    subprocess.run(["rm", "-rf", str(world.folder)], check=True)
    world.ran()
    world.run(deadline_s=60.0, memory_mb=4000, last="frf")
    assert world.ran() == ["where", "acquire", "frf"]
    assert world.hashes().items() <= before.items()
    assert list((world.folder / "store" / "temporary").iterdir()) == []


def test_a_stage_that_hangs_is_killed_at_its_deadline(world: Any) -> None:
    world.run(last="frf")
    with pytest.raises(PluginError, match=r"stage fit: R10: not finished after 3 s, and killed"):
        world.run("stages.fit.with.hold=1000.0", deadline_s=3.0, last="fit")


def test_a_stage_that_takes_too_much_memory_is_ended(world: Any) -> None:
    world.run(last="frf")
    with pytest.raises(PluginError, match=r"stage fit: .* failed: .*not enough memory") as caught:
        world.run("stages.fit.with.outcome=memory", memory_mb=1000, last="fit")
    assert "np.ones(10**9)" in str(caught.value)


def test_errors_come_out_as_they_went_in(world: Any) -> None:
    world.run(last="frf")
    with pytest.raises(
        PluginError, match=r"failed: ZeroDivisionError: a stranger's mistake\n.*raise ZeroDiv"
    ):
        world.run("stages.fit.with.outcome=raises", deadline_s=60.0, last="fit")
    result = world.run("stages.fit.with.outcome=refused", deadline_s=60.0, last="fit")
    assert result.exit_code == NotTrustworthy.exit_code


def test_hardware_is_not_run_where_it_could_be_killed(world: Any) -> None:
    world.say("{use: strange}", "{use: strange_hardware}")
    world.say("{use: strange.measure,", "{use: strange.measure, with: {seconds: 0.3},")
    world.run(last="where")
    result = world.run(last="acquire", at_the_robot=True, deadline_s=0.2)
    assert result.outcomes["acquire"] == "made"
