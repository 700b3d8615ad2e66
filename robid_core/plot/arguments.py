"""What a figure is asked of: a result of the right kind, and an axis and numbers that it has."""

from __future__ import annotations

from collections.abc import Sequence

from robid_core.errors import ConfigurationError


def check_kind(argument: str, given: object, *kinds: type) -> None:
    """Raise ConfigurationError where `given` is none of these kinds; `argument` is `time: result`, say."""
    if not isinstance(given, kinds):
        wanted = " or ".join("None" if kind is type(None) else kind.__name__ for kind in kinds)
        raise ConfigurationError(f"plot.{argument} has to be {wanted}, not {type(given).__name__}")


def check_number(what: str, number: int, count: int) -> None:
    """Raise ConfigurationError where there is no configuration (or block, ...) of that number, counted from zero."""
    if not 0 <= number < count:
        raise ConfigurationError(f"there is no {what} {number}; they are 0 to {count - 1}")


def axis_number(names: Sequence[str], name: str) -> int:
    """Return the place of an axis; ConfigurationError names the ones that there are."""
    if name not in names:
        raise ConfigurationError(f"there is no axis '{name}'; there are: {', '.join(names)}")
    return names.index(name)
