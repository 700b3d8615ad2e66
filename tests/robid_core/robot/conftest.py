"""Effects for tests of robot files: registered as a stranger's would be, none of robid's own needed."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import pytest

from robid_core import registry as plugins

_MODULE = """
from typing import NamedTuple

from robid_core import ForceEffect

class Row(NamedTuple):
    name: str
    unit: str
    default: float
    lower: float
    upper: float

class OfAStranger(ForceEffect):
    source, law, sides = "nobody", None, ("motor",)

class Stribeck(OfAStranger):
    parameters = (Row("breakaway", "N m", 1.5, 0.0, 50.0), Row("speed", "rad/s", 2.0, 0.01, 100.0))

class Curve(OfAStranger):
    sides = ("gear",)
    parameters = tuple(
        Row(name, unit, 1e5, 0.0, 1e9)
        for name, unit in (
            ("stiffness_1", "N m/rad"), ("stiffness_2", "N m/rad"), ("stiffness_3", "N m/rad"),
            ("torque_1", "N m"), ("torque_2", "N m"), ("lost_motion", "rad"),
        )
    )

class NoTable(OfAStranger):
    pass
"""


@pytest.fixture
def effects_of_a_stranger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """friction.stribeck (breakaway, speed), transmission.piecewise_linear, and one that is no effect."""
    folder = tmp_path / "site"
    folder.mkdir()
    (folder / "effects_for_robot_files.py").write_text(_MODULE)
    monkeypatch.syspath_prepend(folder)
    points = [
        EntryPoint(name, f"effects_for_robot_files:{target}", plugins.EFFECTS)
        for name, target in (
            ("friction.stribeck", "Stribeck"),
            ("transmission.piecewise_linear", "Curve"),
            ("friction.none", "NoTable"),
        )
    ]
    registry = plugins.Registry([*points, *entry_points(group=plugins.MODELS)])
    monkeypatch.setattr(plugins, "registry", lambda: registry)
    yield
    import sys

    sys.modules.pop("effects_for_robot_files", None)
