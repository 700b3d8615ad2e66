"""Fixtures for pipeline files: fake plugins behind a registry of their own, files written into a folder."""

from __future__ import annotations

import importlib.util
import sys
import textwrap
from collections.abc import Callable
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from robid_core.pipeline import Pipeline
from robid_core.registry import Registry
from robid_core.yaml_file.problems import FileProblems

FAKES = "robid_fake_plugins"
_STAGES = {
    "design.candidates": "Candidates",
    "design.optimal": "Optimal",
    "excitation.multisine": "Multisine",
    "acquisition.drives": "DriveAcquisition",
    "acquisition.recorded": "Recorded",
    "preprocess.clean": "Clean",
    "frf.log": "LogMean",
    "frf.h1": "LogMean",
    "fit.log_response": "LogFit",
    "fit.choosy": "Choosy",
    "fit.joint": "JointFit",
    "report.html": "Page",
    "broken.contract": "Explain",
    "broken.object": "not_a_stage",
}


@pytest.fixture(scope="session", name="plugins")
def fake_registry() -> Registry:
    spec = importlib.util.spec_from_file_location(FAKES, Path(__file__).with_name("fake_plugins.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[FAKES] = module
    spec.loader.exec_module(module)
    points = [EntryPoint(name, f"{FAKES}:{target}", "robid.stages") for name, target in _STAGES.items()]
    points += [
        EntryPoint("broken.module", "robid_module_that_is_not_there:Stage", "robid.stages"),
        EntryPoint("twice.named", f"{FAKES}:LogMean", "robid.stages"),
        EntryPoint("twice.named", f"{FAKES}:LogFit", "robid.stages"),
        EntryPoint("can", f"{FAKES}:NoDrives", "robid.drives"),
        EntryPoint("simulated", f"{FAKES}:NoDrives", "robid.drives"),
        EntryPoint("pool", f"{FAKES}:pool", "robid.executors"),
        *(
            EntryPoint("plain", "builtins:dict", f"robid.{group}")
            for group in ("drives", "executors", "dynamics")
        ),
    ]
    return Registry(points)


Load = Callable[..., Pipeline]


@pytest.fixture
def load(plugins: Registry, tmp_path: Path) -> Load:
    """Return a function that reads pipeline text and gives the pipeline."""

    def read(text: str | bytes, *overrides: str, data_root: Path | None = None) -> Pipeline:
        data = text if isinstance(text, bytes) else textwrap.dedent(text).lstrip("\n").encode()
        return Pipeline.parse(data, tmp_path / "bad.yaml", overrides, plugins=plugins, data_root=data_root)

    return read


@pytest.fixture
def problems(load: Load) -> Callable[..., list[str]]:
    """Return a function that reads wrong text and gives the messages, the file's folder taken off."""

    def read(text: str | bytes, *overrides: str, data_root: Path | None = None) -> list[str]:
        with pytest.raises(FileProblems) as caught:
            load(text, *overrides, data_root=data_root)
        lines = str(caught.value).splitlines()
        assert len(lines) == len(caught.value.problems)
        return [line[line.index("bad.yaml") :] if "bad.yaml:" in line else line for line in lines]

    return read
