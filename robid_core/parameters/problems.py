"""What is wrong with `free`, `fixed` and `prior` for a robot: all of it, each by the place where it stands."""

from __future__ import annotations

import contextlib
import fnmatch
from collections.abc import Callable, Iterator, Mapping, Sequence

from robid_core.errors import ConfigurationError
from robid_core.parameters.choice import chosen_names, matching, prior_of
from robid_core.parameters.free import all_or_none, held_moments
from robid_core.robot import Robot
from robid_core.yaml_file.problems import KeyPath


def pattern_problems(
    robot: Robot,
    free: Sequence[str],
    fixed: Sequence[str] = (),
    prior: Mapping[str, float] | None = None,
    why_not_free: Callable[[str], str] = lambda name: "",
) -> dict[KeyPath, str]:
    """Say what is wrong with patterns of parameters; empty where nothing is.

    `why_not_free` says for a name why the fit that asks cannot free it, or nothing where it can.

    Returns
    -------
    Messages by place, as `Stage.problems_with` gives them: ``("free", 0)``, ``("prior", "mass.*")``. Patterns that mean
    nothing come alone: the rest might follow from them.

    Examples
    --------
    >>> import robid_core as robid
    >>> robid.pattern_problems(robid.Robot.load("one_axis"), ["gear_stifness.*"])
    {('free', 0): "the robot has no parameter 'gear_stifness.*'; did you mean 'gear_stiffness.*'?"}
    """
    names, priors = list(robot.layout), dict(prior or {})
    places: dict[KeyPath, str] = {("free", i): pattern for i, pattern in enumerate(free)}
    places |= {("fixed", i): pattern for i, pattern in enumerate(fixed)}
    places |= {("prior", pattern): pattern for pattern in priors}
    found: dict[KeyPath, str] = {}
    for place, pattern in places.items():
        with _told(place, found):
            matching(pattern, names)
    chosen: tuple[str, ...] = ()
    if not found:
        with _told(("fixed",) if fixed else ("free",), found):
            chosen = chosen_names(names, free, fixed)
    if found:
        return found
    for pattern, deviation in priors.items():
        with _told(("prior", pattern), found):
            prior_of(chosen, {pattern: deviation}, names)
    for body, held in held_moments(chosen).items():
        freed = [name for name in chosen if name.startswith(f"{body}.")]
        found.setdefault(_cause(places, {"fixed": held, "free": freed}), all_or_none(body))
    if found:
        return found
    for i, pattern in enumerate(free):
        for name in matching(pattern, names):
            if name in chosen and (why := why_not_free(name)):
                found.setdefault(("free", i), f"'{pattern}' means {name}: {why}")
    return found


@contextlib.contextmanager
def _told(place: KeyPath, found: dict[KeyPath, str]) -> Iterator[None]:
    """Write down what is refused inside."""
    try:
        yield
    except ConfigurationError as error:
        found[place] = str(error)


def _cause(places: Mapping[KeyPath, str], meant: Mapping[str, Sequence[str]]) -> KeyPath:
    """Return where the first pattern stands that means one of the names which are given by its key."""
    return next(
        place
        for key, names in meant.items()
        for place, pattern in places.items()
        if place[0] == key and fnmatch.filter(names, pattern)
    )
