"""Factors of a derived robot file: named parameters as so many times those of the base, by pattern."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator, Mapping
from typing import Any

from robid_core.robot.file.description import RobotDescription
from robid_core.robot.file.document import Document
from robid_core.robot.file.named_parameters import named_parameters
from robid_core.yaml_file.problems import suggestion

USUAL = (0.1, 10.0)


def unusual_factors(data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield each pattern of `factors` whose factor makes another robot, with a sentence."""
    factors = data.get("factors")
    for pattern, factor in factors.items() if isinstance(factors, dict) else ():
        if isinstance(factor, bool) or not isinstance(factor, int | float):
            continue
        if factor > 0 and not USUAL[0] <= factor <= USUAL[1]:
            percent = f"; per cent? {factor:g} % are {factor / 100:g}" if factor > 1 else ""
            yield str(pattern), f"{factor:g} times what the base has{percent}"


def values_by_factor(factors: Any, robot: RobotDescription, document: Document) -> dict[str, float]:
    """Return the values of all parameters that a pattern matches; what matches none is told.

    Where several patterns match a parameter, all their factors act on it.
    """
    known = named_parameters(robot)
    found: dict[str, float] = {}
    for pattern, factor in factors.items() if isinstance(factors, dict) else ():
        if isinstance(factor, bool) or not isinstance(factor, int | float):
            continue  # told already
        names = fnmatch.filter(known, str(pattern))
        if not names:
            document.add(
                ("factors", str(pattern)),
                f"{robot.name} has no such parameter; {suggestion(str(pattern), known, 'it has')}",
            )
        for name in names:
            found[name] = found.get(name, known[name].value) * factor
    return found
