"""The world of tests for runs: a project and a stranger's package, both temporary."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

NAME = "robid_strange_world"
if NAME not in sys.modules:
    spec = importlib.util.spec_from_file_location(NAME, Path(__file__).with_name("strange_world.py"))
    assert spec is not None
    assert spec.loader is not None
    sys.modules[NAME] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules[NAME])

from robid_strange_world import PACKAGE, World  # type: ignore[import-not-found]  # noqa: E402

from robid_core.registry import registry  # noqa: E402


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    world = World(tmp_path)
    monkeypatch.syspath_prepend(world.site)
    monkeypatch.setenv("STRANGE_CALLS", str(world.calls))
    monkeypatch.setattr(
        "robid_core.run.identity.core_hash", lambda: "core"
    )  # who edits robid now is no matter
    yield world
    sys.modules.pop(PACKAGE, None)
    registry.cache_clear()  # the stranger's package is gone
