"""Packages of strangers, installed into a temporary folder as pip would, and an environment that sees them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGES = ("robid_etfe", "robid_wear")
collect_ignore = list(PACKAGES)  # their own tests run where they are installed


@pytest.fixture(scope="session", name="stranger")
def stranger_environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Build and install the packages; return the environment of a process that finds them."""
    source = tmp_path_factory.mktemp("source")
    target = tmp_path_factory.mktemp("installed")
    for package in PACKAGES:
        shutil.copytree(Path(__file__).parent / package, source / package)
    install = [
        "install",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "--target",
        str(target),
    ]
    folders = [str(source / package) for package in PACKAGES]
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", *install, *folders]
    done = subprocess.run(command, capture_output=True, text=True, cwd=source, check=False)
    assert done.returncode == 0, done.stderr
    return {**os.environ, "PYTHONPATH": str(target), "PYTHONDONTWRITEBYTECODE": "1"}
