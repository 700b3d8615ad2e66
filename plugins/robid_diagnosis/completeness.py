"""Whether a cause is all that acts at its place, or only a part of it.

Signs of a part, none of which needs the true law in the catalogue: it gains less than free functions of its place;
beside it free functions of its place still gain more than noise and the model's error let them; more than noise is left
where it acts; another wave of the same order is needed at its axis, though one source makes one wave. What changes the
robot itself, and gains no more than free functions of one axis, may as well be a law there.
"""

from __future__ import annotations

from collections.abc import Collection

import scipy

from robid_diagnosis.ceilings import Ceiling
from robid_diagnosis.least_gains import LeastGains
from robid_diagnosis.remainder import REMAINS, chance_of_remainders
from robid_diagnosis.selection import APART, LEVEL
from robid_diagnosis.steps import Outcome, Step

CAUSE = 0.9  # of the gain of free functions: what explains less is a part of the cause


def are_partial(outcome: Outcome) -> list[bool]:
    """Say of each cause whether it is a part of what acts at its place."""
    unexplained = {left.axis for left in outcome.left if still_gains(left, outcome)}
    names = outcome.final.problem.free.robot.axis_names
    orders = [_order(outcome, step) for step in outcome.steps]
    chances = chance_of_remainders(outcome.base, outcome.final, [step.on for step in outcome.steps])
    return [
        step.share < CAUSE
        or bool(step.as_well)
        or chance < REMAINS
        or _acts_at(step, unexplained, names)
        or any(
            other is not step and other.on == step.on and abs(order - orders[j]) < APART
            for j, other in enumerate(outcome.steps)
        )
        for step, order, chance in zip(outcome.steps, orders, chances, strict=True)
    ]


def still_gains(left: Ceiling, outcome: Outcome) -> bool:
    """Whether free functions gain beside all causes: in the data, since told tolerances alone show nothing.

    The level is divided by the number of functions that were asked (Bonferroni).
    """
    least = LeastGains.beside(outcome.final, [step.gain for step in outcome.steps], careful=True)
    p_value = len(outcome.left) * scipy.stats.chi2.sf(left.of_data, left.freedom)
    return bool(left.of_data > least.at(least.axis_names.index(left.axis)) and p_value < LEVEL)


def _acts_at(step: Step, axes: Collection[str], names: Collection[str]) -> bool:
    """Whether a cause acts at some axes; what changes the robot itself acts at all."""
    return bool(axes) if step.on not in names else step.on in axes


def _order(outcome: Outcome, step: Step) -> float:
    """Order of a wave; NaN where a cause is none."""
    for one in outcome.final.hypothesis.additions:
        if set(one.names) & set(step.names) and "order" in one.values:
            return outcome.final.robot.parameter(f"effect.{one.label}.order")
    return float("nan")
