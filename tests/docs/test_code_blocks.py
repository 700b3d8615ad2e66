"""Every block of code of the documentation is run, page by page, in order.

YAML blocks are loaded by the real readers of robot files and pipelines, and kept under their name for the blocks
after them; recordings that a page speaks of are made here. A Python block that the text calls a file is that file, the
others share the page's names, and tests in them are called. Console blocks: commands are run where the files that they
name are there; of the others, and of the worked example on six axes (README's own command), the arguments are parsed.
"""

from __future__ import annotations

import importlib
import re
import shlex
import shutil
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer.main

from robid_acquisition.recorded import RecordedAcquisition
from robid_core import Robot
from robid_core.commands.app import COMMANDS, build, command_line
from robid_core.pipeline import Pipeline

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path.name for path in DOCS.glob("*.md"))
ALWAYS = ("doctor", "init", "records", "validate")  # run whatever is there
FILES = (".yaml", ".h5", ".mcap", ".npz")
LONG = ["run", "pipeline.yaml"]
URDF = """<robot name="arm"><link name="base"/>
<link name="one"><inertial><origin xyz="0 0 0.3"/><mass value="20"/>
<inertia ixx="1" iyy="1" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="two"><inertial><origin xyz="0 0 0.2"/><mass value="10"/>
<inertia ixx="0.4" iyy="0.4" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="axis_1" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="100" velocity="3"/></joint>
<joint name="axis_2" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="100" velocity="3"/></joint></robot>"""
GRIPPER = """<link name="finger"><inertial><mass value="0.1"/>
<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="gripper_joint" type="prismatic"><parent link="two"/><child link="finger"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.05" effort="10" velocity="1"/></joint></robot>"""
FILLED_IN = {
    "gear_ratio": 100,
    "rotor_inertia": 1e-3,
    "torque_constant": 1,
    "speed_gain": 0.02,
    "integral_gain": 0.16,
}
TWO_AXES = """robid_robot: 1
name: two_axes
model: arm.urdf
axes:
  axis_1: {gear_ratio: 100, rotor_inertia: 1.0e-3}
  axis_2: {gear_ratio: 100, rotor_inertia: 1.0e-3}
"""


@dataclass(frozen=True)
class Block:
    """A block of code, its language, and the file that the text before it names (empty: none)."""

    language: str
    text: str
    file: str


def blocks(page: str) -> list[Block]:
    """Return all blocks of a page in order."""
    text = (DOCS / page).read_text(encoding="utf-8")
    found = []
    for match in re.finditer(r"^```(\w+)\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        before = text[: match.start()].rstrip().rpartition("\n\n")[2]
        named = re.findall(r"`(robid_\w+(?:/__init__)?\.py)`", before)
        found.append(Block(match[1], match[2], named[-1] if named else ""))
    return found


def make_what_pages_speak_of(folder: Path) -> None:
    """A robot file, a URDF file, and short recordings of two axes."""
    (folder / "arm.urdf").write_text(URDF)
    (folder / "two_axes.yaml").write_text(TWO_AXES)
    (folder / "lab").mkdir()
    angle = 0.3 * np.arange(8000)[:, None] + np.array([0.0, 1.0])
    q, current = np.sin(angle), np.cos(angle)
    for block in (1, 2):
        for experiment in (1, 2):
            np.savez(folder / "lab" / f"c1_b{block}_e{experiment}.npz", q=q + 0.01, current=current)
    header = "Time [s],Angle [deg],Current [A]\n"
    rows = "".join(f"{0.001 * k:.3f},{0.1 * k},{0.01 * k}\n" for k in range(40))
    for run in range(1, 5):
        (folder / "lab" / f"run_{run}.csv").write_text(header + rows)
    listed = "".join(f"run_{run}.csv,{'test' if run == 4 else 'train'}\n" for run in range(1, 5))
    (folder / "lab" / "runs.csv").write_text(f"file,role\n{listed}")
    time, state = 0.001 * np.arange(4000), np.full(4000, 5)
    np.savez(folder / "lab" / "raw.npz", t=time, counts=1000 * q[:4000], current=current[:4000], state=state)
    (folder / "pipeline.yaml").write_text((ROOT / "pipeline.yaml").read_text(encoding="utf-8"))


def fill_in(file: Path) -> None:
    """Fill in what `robid init` leaves open, as a page asks its reader to."""
    text = file.read_text(encoding="utf-8")
    for key, value in FILLED_IN.items():
        text = text.replace(f"{key}: fill_in", f"{key}: {value}")
    file.write_text(text, encoding="utf-8")


def load_yaml(block: Block, folder: Path) -> None:
    """Read a robot file or a pipeline with its real reader, and keep it under its name."""
    match = re.search(r"^name: (\S+)$", block.text, re.MULTILINE)
    assert match is not None, block.text
    path = folder / f"{match[1]}.yaml"
    path.write_text(block.text)
    if "robid_robot:" in block.text:
        assert np.isfinite(Robot.load(str(path)).gravity_torque(np.zeros(Robot.load(str(path)).n_axis))).all()
        return
    pipeline = Pipeline.load(path, data_root=folder)
    for node in pipeline.stages:
        if isinstance(node.stage, RecordedAcquisition):
            assert node.stage.recordings(folder)


def run_python(block: Block, folder: Path, names: dict[str, Any]) -> None:
    """Run a block among the page's names, or write the file that it is; call the tests that it has."""
    if block.file:
        path = folder / block.file
        path.parent.mkdir(exist_ok=True)
        path.write_text(block.text)
        importlib.invalidate_caches()
        return
    before = dict(names)
    exec(compile(block.text, "block of a page", "exec"), names)
    for name, value in list(names.items()):
        if name.startswith("test_") and before.get(name) is not value:
            value()


def check_toml(block: Block) -> None:
    """Entry points name classes that the page has defined."""
    for group in tomllib.loads(block.text)["project"]["entry-points"].values():
        for target in group.values():
            module, _, name = target.partition(":")
            assert hasattr(importlib.import_module(module), name)


def check_console(line: str) -> None:
    """Run a command of robid, or parse the arguments of one that is long or whose files only a reader has."""
    for part in line.removeprefix("$ ").split("&&"):
        words = shlex.split(part.replace("...", ""))
        if words[:1] != ["robid"]:
            assert words[:2] in (["pip", "install"], ["sphinx-build", "-W"]), line
            continue
        name, *arguments = words[1:]
        files = [word.partition("=")[2] or word for word in arguments if word.endswith(FILES)]
        written = [arguments[k + 1] for k, word in enumerate(arguments) if word in ("-o", "--output")]
        there = all(Path(file).exists() for file in files if file not in written)
        if name in ALWAYS or (there and words[1:] != LONG):
            with pytest.raises(SystemExit) as ended:
                command_line([name, *arguments])
            assert ended.value.code in (0, None), line
            if name == "init" and (robot := Path(arguments[0], "robot.yaml")).exists():
                fill_in(robot)
        else:
            group: Any = typer.main.get_command(build(list(COMMANDS), debug=False))
            group.commands[name].make_context(name, arguments)


@pytest.mark.parametrize("page", PAGES)
def test_every_block_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_what_pages_speak_of(tmp_path)
    runs = shutil.ignore_patterns("runs")
    shutil.copytree(DOCS / "example", tmp_path / "docs" / "example", ignore=runs)  # runs are written beside
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("ROBID_DATA", str(tmp_path))
    known = set(sys.modules)
    names: dict[str, Any] = {"__name__": "page"}
    every = blocks(page)
    if page == "your_own_robot.md":  # its arm has a gripper, which its robot file locks
        (tmp_path / "arm.urdf").write_text(URDF.replace("</robot>", GRIPPER))
    if page == "your_own_data.md":  # its robot file stands on another page
        every = [one for one in blocks("your_own_robot.md") if "name: lab_robot" in one.text] + every
    for block in every:
        if block.language == "yaml":
            load_yaml(block, tmp_path)
        elif block.language == "python":
            run_python(block, tmp_path, names)
        elif block.language == "toml":
            check_toml(block)
        elif block.language == "console":
            for line in block.text.splitlines():
                check_console(line)
        else:
            assert block.language == "text", block.language
    for name in set(sys.modules) - known:
        if name.startswith("robid_") and str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


def test_pages_have_blocks_of_every_language() -> None:
    languages = {block.language for page in PAGES for block in blocks(page)}
    assert {"python", "yaml", "toml", "console"} <= languages


def test_every_command_of_robid_is_run_or_parsed() -> None:
    """In a block of text nobody looks at it; examples/ are not beside the pages."""
    for page in PAGES:
        if page != "your_own_data.md":
            lines = [line for one in blocks(page) if one.language == "text" for line in one.text.splitlines()]
            assert not [line for line in lines if line.startswith("robid ")], page


def test_a_wrong_block_is_noticed(tmp_path: Path) -> None:
    with pytest.raises(AssertionError):
        run_python(Block("python", "def test_wrong():\n    assert 1 == 2\n", ""), tmp_path, {})
    with pytest.raises(Exception, match="did you mean 'one_axis_true'"):
        load_yaml(
            Block(
                "yaml",
                (DOCS / "example" / "plant.yaml").read_text().replace("one_axis_true", "one_axis_ture"),
                "",
            ),
            tmp_path,
        )
