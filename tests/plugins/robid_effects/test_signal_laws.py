"""Every built-in distortion of a signal: its own test values, and the same numbers on all lanes as on one."""

import ctypes

import numpy as np
import pytest

from robid_core import Motion
from robid_core.compiled.lanes import LANES
from robid_core.compiled.laws import entries_of
from robid_effects.current_loop import CurrentLoop
from robid_effects.delay import Delay
from robid_effects.gain_error import GainError
from robid_effects.noise import ColouredNoise, WhiteNoise
from robid_effects.quantisation import Quantisation
from robid_effects.resolver_ripple import ResolverRipple
from robid_effects.saturation import Saturation
from robid_effects.torque_constant import TorqueConstantError
from robid_effects.torque_ripple import Cogging, TorqueRipple

DRIVE = (TorqueRipple, Cogging, TorqueConstantError, CurrentLoop, Saturation)
SENSING = (ResolverRipple, Quantisation, Delay, GainError, WhiteNoise, ColouredNoise)
EVERY = pytest.mark.parametrize("effect", DRIVE + SENSING)

# Values that make each law do all it can: limits that are met, delays of more than a step.
LIVELY = {
    Saturation: {"limit": 1.5, "rate": 4e3},
    CurrentLoop: {"time_constant": 4e-4, "delay": 6.1e-4},
    Delay: {"delay": 3.3e-3},
    TorqueRipple: {"relative": 0.1},
    Quantisation: {"resolution": 0.25},
}


def lively(effect) -> np.ndarray:
    values = LIVELY.get(effect, {})
    return np.array([values.get(row.name, row.default) for row in effect.parameters])


@EVERY
def test_the_law_gives_its_own_test_values(effect, at) -> None:
    assert effect.test_values
    for value in effect.test_values:
        given = value.arguments
        parameters = np.array([given.get(row.name, row.default) for row in effect.parameters])
        (term,) = effect.bind(parameters, at(effect.channels[0]))
        state = np.array(given.get("state", np.zeros(term.n_state)))
        assert len(state) == term.n_state
        following = np.zeros_like(state)
        signal, angle, speed = (float(given.get(name, 0.0)) for name in ("signal", "angle", "speed"))
        out = effect.law(signal, angle, speed, state, following, term.arguments, given.get("step", 1e-3))
        found = {"signal": out, "next_state": following}
        for name, expected in value.expected.items():
            scale = max(1.0, float(np.max(np.abs(expected))))
            np.testing.assert_allclose(found[name], expected, rtol=0, atol=value.tolerance * scale)


@EVERY
def test_lanes_give_the_numbers_of_a_single_run_bit_by_bit(effect, at) -> None:
    (term,) = effect.bind(lively(effect), at(effect.channels[0]))
    entries = entries_of(term.law, "signal", term.n_state, term.label)
    assert entries.vectorized
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_ssize_t] * 4, ctypes.c_double)
    single, lanes = kind(entries.single), kind(entries.lanes)
    n = 60
    inputs = np.random.default_rng(17).standard_normal((n, 3, LANES)) * np.array([1.0, 30.0, 100.0])[:, None]
    state, following = np.zeros((2, max(term.n_state, 1), LANES))
    together = np.empty((n, LANES))
    for k in range(n):
        io = np.concatenate([inputs[k], np.zeros((3, LANES))])
        before = state.copy()
        lanes(io.ctypes.data, state.ctypes.data, following.ctypes.data, term.arguments.ctypes.data, 2.5e-4)
        np.testing.assert_array_equal(state, before)
        together[k] = io[3]
        state, following = following, state
    for lane in range(LANES):
        own, after = np.zeros((2, max(term.n_state, 1)))
        for k in range(n):
            io = np.concatenate([inputs[k, :, lane], np.zeros(3)])
            single(io.ctypes.data, own.ctypes.data, after.ctypes.data, term.arguments.ctypes.data, 2.5e-4)
            assert io[3] == together[k, lane]
            own, after = after, own
        if term.n_state:
            np.testing.assert_array_equal(own, state[:, lane])
    assert np.ptp(together) > 0.5


@EVERY
def test_defaults_stand_within_their_bounds_and_the_gain_has_a_value_a_frequency(effect, at) -> None:
    assert effect.source
    assert effect.__doc__
    names = [row.name for row in effect.parameters]
    assert len(set(names)) == len(names)
    for row in effect.parameters:
        assert row.lower <= row.default <= row.upper
        assert row.unit
        assert row.description
    omega = np.array([1.0, 60.0, 500.0])
    for channel in effect.channels:
        gain = effect.gain(effect.defaults(), at(channel), omega, Motion())
        assert gain.shape == omega.shape
        assert gain.dtype == np.complex128
        assert effect.law is effect.bind(effect.defaults(), at(channel))[0].law
