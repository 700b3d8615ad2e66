"""Leading periods: a transient that fades is dropped, noise is not, one period or two cannot be, told is told."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from robid_core import Channel, DenseRun, Record
from robid_core.residual import leading_periods

N_SAMPLE, STEP = 200, 0.01


def of_periods(n_period: int, transient: float, draw: np.random.Generator, lines: bool = True) -> Record:
    """A sine of amplitude one, noise of 0.01, and what fades with a time constant of a third of a period."""
    time = STEP * np.arange(n_period * N_SAMPLE)
    period_s = STEP * N_SAMPLE
    wave = np.sin(2 * np.pi * 3 * time / period_s) + transient * np.exp(-3 * time / period_s)
    channels = {}
    for name, unit in (("motor_position", "rad"), ("motor_torque", "N m")):
        values = wave + 0.01 * draw.standard_normal(len(time))
        channels[name] = Channel("motor", unit, values.reshape(1, 1, 1, n_period, N_SAMPLE, 1))
    run = DenseRun(STEP, channels, time[:N_SAMPLE], np.ones((1, 1, 1, n_period, N_SAMPLE), dtype=bool))
    line = np.array([3, 5]) if lines else None
    return Record(("x",), "computed", "zero_order_hold", (run,), np.zeros((1, 1)), line)


@pytest.mark.parametrize("lines", [True, False])
def test_periods_are_dropped_as_long_as_the_transient_is_above_the_scatter(
    lines: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """exp(-3) a period: 0.5, 0.025, 0.0012 at its beginning; of the third nothing is left in noise of 0.01."""
    record = of_periods(6, 0.5, np.random.default_rng(1), lines)
    with caplog.at_level(logging.INFO):
        found = leading_periods((record,), None, logging.getLogger("test"))
    assert found in (1, 2)
    assert f"discard: {found} leading period" in caplog.text
    many = of_periods(6, 40.0, np.random.default_rng(1), lines)
    assert leading_periods((many,), None) in (2, 3)
    assert leading_periods((record, many), None) == leading_periods((many,), None)


def test_of_a_steady_record_hardly_ever_a_period_is_dropped() -> None:
    draw = np.random.default_rng(2)
    dropped = [leading_periods((of_periods(4, 0.0, draw),), None) for _ in range(200)]
    assert sum(one > 0 for one in dropped) <= 2  # of 200 with a chance of 0.001: more than two 0.001


@pytest.mark.parametrize("n_period", [1, 2])
def test_of_one_period_or_two_nothing_can_be_dropped(n_period: int) -> None:
    assert leading_periods((of_periods(n_period, 40.0, np.random.default_rng(3)),), None) == 0


def test_what_is_told_is_done() -> None:
    record = of_periods(6, 40.0, np.random.default_rng(4))
    assert [leading_periods((record,), told) for told in (0, 1, 5)] == [0, 1, 5]
