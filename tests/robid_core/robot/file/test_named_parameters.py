"""Names of what can be set: effects' parameters beside the robot's own, at their default or written down."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from robid_core import ConfigurationError
from robid_core.robot.file.description import EffectEntry, RobotDescription
from robid_core.robot.file.named_parameters import NamedParameter, named_parameters, with_values
from robid_core.robot.file.part import with_tuples
from robid_core.robot.file.reading import find_robot, read_description

pytestmark = pytest.mark.usefixtures("effects_of_a_stranger")


@pytest.fixture
def one() -> RobotDescription:
    """one_axis with a Stribeck effect, of which one parameter is written down."""
    description = read_description(find_robot("one_axis"))
    grease = EffectEntry.model_validate(
        {"use": "friction.stribeck", "on": "axis_1", "with": {"breakaway": 1.2}}
    )
    return description.model_copy(update={"effects": {"grease": grease}})


def test_an_effect_has_a_name_for_every_row_of_its_table(one: RobotDescription) -> None:
    rows = {n: (p.value, p.unit, p.kind) for n, p in named_parameters(one).items() if p.kind == "effect"}
    assert rows == {
        "effect.grease.breakaway": (1.2, "N m", "effect"),
        "effect.grease.speed": (2.0, "rad/s", "effect"),
    }
    assert rows.keys() <= named_parameters(one).keys()


def other(parameter: NamedParameter) -> float:
    """Another value that a body, a controller or a spring may have."""
    if parameter.name.startswith("inertia."):
        return 1.01 * parameter.value  # of one moment alone: a body keeps its triangle
    return 0.75 * parameter.value + 1e-3


def test_every_named_parameter_can_be_set_and_changes_nothing_else() -> None:
    six = read_description(find_robot("six_axis"))
    before = named_parameters(six)
    assert len(before) > 170
    for name, parameter in before.items():
        after = named_parameters(with_values(six, {name: other(parameter)}))
        changed = {n: p.value for n, p in after.items() if p != before[n]}
        assert changed == ({name: other(parameter)} if other(parameter) != parameter.value else {})
    together = with_values(six, {name: other(p) for name, p in before.items()})
    assert {n: p.value for n, p in named_parameters(together).items()} == {
        n: other(p) for n, p in before.items()
    }


def test_every_number_that_physics_knows_has_a_name_kind_group_and_unit() -> None:
    """What is left without a name are limits of what may be commanded, geometry, and words."""
    six = read_description(find_robot("six_axis"))
    named = named_parameters(six)
    found = {p.path for p in named.values()}

    def numbers(node: object, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
        if isinstance(node, dict):
            return [place for key, value in node.items() for place in numbers(value, (*path, key))]
        if isinstance(node, list | tuple):
            return [place for key, value in enumerate(node) for place in numbers(value, (*path, key))]
        return [path] if isinstance(node, float) else []

    left = {
        tuple(key for key in place if isinstance(key, str) and not key.startswith("axis_"))
        for place in numbers(six.model_dump())
        if place not in found and not ("inertia" in place and place[-1] < place[-2])  # type: ignore[operator]
    }
    assert left <= {
        ("gravity",), ("sample_time_s",), ("step_s",),
        ("bodies", "axis"), ("bodies", "translation"), ("bodies", "rotation"), ("bearings", "axis"),
        ("axes", "speed_limit"), ("axes", "acceleration_limit"), ("axes", "position_limits"),
    }  # fmt: skip
    assert {p.group for p in named.values()} == {"static", "separate", "dynamic"}
    assert {n.partition(".")[0] for n, p in named.items() if p.group == "dynamic"} == {
        "gear_stiffness", "gear_damping", "bearing_stiffness", "bearing_damping",
    }  # fmt: skip
    assert all(p.unit and p.kind for p in named.values())


def test_a_product_of_inertia_stands_on_both_sides_of_the_diagonal() -> None:
    six = read_description(find_robot("six_axis"))
    inertia = with_values(six, {"inertia.axis_2.xz": 0.123}).bodies[1].inertia
    assert inertia[0][2] == inertia[2][0] == 0.123


def test_an_inertia_that_no_body_has_is_refused_at_its_place() -> None:
    six = read_description(find_robot("six_axis"))
    with pytest.raises(ValidationError, match="no body has the largest above the sum of the others"):
        with_values(six, {"inertia.axis_2.xx": 1e3})


def test_gears_that_couple_axes_have_a_name_for_every_entry_of_their_matrix() -> None:
    six = read_description(find_robot("six_axis"))
    rows = [[1 / six.axes[f"axis_{i + 1}"].gear_ratio if i == j else 0.0 for j in range(6)] for i in range(6)]
    coupled = six.model_copy(update={"coupling": tuple(map(tuple, rows))})
    assert "gear_ratio.axis_1" not in named_parameters(coupled)
    changed = with_values(coupled, {"coupling.axis_6.axis_5": 0.01})
    assert changed.coupling is not None
    assert changed.coupling[5][4] == 0.01
    assert changed.coupling[4] == coupled.coupling[4]


def test_a_value_is_found_at_the_stated_path_of_the_dumped_description(one: RobotDescription) -> None:
    whole = with_values(one, {"effect.grease.speed": 3.0})
    data = whole.model_dump()
    for parameter in named_parameters(whole).values():
        node = data
        for key in parameter.path:
            node = node[key]
        assert node == parameter.value


def test_setting_a_parameter_at_its_default_writes_it_down(one: RobotDescription) -> None:
    changed = with_values(one, {"effect.grease.speed": 5.0, "gear_stiffness.axis_1": 7e4})
    assert changed.effects["grease"].with_ == {"breakaway": 1.2, "speed": 5.0}
    assert changed.axes["axis_1"].gear is not None
    assert changed.axes["axis_1"].gear.stiffness == 7e4
    assert one.effects["grease"].with_ == {"breakaway": 1.2}
    assert changed.model_dump()["effects"] == {
        "grease": {"use": "friction.stribeck", "on": "axis_1", "with": {"breakaway": 1.2, "speed": 5.0}}
    }
    assert RobotDescription.model_validate(with_tuples(changed.model_dump(mode="json"))) == changed


def test_a_value_that_cannot_be_is_refused_at_its_place(one: RobotDescription) -> None:
    with pytest.raises(ValidationError) as refused:
        with_values(one, {"gear_stiffness.axis_1": -1.0})
    (error,) = refused.value.errors()
    assert error["loc"] == ("axes", "axis_1", "gear", "stiffness")
    assert error["input"] == -1.0
    with pytest.raises(ConfigurationError, match=r"effects.grease: breakaway: 60 is outside 0 to 50 N m"):
        with_values(one, {"effect.grease.breakaway": 60.0})
    with pytest.raises(ValidationError, match=r"effects.grease.with.breakaway"):
        with_values(one, {"effect.grease.breakaway": float("nan")})
    with pytest.raises(KeyError):
        with_values(one, {"effect.grease.colour": 1.0})


def test_an_effect_that_is_not_there_is_told_with_what_comes_near(one: RobotDescription) -> None:
    for use, told in (
        ("friction.stribek", "no effect 'friction.stribek'; did you mean 'friction.stribeck'?"),
        ("friction.none", "effect 'friction.none' (unknown 0) lacks parameters"),
    ):
        wrong = one.model_copy(update={"effects": {"x": EffectEntry(use=use)}})
        with pytest.raises(ConfigurationError) as refused:
            named_parameters(wrong)
        assert told in str(refused.value)
    wrong = one.model_copy(
        update={
            "effects": {"x": EffectEntry.model_validate({"use": "friction.stribeck", "with": {"sped": 1.0}})}
        }
    )
    with pytest.raises(
        ConfigurationError, match=r"effects.x: sped: .* no parameter 'sped'; did you mean 'speed'\?"
    ):
        named_parameters(wrong)


def test_a_derived_robot_adds_effects_and_changes_their_parameters(tmp_path: Path) -> None:
    (tmp_path / "truth.yaml").write_text("""\
robid_robot: 1
name: greasy
base: one_axis
effects:
  grease: {use: friction.stribeck, on: axis_1, side: motor}
parameters:
  effect.grease.breakaway: 2.5
  friction.axis_1.coulomb: 0.7
""")
    (tmp_path / "worse.yaml").write_text("""\
robid_robot: 1
base: truth.yaml
effects:
  sand: {use: friction.stribeck, on: axis_1, side: motor, with: {speed: 1}}
parameters:
  effect.grease.speed: 4
""")
    greasy = read_description(tmp_path / "truth.yaml")
    assert greasy.name == "greasy"
    assert greasy.effects["grease"].with_ == {"breakaway": 2.5}
    assert greasy.axes["axis_1"].friction.coulomb == 0.7
    worse = read_description(tmp_path / "worse.yaml")
    assert worse.name == "greasy"
    assert {label: entry.with_ for label, entry in worse.effects.items()} == {
        "grease": {"breakaway": 2.5, "speed": 4.0},
        "sand": {"speed": 1.0},
    }
    assert list(worse.effects) == ["grease", "sand"]
