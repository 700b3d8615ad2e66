"""Which parameters are free: patterns such as `gear_stiffness.*` or `effect.grease.*`, checked against the robot."""

from __future__ import annotations

import difflib
import fnmatch
from collections.abc import Iterable, Sequence

from robid_core.errors import ConfigurationError


def matching(pattern: str, names: Sequence[str]) -> list[str]:
    """Return the names that a pattern means, in their order; `*` stands for anything, dots included.

    Raises ConfigurationError where it means none, with what comes near.
    """
    found = fnmatch.filter(names, pattern)
    if found:
        return found
    plain = pattern.replace("*", "").strip(".")
    heads = list(dict.fromkeys(name.partition(".")[0] for name in names))
    near = difflib.get_close_matches(plain, [*names, *heads], n=1, cutoff=0.5)
    hint = (
        f"did you mean '{near[0]}{'.*' if near[0] in heads else ''}'?"
        if near
        else f"it has {', '.join(heads)}"
    )
    raise ConfigurationError(f"the robot has no parameter '{pattern}'; {hint}")


def chosen_names(names: Sequence[str], free: Iterable[str], fixed: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the names that some pattern of `free` means and none of `fixed`, in the robot's order.

    Raises
    ------
    ConfigurationError
        For a pattern that means no parameter, and where nothing is left.

    Examples
    --------
    >>> import robid_core as robid
    >>> names = list(robid.Robot.load("one_axis").parameters())
    >>> robid.chosen_names(names, ["gear_*"], fixed=["gear_ratio.*"])
    ('gear_stiffness.axis_1', 'gear_damping.axis_1')
    """
    freed = {name for pattern in free for name in matching(pattern, names)}
    held = {name for pattern in fixed for name in matching(pattern, names)}
    chosen = tuple(name for name in names if name in freed - held)
    if not chosen:
        raise ConfigurationError("no parameter is left free; name some under `free`, or fewer under `fixed`")
    return chosen


def prior_of(names: Sequence[str], priors: dict[str, float], known: Sequence[str]) -> dict[str, float]:
    """Return the priors that patterns give to free parameters; later patterns win.

    Raises ConfigurationError for a pattern that means no parameter of the robot, or only such that are held.
    """
    found: dict[str, float] = {}
    for pattern, deviation in priors.items():
        meant = [name for name in matching(pattern, known) if name in names]
        if not meant:
            raise ConfigurationError(
                f"prior '{pattern}': what it means is held fixed; free it, or drop the prior"
            )
        found |= dict.fromkeys(meant, float(deviation))
    return found
