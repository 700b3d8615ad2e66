"""Laws as data: strangers' laws run inside the simulator, and an edited law is never served from a stale cache."""

from __future__ import annotations

import os
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from oracles.quick_start import run

from robid_core.compiled.content import content_hash
from robid_core.compiled.laws import entries_of
from robid_core.errors import PluginError
from robid_core.mechanics import (
    Controller,
    ForceTerm,
    MechanicalModel,
    MotorMotion,
    SignalTerm,
    coulomb_viscous_law,
    prescribe,
    rest_state,
    simulate,
)
from robid_core.mechanics.closed_loop import run_blocks


@numba.njit
def branching_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """Friction as a stranger may write it: branches, a library function, a state that counts steps."""
    next_state[0] = state[0] + 1.0
    level = np.tanh(velocity / parameters[2])
    if parameters[1] > 0.0:  # noqa: SIM108
        force = parameters[0] * level + parameters[1] * velocity
    else:
        force = parameters[0] * level
    return force, 0.0, parameters[0] * (1.0 - level * level) / parameters[2] + parameters[1]


@numba.njit
def hanging_law(position, velocity, load, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    return no_such_thing(velocity)  # noqa: F821


@numba.njit
def lag_law(signal, angle, speed, state, next_state, parameters, step):  # type: ignore[no-untyped-def]
    """First-order lag, exact for a held signal; the mean over the step comes out."""
    decay = np.exp(-step / parameters[0])
    next_state[0] = signal + (state[0] - signal) * decay
    return signal + (state[0] - signal) * (1.0 - decay) * parameters[0] / step


def _controller() -> Controller:
    one, zero = np.ones(1), np.zeros(1)
    return Controller(0.05 * one, one, zero, one, 1e3 * one, zero)


def _run(arm: Any, n_lane: int, forces: Any = (), signals: Any = (), n_sample: int = 80, **more: Any) -> Any:
    t = 1e-3 * np.arange(n_sample)
    size = 1.0 + np.arange(n_lane)[:, None, None]
    reference = size * 5.0 * np.sin(2 * np.pi * 12 * t)[None, :, None]
    state = rest_state(arm.mechanism, arm.stiffness, np.zeros((n_lane, 1)), forces, signals)
    return simulate(
        arm.mechanism,
        arm.stiffness,
        arm.damping,
        _controller(),
        state,
        reference,
        forces=forces,
        signals=signals,
        **more,
    )


def _friction(law: Any, arm: Any, n_state: int = 0) -> tuple[ForceTerm, ...]:
    unit = np.eye(arm.mechanism.n_coordinate)[0]
    return (ForceTerm(law, np.array([0.2, 0.01, 0.3, 0.0]), unit, unit, np.zeros(1), n_state, "friction"),)


@pytest.mark.parametrize("n_lane", [1, 11])
def test_a_law_with_branches_runs_lane_after_lane_and_gives_the_same(two_mass: Any, n_lane: int) -> None:
    ours = _run(two_mass, n_lane, _friction(coulomb_viscous_law, two_mass))
    theirs = _run(two_mass, n_lane, _friction(branching_law, two_mass, n_state=1))
    assert entries_of(coulomb_viscous_law, "force", 0, "").vectorized
    assert not entries_of(branching_law, "force", 1, "").vectorized
    # tanh of the library and ours differ in the last place; nothing amplifies it in 80 ms
    np.testing.assert_allclose(theirs.position, ours.position, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(theirs.state.law_state, np.full((n_lane, 1), 80 * 4.0))  # every step once


def test_a_law_with_branches_has_arguments_of_its_own_in_each_lane(two_mass: Any) -> None:
    n_robot, (term,) = 5, _friction(branching_law, two_mass, n_state=1)
    laws = [replace(term, arguments=np.array([0.2, 0.01 * k, 0.3 + 0.1 * k, 0.0])) for k in range(n_robot)]
    assert not entries_of(branching_law, "force", 1, "", 4).vectorized
    models = [
        MechanicalModel(two_mass.mechanism, two_mass.stiffness, two_mass.damping, (law,)) for law in laws
    ]
    acceleration = 100 * np.random.default_rng(1).normal(size=(1, 80, 1))
    motion = MotorMotion(np.zeros((1, 1)), np.zeros((1, 1)), acceleration)
    states = [rest_state(two_mass.mechanism, two_mass.stiffness, np.zeros((1, 1)), (law,)) for law in laws]
    together = prescribe(models, states, motion)
    for model, state, beside in zip(models, states, together, strict=True):
        (alone,) = prescribe([model], [state], motion)
        np.testing.assert_array_equal(beside.torque, alone.torque)
        np.testing.assert_array_equal(beside.state.law_state, 80.0)
    assert len({beside.torque.tobytes() for beside in together}) == n_robot


def test_nothing_is_compiled_again_for_another_set_of_laws(two_mass: Any) -> None:
    for n_lane in (1, 4):
        _run(two_mass, n_lane)
    kernel: Any = run_blocks
    before = list(kernel.signatures)
    for n_lane in (1, 4):
        _run(two_mass, n_lane, _friction(branching_law, two_mass, n_state=1) * 3)
    assert kernel.signatures == before


@pytest.mark.parametrize("n_lane", [1, 4])
def test_a_lag_of_the_torque_is_the_exact_lag(two_mass: Any, n_lane: int) -> None:
    # With a rotor alone the speed is the integral of the acting torque: lagging it is a first-order filter, in closed
    # form for a torque held between samples.
    arm, rotor, tau = replace(two_mass, stiffness=np.array([1e-9])), 2e-3, 3e-3
    torque = np.random.default_rng(3).normal(size=(n_lane, 60, 1))
    lag = (SignalTerm(lag_law, np.array([tau]), 0, "torque", 1, np.array([0.4]), "lag"),)
    state = rest_state(arm.mechanism, arm.stiffness, np.zeros((n_lane, 1)), (), lag)
    none = Controller(np.zeros(1), np.zeros(1), np.zeros(1), np.ones(1), np.full(1, 1e3), np.zeros(1))
    run = simulate(arm.mechanism, arm.stiffness, arm.damping, none, state, np.zeros_like(torque),
                   torque_feedforward=torque, signals=lag)  # fmt: skip
    acting, momentum = np.full(n_lane, 0.4), np.zeros(n_lane)
    for k in range(60):
        held = torque[:, k, 0]
        momentum += held * 1e-3 + (acting - held) * tau * (1 - np.exp(-1e-3 / tau))
        acting = held + (acting - held) * np.exp(-1e-3 / tau)
    np.testing.assert_allclose(run.state.speed[:, 0] * rotor, momentum, rtol=1e-9)
    np.testing.assert_allclose(run.state.law_state[:, 0], acting, rtol=1e-12)


def test_a_law_that_does_not_compile_is_told_by_the_name_of_its_effect(two_mass: Any) -> None:
    with pytest.raises(PluginError, match="effect 'friction': its law does not compile"):
        _run(two_mass, 1, _friction(hanging_law, two_mass))


def test_a_law_of_two_effects_that_does_not_compile_is_told_by_the_one_that_asks() -> None:
    for label in ("first", "second"):
        with pytest.raises(PluginError, match=f"effect '{label}': its law does not compile"):
            _ = entries_of(hanging_law, "force", 0, label).lanes


def test_the_state_must_be_of_the_same_laws(two_mass: Any) -> None:
    from robid_core.errors import ConfigurationError

    forces = _friction(branching_law, two_mass, n_state=1)
    state = rest_state(two_mass.mechanism, two_mass.stiffness, np.zeros((1, 1)))
    with pytest.raises(ConfigurationError, match="made with the same laws"):
        simulate(two_mass.mechanism, two_mass.stiffness, two_mass.damping, _controller(), state, np.zeros((1, 3, 1)),
                 forces=forces)  # fmt: skip


_HELPER = """
import numba
SIZE = {size}
@numba.njit(cache=True)
def inner(v):
    return {slope} * v * SIZE
"""
_LAW = """
import numba
import helper
@numba.njit(cache=True)
def law(position, velocity, load, state, next_state, parameters, step):
    return helper.inner(velocity), 0.0 * velocity, 0.0 * velocity
"""
_ASK = """
import ctypes
import numpy as np
from law import law
from robid_core.compiled.laws import entries_of
entries = entries_of(law, "force", 0, "stranger")
call = ctypes.CFUNCTYPE(None, *[ctypes.c_ssize_t] * 4, ctypes.c_double)(entries.single)
place, none = np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0]), np.zeros(1)
call(place.ctypes.data, none.ctypes.data, none.ctypes.data, none.ctypes.data, 1e-3)
lanes = np.zeros((6, 8)); lanes[1] = 2.0
ctypes.CFUNCTYPE(None, *[ctypes.c_ssize_t] * 4, ctypes.c_double)(entries.lanes)(
    lanes.ctypes.data, none.ctypes.data, none.ctypes.data, none.ctypes.data, 1e-3)
print(place[3], lanes[3, 5], entries.vectorized)
"""


def test_an_edited_law_is_never_served_from_a_stale_cache(tmp_path: Path) -> None:
    """Neither when a function in another file changes, called through its module, nor when a constant there does."""

    def answer(slope: float, size: float) -> list[str]:
        (tmp_path / "helper.py").write_text(_HELPER.format(slope=slope, size=size))
        (tmp_path / "law.py").write_text(_LAW)
        (tmp_path / "ask.py").write_text(textwrap.dedent(_ASK))
        environment = os.environ | {
            "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        return run(["ask.py"], tmp_path, environment, bare=True).stdout.split()

    assert answer(1.0, 1.0) == ["2.0", "2.0", "True"]
    assert answer(1.0, 1.0) == ["2.0", "2.0", "True"]  # from the cache
    assert answer(3.0, 1.0) == ["6.0", "6.0", "True"]
    assert answer(3.0, 5.0) == ["30.0", "30.0", "True"]
    assert answer(1.0, 1.0) == ["2.0", "2.0", "True"]


def test_a_law_that_is_edited_while_it_runs_leaves_no_stale_code_behind(tmp_path: Path) -> None:
    """A process that imported the old law compiles it after the edit; the next process has the new one."""
    (tmp_path / "helper.py").write_text(_HELPER.format(slope=1.0, size=1.0))
    (tmp_path / "law.py").write_text(_LAW)
    edit = "import pathlib; p = pathlib.Path('helper.py'); p.write_text(p.read_text().replace('1.0 * v', '3.0 * v'))"
    (tmp_path / "ask.py").write_text(_ASK)
    (tmp_path / "edit.py").write_text(_ASK.replace("entries = ", f"{edit}\nentries = "))
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}

    def answer(script: str) -> list[str]:
        return run([script], tmp_path, environment, bare=True).stdout.split()

    assert answer("edit.py") == ["2.0", "2.0", "True"]
    assert answer("ask.py") == ["6.0", "6.0", "True"]


def test_two_laws_of_one_file_have_different_entries_but_one_law_has_one(tmp_path: Path) -> None:
    assert content_hash(branching_law.py_func) == content_hash(branching_law.py_func)
    first = entries_of(branching_law, "force", 1, "a")
    assert first is entries_of(branching_law, "force", 1, "b")
    assert first.single != entries_of(coulomb_viscous_law, "force", 0, "c").single
