"""Every example in a docstring that a notebook user would call gives what it says."""

from __future__ import annotations

import doctest
import importlib

import pytest

MODULES = (
    "robid_core.artifacts.artifact",
    "robid_core.artifacts.configurations",
    "robid_core.artifacts.fit",
    "robid_core.artifacts.frf",
    "robid_core.artifacts.record",
    "robid_core.artifacts.tables",
    "robid_core.notebook.made_run",
    "robid_core.notebook.stage_function",
    "robid_core.pipeline.pipeline",
    "robid_core.plot.figures",
    "robid_core.robot.identified",
    "robid_core.robot.motions",
    "robid_core.robot.recorded",
    "robid_core.robot.robot",
    "robid_core.testing.contract",
)
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_hold(name: str) -> None:
    found = doctest.testmod(importlib.import_module(name), optionflags=OPTIONS)
    assert found.attempted, f"{name} has no examples any more"
    assert not found.failed
