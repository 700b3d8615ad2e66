"""What a search has told: causes that were accepted one after another, and what was left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robid_core import FloatArray, VisibleSize
from robid_diagnosis.ceilings import Ceiling
from robid_diagnosis.columns import Motion
from robid_diagnosis.comparison import EXTENDED, REFITTED
from robid_diagnosis.hypothesis import Fitted
from robid_diagnosis.pictures import Picture
from robid_diagnosis.search import Found, Search
from robid_diagnosis.trials import Trial, key_of


@dataclass(frozen=True, eq=False)
class Step:
    """A cause that was accepted."""

    kind: str
    """effect, or body, rotor, spring for wrong values."""
    use: str
    on: str | None
    side: str | None
    names: tuple[str, ...]
    """Parameters of the robot that belong to it."""
    gain: float
    """Of twice the log-likelihood, by the refit."""
    p_value: float
    """After the search."""
    held_out: FloatArray
    """Gain in each configuration with sizes that the others tell, (n_config,)."""
    by_configuration: FloatArray
    """Gain in each configuration, (n_config,)."""
    by_own_size: FloatArray
    """Likewise, by a size of its own in each."""
    share: float
    """Gain over that of the best free functions at the axis; NaN where there are none."""
    freedom: int
    """Numbers that were fitted."""
    rivals: tuple[Trial, ...] = ()
    """What explains the data as well, and how it was fitted."""
    picture: Picture | None = None
    as_well: str = ""
    """Free functions of one axis that explain as much as a change of the robot itself; empty where none do."""

    @property
    def key(self) -> tuple[str, str | None, str | None]:
        """Effect and place."""
        return self.use, self.on, self.side

    @property
    def ties(self) -> tuple[tuple[str, str | None, str | None], ...]:
        """Effects and places of the rivals."""
        return tuple(key_of(one.hit) for one in self.rivals)


@dataclass(frozen=True, eq=False)
class Searched:
    """A search of all candidates against the residual of one fit."""

    search: Search
    found: Found
    groups: Sequence[Sequence[int]]
    """Experiments of each configuration."""

    @property
    def motion(self) -> Motion:
        """About the fit."""
        return self.search.motion


@dataclass(frozen=True, eq=False)
class Outcome:
    """The result of a whole diagnosis, before it is put into words."""

    base: Fitted
    final: Fitted
    written: Fitted
    """The final fit once more with what a robot file can express: that robot is told, written and judged."""
    steps: tuple[Step, ...]
    searches: tuple[Found, ...]
    """One for each step, and the last that found nothing."""
    left: tuple[Ceiling, ...]
    """What free functions at every axis would still gain, the most first."""
    visible: tuple[VisibleSize, ...]
    """What the last search would have found."""
    motion: Motion
    """About the final fit."""

    @property
    def models(self) -> dict[str, Fitted]:
        """Fits by what they are called where models are compared: nothing is extended without a cause."""
        return {REFITTED: self.base, EXTENDED: self.written} if self.steps else {REFITTED: self.written}
