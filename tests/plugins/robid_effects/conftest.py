"""A motor on which effects are put, and a signal law run over a record, sample after sample."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from robid_core import Place, SignalEffect
from robid_core.testing import example_place


def pass_through(
    effect: type[SignalEffect],
    signal: np.ndarray,
    place: Place,
    angle: np.ndarray | float = 0.0,
    speed: np.ndarray | float = 0.0,
    **values: float,
) -> np.ndarray:
    """Output of an effect's law for a record (n_sample,), from the state it starts in."""
    parameters = np.array([values.get(row.name, row.default) for row in effect.parameters])
    assert set(values) <= {row.name for row in effect.parameters}
    (term,) = effect.bind(parameters, place)
    step = place.step if place.side == "torque" else place.sample_time
    state = np.zeros(term.n_state) if term.initial is None else term.initial.copy()
    next_state = np.zeros_like(state)
    angle, speed = np.broadcast_to(angle, signal.shape), np.broadcast_to(speed, signal.shape)
    out = np.empty(signal.shape)
    for k in range(len(signal)):
        out[k] = term.law(signal[k], angle[k], speed[k], state, next_state, term.arguments, step)
        state, next_state = next_state, state
    return out


@pytest.fixture
def at() -> Callable[..., Place]:
    """Place on a side or channel; any field can be given another value."""
    return example_place


@pytest.fixture
def through() -> Callable[..., np.ndarray]:
    """Output of an effect's law for a record."""
    return pass_through
