"""The schema of robot files takes every robot file here, says what each key means, and refuses mistakes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jsonschema
import pytest
from ruamel.yaml import YAML

import robid_core
from robid_core.robot.file.schema import robot_schema

ROOT = Path(__file__).parents[4]
FILES = sorted([*ROOT.glob("robid_core/robots/*/*.yaml"), *ROOT.glob("examples/*/robot*.yaml")])
SCHEMA = robot_schema()


def read(path: Path) -> Any:
    return YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_every_robot_file_fits(path: Path) -> None:
    jsonschema.validate(read(path), SCHEMA)


def test_every_key_says_what_it_means() -> None:
    jsonschema.Draft7Validator.check_schema(SCHEMA)
    silent = [
        f"{name}.{key}"
        for name, part in SCHEMA["definitions"].items()
        for key, entry in part.get("properties", {}).items()
        if "description" not in entry
    ]
    assert silent == []
    assert set(SCHEMA["definitions"]["WrittenRobot"]["properties"]) >= {
        "model",
        "lock",
        "dh",
        "bodies",
        "axes",
    }


@pytest.mark.parametrize(
    "change",
    [{"model": "x.urdf"}, {"lok": {}}, {"axes": {}}, {"axes": {"axis_1": {"rotor_inertia": "fill_in"}}}],
)
def test_mistakes_do_not_fit(change: dict[str, Any]) -> None:
    data = {**read(Path(robid_core.__file__).parent / "robots" / "one_axis" / "robot.yaml"), **change}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data, SCHEMA)


def test_the_robot_files_of_the_documentation_fit() -> None:
    blocks = (ROOT / "docs" / "your_own_robot.md").read_text(encoding="utf-8").split("```yaml\n")[1:]
    texts = [block.partition("```")[0] for block in blocks]
    assert len(texts) >= 5
    for text in texts:
        jsonschema.validate(YAML(typ="safe", pure=True).load(text), SCHEMA)
