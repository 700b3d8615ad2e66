"""Where a pipeline lives: its folder, its project, and the read-only folder of measured data."""

from __future__ import annotations

import os
from pathlib import Path

from robid_core.errors import ConfigurationError
from robid_core.settings_types import Places

ENVIRONMENT = "ROBID_DATA"
DEFAULT_DATA = Path("..") / "shared" / "data"
# What marks the root of a project; a pipeline outside any lives in a project of its own folder.
_ROOT_MARKS = ("pyproject.toml", ".git")


def project_root(folder: Path) -> Path:
    """Return the nearest folder above (or equal to) `folder` that is a project; else `folder` itself."""
    for candidate in (folder, *folder.parents):
        if any((candidate / mark).exists() for mark in _ROOT_MARKS):
            return candidate
    return folder


def find_places(file: Path, data_root: Path | None = None) -> Places:
    """Return where the paths in a pipeline file begin.

    The data root is `data_root` where given, else the environment's ROBID_DATA, else ../shared/data from the
    project's root. Raises ConfigurationError where the first two name no folder.
    """
    folder = file.resolve().parent
    project = project_root(folder)
    if data_root is not None:
        chosen, origin = data_root, "given by --data"
    elif os.environ.get(ENVIRONMENT):
        chosen, origin = Path(os.environ[ENVIRONMENT]), f"given by {ENVIRONMENT}"
    else:
        return Places(folder, project, (project / DEFAULT_DATA).resolve(), "the default")
    if not chosen.is_dir():
        raise ConfigurationError(
            f"the data folder {chosen} ({origin}) does not exist; name the folder that holds the data"
        )
    return Places(folder, project, chosen.resolve(), origin)
