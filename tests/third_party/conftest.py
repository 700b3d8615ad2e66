"""A stranger's package, installed into a temporary folder as pip would, and an environment that sees it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent / "robid_etfe"
collect_ignore = ["robid_etfe"]  # its own test runs where it is installed


@pytest.fixture(scope="session", name="stranger")
def stranger_environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Build and install the package; return the environment of a process that finds it."""
    source = tmp_path_factory.mktemp("source") / "robid_etfe"
    target = tmp_path_factory.mktemp("installed")
    shutil.copytree(PACKAGE, source)
    install = ["install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--target"]
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *install, str(target), str(source)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=source.parent, check=False)
    assert done.returncode == 0, done.stderr
    return {**os.environ, "PYTHONPATH": str(target), "PYTHONDONTWRITEBYTECODE": "1"}
