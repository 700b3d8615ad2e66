"""`--dry-run` gives the reason for every stage and touches nothing."""

from __future__ import annotations

from typing import Any

import pytest

from robid_core.errors import ConfigurationError
from robid_core.run import Action, RunOptions, preview_run, run_pipeline

ORDER = ["where", "acquire", "frf", "fit", "choose", "page"]


def reasons(world: Any, *overrides: str, **options: Any) -> dict[str, tuple[Action, tuple[str, ...]]]:
    found = preview_run(world.pipeline(*overrides), RunOptions(**options))
    return {decision.stage: (decision.action, decision.reasons) for decision in found}


def test_nothing_is_made_or_written(world: Any) -> None:
    told = reasons(world)
    assert not world.folder.exists()
    assert world.ran() == []
    assert told["where"] == (Action.MAKE, ("never made",))
    assert told["fit"] == (Action.MAKE, ("never made", "takes the output of frf, to be made first"))


def test_cached_stages_are_called_cached(world: Any) -> None:
    world.run()
    assert reasons(world) == dict.fromkeys(ORDER, (Action.KEEP, ()))


def test_a_changed_setting_is_named_with_both_values(world: Any) -> None:
    world.run()
    told = reasons(world, "stages.acquire.with.noise=0.2")
    assert told["where"] == (Action.KEEP, ())
    assert told["acquire"] == (Action.MAKE, ("setting noise: 0.1 -> 0.2",))
    assert told["frf"] == (Action.MAYBE, ("takes the output of acquire, to be made first",))


def test_a_stage_behind_a_change_tells_its_own_change_too(world: Any) -> None:
    world.run()
    told = reasons(world, "stages.acquire.with.noise=0.2", "stages.fit.with.hold=0.5")
    assert told["fit"] == (
        Action.MAKE,
        ("setting hold: 0.0 -> 0.5", "takes the output of frf, to be made first"),
    )


def test_a_new_version_and_edited_sources_are_told_apart(world: Any) -> None:
    world.run()
    world.install(editable=True, version="1.1")
    world.edit("BIAS = 0.0", "BIAS = 1.0")
    assert reasons(world)["where"][1] == (
        'version of the plugin: "1.0" -> "1.1"',
        "sources of the plugin changed",
    )


def test_drives_robot_and_seed_are_named(world: Any) -> None:
    world.run()
    told = reasons(world, "drives.with.stiffness=3.0", "robot=one_axis_true", "seed=9")
    assert told["where"][1] == ("seed changed", "robot changed")
    assert told["acquire"][1][:2] == ("seed changed", "setting stiffness of the drives: 2.0 -> 3.0")


def test_an_input_that_came_out_otherwise_is_named_with_its_stage(world: Any) -> None:
    world.run()
    run_pipeline(world.pipeline("stages.fit.with.outcome=not converged"), RunOptions(last="fit", jobs=1))
    told = reasons(world, "stages.fit.with.outcome=not converged")
    assert told["page"][1] == ("takes the output of choose, to be made first",)
    assert told["choose"][1] == ("input fit (from fit) changed",)


def test_a_damaged_artifact_is_told(world: Any) -> None:
    world.run()
    blob = world.blob("frf")
    world.flip(blob)
    action, told = reasons(world)["frf"]
    assert action is Action.MAKE
    assert told[0].startswith(f"damaged: {blob}")
    assert blob.exists()


def test_stages_that_are_not_chosen_are_called_so(world: Any) -> None:
    told = reasons(world, last="frf")
    assert [name for name, (action, _) in told.items() if action is Action.LEAVE] == ["fit", "choose", "page"]


def test_a_stage_that_does_not_exist_is_refused_by_name(world: Any) -> None:
    with pytest.raises(ConfigurationError, match="no stage 'fitt'; did you mean 'fit'"):
        reasons(world, last="fitt")
