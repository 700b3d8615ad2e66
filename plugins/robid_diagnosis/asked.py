"""Effects that a person asked for by name and that were not found: how sure that is, and why they are not named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robid_core import Finding
from robid_diagnosis.selection import Key
from robid_diagnosis.steps import Outcome
from robid_diagnosis.wording import chance_text, place_text

SMALLEST = 1e-300  # p-value that is stated


def asked_lines(outcome: Outcome, causes: Sequence[Finding], refused: Mapping[Key, str]) -> list[str]:
    """Return a line for each; `refused`: why those that gain more than chance are not named."""
    last, noise = outcome.searches[-1], max(1.0, outcome.final.misfit)
    found = {(cause.effect, cause.on, cause.side) for cause in causes}
    return [
        _line(*hit.candidate.key, hit.gain.total / noise, last.p_value(hit, noise), refused)
        for hit in last.hits
        if hit.candidate.key not in found
    ]


def _line(
    use: str, on: str | None, side: str | None, gain: float, p_value: float, refused: Mapping[Key, str]
) -> str:
    """Gain and p-value in the noise that the robot leaves."""
    chance = chance_text(p_value, SMALLEST)
    text = f"{place_text(use, on, side)}: {chance}, twice the log-likelihood rises by {max(gain, 0.0):.1f}"
    reason = refused.get((use, on, side))
    return f"{text}; not named: {reason}." if reason else f"{text}."
