"""A motor on which effects are put, and a signal law run over a record, sample after sample."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from robid_core import Place, SignalEffect


def place_at(side: str, **changes: Any) -> Place:
    row = np.zeros(2)
    numbers: dict[str, Any] = {
        "name": "axis_1",
        "axis": 0,
        "side": side,
        "label": "tried",
        "stiffness": 0.0,
        "damping": 0.0,
        "gear_ratio": 100.0,
        "rotor_inertia": 1e-3,
        "torque_constant": 1.0,
        "torque_limit": 20.0,
        "sample_time": 1e-3,
        "step": 2.5e-4,
        "direction": row,
        "motor": row,
        "transmission": row,
        "load": row[:1],
        "motor_load": row[:1],
    }
    return Place(**numbers | changes)


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
    return place_at


@pytest.fixture
def through() -> Callable[..., np.ndarray]:
    """Output of an effect's law for a record."""
    return pass_through
