"""Effects that were not named, and why not: those that a person asked for, and the nearest to what is left."""

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


def nearest_lines(outcome: Outcome, unknown: Sequence[Finding], refused: Mapping[Key, str]) -> list[str]:
    """Return a line for each axis at which only free functions explain what is left: the effect that comes nearest."""
    last, noise, lines = outcome.searches[-1], max(1.0, outcome.final.misfit), []
    for axis in dict.fromkeys(one.on for one in unknown):
        hit = next((hit for hit in last.hits if hit.candidate.key[1] == axis), None)
        if hit is None or hit.candidate.key not in refused:
            continue
        near = _line(*hit.candidate.key, hit.gain.total / noise, last.p_value(hit, noise), refused)
        use = hit.candidate.key[0]
        lines.append(f"Nearest to it is {near} To try it alone: robid diagnose --test {use}@{axis}.")
    return lines


def _line(
    use: str, on: str | None, side: str | None, gain: float, p_value: float, refused: Mapping[Key, str]
) -> str:
    """Gain and p-value in the noise that the robot leaves."""
    chance = chance_text(p_value, SMALLEST)
    text = f"{place_text(use, on, side)}: {chance}, twice the log-likelihood rises by {max(gain, 0.0):.1f}"
    reason = refused.get((use, on, side))
    return f"{text}; not named: {reason}." if reason else f"{text}."
