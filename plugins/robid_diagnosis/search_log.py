"""The course of a diagnosis, told while it works: each search, what was named, and why others were not.

All of it stands in the log of the run; the command line shows all but the reasons why others were not named.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence

from robid_core import MILESTONE
from robid_diagnosis.hypothesis import Fitted
from robid_diagnosis.search import Found, Hit
from robid_diagnosis.steps import Step
from robid_diagnosis.wording import chance_text, place_text

SHOWN = 3  # candidates of a search


class SearchLog:
    """Writes lines into a log; into none where it is None."""

    def __init__(self, log: logging.Logger | None = None) -> None:
        self.log = log

    def refitted(self, fitted: Fitted) -> None:
        """Say how well the robot file fits with all its values."""
        self._line("all values refitted: misfit %.3g", fitted.misfit)

    def searched(self, found: Found, fitted: Fitted) -> None:
        """Say how many candidates there were, and which promise most."""
        best = "; ".join(self._promise(hit, found, fitted) for hit in found.hits[:SHOWN])
        self._line("search among %d candidates: %s", found.n_tried, best or "none would gain anything")

    def named(self, step: Step, before: Sequence[Step], after: Sequence[Step], fitted: Fitted) -> None:
        """Say what was named, and what was dropped of all causes `before` a backward pass, or came in exchange."""
        self._line("named %s: twice the log-likelihood rises by %.4g", _cause(step), step.gain)
        for one in (one for one in before if one not in after):
            self._line("looked at again beside it and no longer named: %s", _cause(one))
        for one in (one for one in after if one not in before):
            self._line("named in exchange: %s", _cause(one))
        self._line("causes: %d, misfit %.3g", len(after), fitted.misfit)

    def ended(self, refused: Mapping[tuple[str, str | None, str | None], str], full: bool) -> None:
        """Say that nothing more is named, and why what gains more than chance is not; `full`: no more may be."""
        if full:
            self._line("as many causes as may be named (most)")
            return
        self._line("nothing more is named")
        for key, reason in refused.items():
            self._line("not named, %s: %s", place_text(*key), reason, level=logging.INFO)

    def named_all(self, steps: Sequence[Step]) -> None:
        """Say what is fitted once nothing more is named: that may take as long as the search."""
        rivals = sum(len(step.rivals) for step in steps)
        self._line(
            "left to do: %d ties to compare, the zero-speed width of the robot file, then its checks", rivals
        )

    def _promise(self, hit: Hit, found: Found, fitted: Fitted) -> str:
        """Gain and p-value after the search, in the noise that the fit leaves."""
        noise = max(1.0, fitted.misfit)
        chance = chance_text(found.p_value(hit, noise))
        return f"{place_text(*hit.candidate.key)} gains {hit.gain.total / noise:.3g}, {chance}"

    def _line(self, text: str, *values: object, level: int = MILESTONE) -> None:
        if self.log is not None:
            self.log.log(level, text, *values)


def _cause(step: Step) -> str:
    place = place_text(*step.key)
    return place if step.kind == "effect" else f"wrong value: {place}"
