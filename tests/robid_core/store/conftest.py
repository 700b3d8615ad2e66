"""The model of a disk, importable by the tests beside it."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from robid_core import Configurations

NAME = "robid_crash_states"
if NAME not in sys.modules:
    spec = importlib.util.spec_from_file_location(NAME, Path(__file__).with_name("crash_states.py"))
    assert spec is not None
    assert spec.loader is not None
    sys.modules[NAME] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules[NAME])


@pytest.fixture
def artifact() -> Configurations:
    return Configurations(("axis_1", "axis_2"), np.random.default_rng(1).normal(size=(3, 2)))
