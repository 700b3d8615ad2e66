"""`robid init --plugin` writes a package whose entry point leads to its class and whose own test passes."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from oracles.quick_start import ROBID, run

from robid_core.commands.init_plugin import KINDS
from robid_core.registry import GROUPS


def robid(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return run([*ROBID, *arguments], folder)


def loaded(path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_the_package_keeps_its_contract_as_it_is(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = robid("init", f"Robid my-{kind}", "--plugin", kind, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    folder, package = tmp_path / f"Robid my-{kind}", f"robid_my_{kind}"
    project = tomllib.loads((folder / "pyproject.toml").read_text())
    assert project["project"]["name"] == f"robid-my-{kind}"
    ((group, entries),) = project["project"]["entry-points"].items()
    ((plugin, target),) = entries.items()
    assert group in GROUPS
    module = loaded(folder / package / "__init__.py", package, monkeypatch)
    assert target.split(":")[0] == package
    assert isinstance(getattr(module, target.split(":")[1]), type)
    for file in folder.rglob("*.*"):
        text = file.read_text()
        assert not re.search(r"@[A-Z]+@", text), file
    assert plugin in (folder / "README.md").read_text()
    test = loaded(folder / "tests" / f"test_my_{kind}.py", f"test_my_{kind}", monkeypatch)
    getattr(test, f"test_my_{kind}_keeps_the_contract")()


def test_a_kind_that_there_is_not_is_told_and_nothing_is_overwritten(tmp_path: Path) -> None:
    done = robid("init", "new", "--plugin", "estimtor", folder=tmp_path)
    assert done.returncode == 2
    assert "no plugin of kind 'estimtor'; did you mean 'estimator'?" in done.stderr
    assert not (tmp_path / "new").exists()
    assert robid("init", "new", "--plugin", "report", folder=tmp_path).returncode == 0
    again = robid("init", "new", "--plugin", "report", folder=tmp_path)
    assert again.returncode == 2
    assert "which would be overwritten" in again.stderr
