"""The motion that a measuring stage asks for, from its settings and those of the stages that feed it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from robid_core.stage import Stage


@dataclass(frozen=True)
class PlannedMotion:
    """Configurations, blocks, experiments of a block, and periods of an experiment, those that settle among them."""

    n_config: int
    n_block: int
    n_exp: int
    n_period: int
    period_s: float
    n_recorded: int
    """Periods that are kept."""

    @property
    def n_experiment(self) -> int:
        """Experiments in all."""
        return self.n_config * self.n_block * self.n_exp

    @property
    def seconds(self) -> float:
        """How long the robot moves."""
        return self.n_experiment * self.n_period * self.period_s

    def __str__(self) -> str:
        """Return the product in words."""
        return (
            f"{_of(self.n_config, 'configuration')} x {_of(self.n_block, 'block')} x "
            f"{_of(self.n_exp, 'experiment')} x {_of(self.n_period, 'period')} of {self.period_s:g} s"
        )


def planned_motion(stage: Stage, upstream: Mapping[str, Stage], n_axis: int) -> PlannedMotion | None:
    """Return what a stage will measure; None where it measures nothing, or its settings do not say.

    One experiment per motor excites all axes of a block, unless the excitation says otherwise by `n_exp`; a design
    spends its experiments as blocks.
    """
    settings = {name: value for source in upstream.values() for name, value in source}
    period_s, blocks = settings.get("period_s"), settings.get("blocks")
    n_config = settings.get("count", settings.get("experiments"))
    recorded = _number(stage, "periods")
    periods = recorded + _number(stage, "settle_periods")
    if not (
        isinstance(period_s, float) and isinstance(blocks, int) and isinstance(n_config, int) and periods
    ):
        return None
    counts = [found for source in upstream.values() if callable(found := getattr(source, "n_exp", None))]
    n_exp = counts[0](n_axis) if counts else n_axis
    return PlannedMotion(n_config, blocks, n_exp, periods, period_s, recorded)


def _number(stage: Any, name: str) -> int:
    value = getattr(stage, name, 0)
    return value if isinstance(value, int) else 0


def _of(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
