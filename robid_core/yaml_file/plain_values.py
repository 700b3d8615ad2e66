"""Python values as a file would have them: arrays are lists, paths are text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from robid_core.errors import ConfigurationError


def plain_value(value: Any) -> Any:
    """Return an array, a number of numpy or a path as plain values, for `json.dumps`.

    Raises ConfigurationError for anything else.
    """
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return value.as_posix()
    raise ConfigurationError(
        f"a {type(value).__name__} cannot be a setting; settings are numbers, texts, lists and mappings; a robot "
        "is named by its packaged name or its file"
    )
