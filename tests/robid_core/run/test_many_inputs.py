"""A stage that takes many artifacts of one type gets all of them, in order, and depends on each."""

from __future__ import annotations

from typing import Any

import pytest

from robid_core import Fit, Frf

MANY = """\
robid: 1
name: strange
seed: 7
robot: one_axis
drives: {use: strange}
stages:
  where: {use: strange.where}
  acquire: {use: strange.measure}
  cubic: {use: strange.respond, with: {power: 4}}
  square: {use: strange.respond}
  fit: {use: strange.combine}
"""


@pytest.fixture(name="many")
def world_with_two_responses(world: Any) -> Any:
    world.file.write_text(MANY, encoding="utf-8")
    return world


def means(world: Any) -> list[float]:
    return [
        float(abs(Frf.read(world.folder / "artifacts" / f"{name}.h5").response).mean())
        for name in ("cubic", "square")
    ]


@pytest.mark.parametrize("limits", [{}, {"deadline_s": 60.0}])
def test_all_artifacts_of_the_type_arrive_in_the_order_of_the_file(
    many: Any, limits: dict[str, float]
) -> None:
    many.run(**limits)
    fit = Fit.read(many.folder / "artifacts" / "fit.h5")
    assert fit.parameters.estimate.tolist() == means(many)
    assert fit.status == "of 1 records"
    assert many.run().manifest.stages["fit"].inputs == {"frfs": ("cubic", "square"), "records": ("acquire",)}


def test_listed_ones_arrive_as_they_are_listed(many: Any) -> None:
    many.say("{use: strange.combine}", "{use: strange.combine, inputs: {frfs: [square, cubic], records: []}}")
    many.run()
    fit = Fit.read(many.folder / "artifacts" / "fit.h5")
    assert fit.parameters.estimate.tolist() == means(many)[::-1]
    assert fit.status == "of 0 records"


def test_a_change_of_any_of_them_reruns_the_stage_and_says_which_input(many: Any) -> None:
    many.run()
    many.ran()
    many.run()
    assert many.ran() == []
    reasons: dict[str, tuple[str, ...]] = {}

    class Listens:
        def __getattr__(self, name: str) -> Any:
            return lambda *values: reasons.update({values[0]: values[3]}) if name == "begin" else None

    many.run("stages.cubic.with.power=6", listener=Listens())
    assert many.ran() == ["frf", "combine"]
    assert reasons["fit"] == ("input frfs (from cubic and square) changed",)


def test_the_order_of_the_inputs_is_part_of_the_key(many: Any) -> None:
    many.run()
    many.ran()
    many.say("{use: strange.combine}", "{use: strange.combine, inputs: {frfs: [square, cubic]}}")
    many.run()
    assert many.ran() == ["combine"]


def test_one_that_gave_no_result_is_missed_by_name(many: Any) -> None:
    many.edit(
        '        called("frf")\n',
        '        called("frf")\n        if self.power == 4:\n            raise NotTrustworthy("no")\n',
    )
    result = many.run()
    assert result.outcomes["fit"] == "refused"
    assert result.manifest.stages["fit"].note == "needs cubic, which gave no result"
