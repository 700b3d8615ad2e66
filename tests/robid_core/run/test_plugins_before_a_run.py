"""What a third party's code does while a pipeline is read or planned ends no command without a word."""

from __future__ import annotations

import os
from typing import Any

import pytest
from faults.fault import fault

from robid_core.commands import main
from robid_core.registry import registry

TRIAL = "robid_core/commands/trial.py"
ENDED = "        except EOFError:\n"
COUNT = "class Where(CandidateDesign):\n"
SETTINGS = COUNT + "    def problems_with(self, robot):\n        {}\n\n"
FORESEEN = COUNT + "    def plan_lines(self, upstream):\n        {}\n\n"
CRASH = "import ctypes; ctypes.string_at(0)"


def told(world: Any, capsys: Any, *words: str) -> tuple[int, str, str]:
    """Exit code and words of a command, in this process and with this world's plugins."""
    registry.cache_clear()
    try:
        with pytest.raises(SystemExit) as end:
            main([*words, str(world.file)])
    finally:
        registry.cache_clear()
    return int(end.value.code or 0), *capsys.readouterr()


@fault(
    "R09",
    sees="exit 8 of validate, plan and run: a plugin's settings ended the process with exit code 0",
    mutant=(
        "robid_core/commands/arguments.py",
        "    if plugins := foreign_plugins(file):\n",
        "    if False:\n",
    ),
)
@pytest.mark.parametrize("command", ["validate", "plan", "run"])
def test_R09_settings_of_a_plugin_that_end_the_process_are_told(
    world: Any, capsys: Any, command: str
) -> None:
    elsewhere = f"os.getpid() == {os.getpid()} or os._exit(0)"  # here it would end all tests with success
    world.edit(COUNT, SETTINGS.format(elsewhere))
    code, out, err = told(world, capsys, command)
    assert (code, out) == (8, "")
    assert (
        "R09: while the pipeline was read, the code of robid_strange_stages 1.0 ended the process with exit code 0"
        in err
    )
    assert not (world.project / "runs").exists()


@fault(
    "R09",
    sees="exit 8 of plan: what a stage foresees crashed with SIGSEGV, and the line of the plugin where it did",
    mutant=(TRIAL, "        faulthandler.enable(file, all_threads=False)\n", ""),
)
def test_R09_a_crash_of_what_a_stage_foresees_is_told_with_its_line(world: Any, capsys: Any) -> None:
    world.edit(COUNT, FORESEEN.format(CRASH))
    code, _, err = told(world, capsys, "plan", "--dry")
    assert code == 8
    assert "crashed with SIGSEGV at" in err
    assert "__init__.py:" in err


@fault(
    "R09",
    sees="exit 8 of plan: which stage and plugin cannot say what it foresees, and why",
    mutant=(
        "robid_core/commands/plan.py",
        "        except Exception as error:\n",
        "        except KeyError as error:\n",
    ),
)
def test_R09_an_error_of_what_a_stage_foresees_is_told(world: Any, capsys: Any) -> None:
    world.edit(COUNT, FORESEEN.format('raise ValueError("no idea")'))
    code, _, err = told(world, capsys, "plan", "--dry")
    assert code == 8
    assert (
        "stage where: R09: 'strange.where' (robid_strange_stages 1.0) cannot say what it foresees: ValueError: no idea"
        in err
    )


def test_a_mistake_in_the_file_is_told_as_ever_where_plugins_of_others_are_named(
    world: Any, capsys: Any
) -> None:
    world.file.write_text(world.file.read_text().replace("seed:", "sed:"), "utf-8")
    code, _, err = told(world, capsys, "validate")
    assert code == 2
    assert "did you mean" in err
