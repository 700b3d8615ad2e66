"""A stage sees what it can use of a record: no estimator the test experiments, none two variants unless it says so."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core import DataRejected, Frf, Record

SETTINGS = "{use: strange.measure, with: %s,"


def measure(world: Any, settings: str) -> None:
    world.say("{use: strange.measure,", SETTINGS % settings)


def artifact(world: Any, kind: Any, name: str) -> Any:
    return kind.read(world.folder / "artifacts" / f"{name}.h5")


def test_test_experiments_are_recorded_and_no_estimator_sees_them(world: Any) -> None:
    world.run()
    everything = artifact(world, Frf, "frf")
    measure(world, "{test: [1]}")
    world.run()
    record, frf = artifact(world, Record, "acquire"), artifact(world, Frf, "frf")
    assert record.run.test.ravel().tolist() == [False, True, False]
    np.testing.assert_array_equal(frf.angle, record.angle[[0, 2]])
    np.testing.assert_array_equal(frf.response, everything.response[[0, 2]])
    log = (world.folder / "log.txt").read_text()
    assert "robid.frf: 1 of 3 experiments are held out for tests and left out" in log


def test_a_stage_that_says_so_sees_them(world: Any) -> None:
    world.edit("    power: int = 2\n", "    sees_test = True\n    power: int = 2\n")
    measure(world, "{test: [1]}")
    world.run()
    assert len(artifact(world, Frf, "frf").angle) == 3


@pytest.mark.parametrize("limits", [{}, {"deadline_s": 60.0}])
def test_several_variants_are_refused_by_the_stage_that_cannot_tell_them_apart(
    world: Any, limits: dict[str, float]
) -> None:
    measure(world, "{variants: [light, heavy, light]}")
    with pytest.raises(
        DataRejected,
        match=r"^stage frf: the record holds several variants \(light, heavy\), which Respond does not handle; "
        r"import each by .*`variant: light`",
    ):
        world.run(**limits)


def test_one_variant_is_no_reason_to_refuse(world: Any) -> None:
    measure(world, "{variants: [light, light, light]}")
    world.run()
    assert len(artifact(world, Frf, "frf").angle) == 3


def test_a_stage_that_says_so_takes_several_variants(world: Any) -> None:
    measure(world, "{variants: [light, heavy, light]}")
    world.edit("    power: int = 2\n", "    handles_variants = True\n    power: int = 2\n")
    world.run()
    assert artifact(world, Record, "acquire").variants == ("light", "heavy", "light")
    assert len(artifact(world, Frf, "frf").angle) == 3
