"""Whether an object of a stranger can be called as it will be."""

from __future__ import annotations

import inspect
from typing import Any


def call_fault(loaded: Any, *arguments: str) -> str:
    """Say why an object cannot be called with so many arguments; empty where it can."""
    if not callable(loaded):
        return "is no function"
    try:
        inspect.signature(loaded).bind(*arguments)
    except TypeError:
        return f"cannot be called with ({', '.join(arguments)})"
    except ValueError:  # a function of C that does not say what it takes
        return ""
    return ""
