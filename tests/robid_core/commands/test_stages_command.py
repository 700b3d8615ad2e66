"""`robid stages`: every plugin with its origin; one explained so that its YAML can be pasted."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import Field

from robid_core import FrfEstimator, Robot, Settings, registry as registry_module
from robid_core.commands import doctor
from robid_core.commands.stages import command, kind_of, paste, row, setting_rows
from robid_core.errors import PluginError
from robid_core.interruption import signals_as_interrupt
from robid_core.registered import FAULTS
from robid_core.registry import (
    DRIVES,
    DYNAMICS,
    EFFECTS,
    EXECUTORS,
    EXTRAS,
    GROUPS,
    MESHES,
    MODELS,
    RECORDS,
    STAGES,
    TASKS,
    Plugin,
    Registry,
    registry,
)
from robid_core.yaml_file.kind import PIPELINE_FILE
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.problems import ProblemList


class Inner(Settings):
    """Inside."""

    order: int = 4


class Everything(FrfEstimator):
    """One of each."""

    count: Annotated[int, Field(ge=1, lt=9)]
    """How many."""
    band: tuple[float, float] = (1.0, 2.0)
    """From and to."""
    names: tuple[str, ...] = ()
    form: Literal["matrix", "element"] = "matrix"
    flag: bool = False
    limit: float | None = None
    inner: Inner = Inner()


def plugin(target: str, name: str = "frf.everything") -> Plugin:
    return Plugin(STAGES, name, target, "somebody", "3.1", EntryPoint(name, target, STAGES))


def test_settings_are_told_in_words() -> None:
    assert setting_rows(Everything) == [
        ("count", "integer >= 1 < 9", "required", "How many."),
        ("band", "list of 2 (number)", "[1.0, 2.0]", "From and to."),
        ("names", "list of text", "[]", ""),
        ("form", "matrix or element", '"matrix"', ""),
        ("flag", "true or false", "false", ""),
        ("limit", "number or null", "null", ""),
        ("inner", "mapping", '{"order": 4}', ""),
    ]


def test_what_is_to_be_pasted_is_yaml_once_the_gaps_are_filled() -> None:
    lines = paste(plugin("x:y"), Everything)
    assert lines[:4] == ["frf:", "  use: frf.everything", "  with:", "    count: ...  # integer >= 1 < 9"]
    text = "\n".join(line.replace("# ", "", 1) if line.strip().startswith("#") else line for line in lines)
    root = read_nodes(text.replace("...", "3"), PIPELINE_FILE, ProblemList("x"))
    assert root is not None
    values = root.plain()["frf"]["with"]
    stage = Everything.model_validate_json(__import__("json").dumps(values), strict=True)
    assert stage == Everything(count=3)


def test_a_plugin_that_fails_is_a_line_and_no_failure() -> None:
    name, group, package, what = row(plugin("robid_no_such_module:Stage"))
    assert (name, group, package) == ("frf.everything", "stages", "somebody 3.1")
    assert what.startswith("FAILS: 'frf.everything' (somebody 3.1) needs the module robid_no_such_module")


@pytest.mark.parametrize(
    ("group", "target", "told"),
    [
        (STAGES, "builtins:dict", "is not a stage: it is no subclass"),
        (STAGES, "robid_core:FrfEstimator", "breaks the contract of stages"),
        (STAGES, "robid_core:Stage", "is of no kind"),
        (EFFECTS, "builtins:dict", "is no subclass of robid_core.ForceEffect"),
        (EFFECTS, "robid_core:ForceEffect", "lacks parameters, source, law, sides"),
        (EFFECTS, "robid_core:StructureEffect", "lacks parameters, source, places, apply"),
        (DRIVES, "builtins:dict", "is no subclass of robid_core.Drives"),
        (RECORDS, "builtins:dict", "is no reader of recordings: it lacks describe and read"),
        (DYNAMICS, "builtins:dict", "computes no dynamics: it lacks solve_equilibrium, second_order_model"),
        (MODELS, "math:pi", "is no function"),
        (MODELS, "robid_pin.mesh:triangles_of_mesh", "cannot be called with (file, locked joints)"),
        (MESHES, "builtins:pow", "cannot be called with (file)"),
        (EXECUTORS, "builtins:dict", "is no executor: it must return a context manager"),
        (EXECUTORS, "os:fwalk", "a generator under contextlib.contextmanager"),
        (TASKS, "math:pi", "is no function"),
    ],
)
def test_what_is_registered_and_cannot_be_used_is_a_line_and_a_failure_of_doctor(
    monkeypatch: pytest.MonkeyPatch, group: str, target: str, told: str
) -> None:
    """Whoever reads the list sees it before a run does."""
    plugin = Plugin(group, "mine", target, "somebody", "3.1", EntryPoint("mine", target, group))
    assert told in row(plugin)[3]
    assert row(plugin)[3].startswith("FAILS: 'mine' (somebody 3.1) ")
    monkeypatch.setattr(registry_module, "registry", lambda: Registry([plugin.entry_point]))
    (_, (code, said)) = doctor.plugins()
    assert code
    assert told in said


def test_two_packages_with_one_name_are_told_once_by_their_group(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [EntryPoint("mine", target, STAGES) for target in ("builtins:dict", "builtins:list")]
    monkeypatch.setattr(registry_module, "registry", lambda: Registry(points))
    (_, (code, said)) = doctor.plugins()
    assert code
    assert said.startswith("plugin robid.stages 'mine' is claimed by")


def test_every_group_is_asked() -> None:
    assert set(FAULTS) == set(GROUPS)


def test_all_that_robid_brings_is_what_its_group_asks_for() -> None:
    assert [said for code, said in doctor.plugins() if code] == []


def test_a_plugin_whose_extra_is_absent_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(EXTRAS, "robid_no_such_module", "torch")
    what = row(plugin("robid_no_such_module:Stage"))[3]
    assert what.startswith(
        "not installed: 'frf.everything' (somebody 3.1) needs the module robid_no_such_module"
    )
    assert what.endswith('run: pip install "robid[torch]"')


def test_a_plugin_that_is_registered_as_no_object_is_told() -> None:
    with pytest.raises(
        PluginError, match="somebody 3.1. is registered as '!!! nothing', which is no 'module:object'"
    ):
        plugin("!!! nothing").load()


def test_a_plugin_that_interrupts_itself_when_it_is_imported_has_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "robid_impatient.py").write_text("raise KeyboardInterrupt", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    with signals_as_interrupt(), pytest.raises(PluginError, match="cannot be imported: KeyboardInterrupt"):
        plugin("robid_impatient:Stage").load()


def test_every_installed_stage_can_be_explained(capsys: pytest.CaptureFixture[str]) -> None:
    for name in registry().names(STAGES):
        command(name)
        out = capsys.readouterr().out
        assert out.startswith(f"{name}: robid.stages, ")
        assert "To paste" in out


def test_the_list_has_every_plugin_once(capsys: pytest.CaptureFixture[str]) -> None:
    command(None)
    lines = capsys.readouterr().out.splitlines()
    found = Registry([p.entry_point for p in registry().plugins(STAGES)])
    for name in found.names(STAGES):
        assert sum(line.startswith(f"{name} ") for line in lines) == 1


def test_an_unknown_type_is_told_as_anything() -> None:
    assert kind_of({}, {}) == "anything"


def test_an_effect_is_explained_with_its_place_its_table_and_its_source(
    capsys: pytest.CaptureFixture[str],
) -> None:
    command("friction.lugre")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "friction.lugre: robid.effects, robid 0.1.0, robid_effects.lugre:LuGre"
    assert lines[1] == "a force on side: motor (the default), gear, arm, bearing; its law has 1 state"
    assert "  stiffness       N m/rad    100   1e-06 to 1e+09  of the bristles, sigma0" in lines
    assert any(line.startswith("Source: C. Canudas de Wit, H. Olsson") for line in lines)
    command("sensing.white_noise")
    out = capsys.readouterr().out
    assert "a distortion on side: position (the default), torque_measurement; its law has no state" in out
    command("structure.foundation")
    assert "a change of the robot itself, on: base" in capsys.readouterr().out


@pytest.mark.parametrize("name", registry().names(EFFECTS))
def test_what_is_to_be_pasted_of_an_effect_is_a_robot_file(
    name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    command(name)
    text = capsys.readouterr().out.partition("To paste into a robot.yaml\n\n")[2]
    text = "\n".join(
        line.replace("# ", "", 1) if line.strip().startswith("#") else line for line in text.splitlines()
    )
    base = "one_axis"
    if name == "transmission.coupled_axes":  # takes two
        base, text = "six_axis", text.replace("on: axis_1", "on: axis_2")
    (tmp_path / "robot.yaml").write_text(f"robid_robot: 1\nname: pasted\nbase: {base}\n{text}\n")
    robot = Robot.load(str(tmp_path / "robot.yaml"))
    pasted = {key: value for key, value in robot.parameters().items() if key.startswith("effect.cause.")}
    table = {f"effect.cause.{r.name}": r.default for r in registry().load(EFFECTS, name).parameters}
    assert pasted == pytest.approx(table, rel=1e-11)
