"""What the law of an effect owes, tried through the entries by which the simulator calls it.

A law is finite wherever an axis may be, leaves its state and its parameters alone, writes the whole next state, says
the slopes of its own force, and gives on eight lanes what it gives on one number.
"""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.compiled.lanes import LANES
from robid_core.compiled.laws import N_INPUT, N_OUTPUT, entries_of
from robid_core.errors import PluginError
from robid_core.mechanics.terms import ForceTerm, SignalTerm
from robid_core.testing.broken import ContractBroken

STEP = 2.5e-4  # s, of the simulator
N_POINT = 60  # of a random path
SLOPE = 1e-4  # relative, between a slope and a difference
NOTHING = 1e-6  # of the force: what a slope may be wrong by where the argument changes by its own size
AMPLITUDES = (1e-4, 1e-2, 0.3)  # rad
OMEGAS = (1.0, 60.0)  # rad/s
LOADS = (-20.0, 0.0, 20.0)  # N m
N_CYCLE = 200  # steps
GIVEN = 0.2  # of the work that goes through a law in a cycle, either way
GUARD = 3  # rows behind a state that nobody may touch, and behind parameters that hold not-a-number

FORCE_INPUTS = ("position", "velocity", "load")
SIGNAL_INPUTS = ("signal", "angle", "speed")
OUTPUTS = ("force", "slope_position", "slope_velocity")

_ENTRY = ctypes.CFUNCTYPE(None, *[ctypes.c_ssize_t] * 4, ctypes.c_double)


class Point(NamedTuple):
    """Where a law is called."""

    inputs: FloatArray
    """Position, velocity, load, or signal, angle, speed; shape (3,)."""
    state: FloatArray
    """(n_state,)."""


class TriedLaw:
    """The law of one term, called as the simulator calls it, and watched while it runs."""

    def __init__(self, name: str, term: ForceTerm | SignalTerm) -> None:
        self.name = name
        self.is_force = isinstance(term, ForceTerm)
        self.inputs = FORCE_INPUTS if self.is_force else SIGNAL_INPUTS
        self.n_state = term.n_state
        given = None if isinstance(term, ForceTerm) else term.initial
        self.initial = np.zeros(term.n_state) if given is None else np.array(given, dtype=np.float64)
        if self.initial.shape != (term.n_state,):
            raise ContractBroken(
                f"{name}: initial state of shape {self.initial.shape}, n_state is {term.n_state}"
            )
        self._arguments = np.append(np.asarray(term.arguments, dtype=np.float64), np.full(GUARD, np.nan))
        self._given = self._arguments.copy()
        self._place, self._state, self._following = (
            np.full(size, np.nan) for size in (N_INPUT + N_OUTPUT, self.n_state + GUARD, self.n_state + GUARD)
        )
        self._addresses = [
            a.ctypes.data for a in (self._place, self._state, self._following, self._arguments)
        ]
        try:
            entries = entries_of(term.law, "force" if self.is_force else "signal", term.n_state, term.label)
            self._single, self._lanes = _ENTRY(entries.single), _ENTRY(entries.lanes)
        except PluginError as error:
            raise ContractBroken(f"{name}: {error}") from error
        self._entries = entries  # keeps the machine code
        self.vectorized = entries.vectorized

    def __call__(self, point: Point, step: float) -> tuple[FloatArray, FloatArray]:
        """Return outputs (force and slopes, or the signal) and the next state.

        Raises ContractBroken where the law writes what is not its own, leaves a state out or returns no number.
        """
        n = self.n_state
        self._place[:] = self._following[:] = self._state[n:] = np.nan
        self._place[:N_INPUT], self._state[:n] = point.inputs, point.state
        self._single(*self._addresses, step)
        if (self._state[:n] != point.state).any() or not np.isnan(self._state[n:]).all():
            raise ContractBroken(f"{self.name}: the law writes `state`; write next_state only")
        if not np.array_equal(self._arguments, self._given, equal_nan=True):
            self._arguments[:] = self._given
            raise ContractBroken(f"{self.name}: the law writes `parameters`; they belong to all lanes")
        if not np.isnan(self._following[n:]).all():
            raise ContractBroken(f"{self.name}: the law writes next_state[{n}] and n_state is {n}")
        following = self._following[:n].copy()
        outputs = self._place[N_INPUT : N_INPUT + (N_OUTPUT if self.is_force else 1)].copy()
        if not (np.isfinite(outputs).all() and np.isfinite(following).all()):
            raise ContractBroken(
                f"{self.name}: the law gives {self._told(outputs)}, next_state {following} at "
                f"{self.where(point, step)}; {_hint(following)}"
            )
        return outputs, following

    def lanes(self, inputs: FloatArray, state: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
        """Return outputs (3 or 1, LANES) and next state (n_state, LANES) of all lanes at once."""
        place = np.concatenate((inputs, np.zeros((N_OUTPUT, LANES))))
        before, following = np.zeros((2, self.n_state + GUARD, LANES))
        before[: self.n_state] = state
        self._lanes(*(array.ctypes.data for array in (place, before, following, self._arguments)), step)
        return place[N_INPUT : N_INPUT + (N_OUTPUT if self.is_force else 1)], following[: self.n_state]

    def where(self, point: Point, step: float) -> str:
        """Tell a point in words."""
        told = ", ".join(f"{n} {v:.6g}" for n, v in zip(self.inputs, point.inputs, strict=True))
        return f"{told}, step {step:g}" + (f", state {point.state}" if self.n_state else "")

    def _told(self, outputs: FloatArray) -> str:
        names = OUTPUTS if self.is_force else ("signal",)
        return ", ".join(f"{name} {value:.6g}" for name, value in zip(names, outputs, strict=True))


def _hint(following: FloatArray) -> str:
    missing = np.flatnonzero(np.isnan(following)).tolist()
    if missing:
        return f"next_state{missing} is not written, or not a number; a law writes all {len(following)}"
    if not np.isfinite(following).all():
        return "advance the state exactly or implicitly, so that it stays finite at any step"
    return "guard divisions and roots, and read no parameter or state that is not there"


def random_inputs(law: TriedLaw, generator: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    """Return inputs over all sizes that an axis meets, either sign, shape (3, *shape).

    From a micrometre's angle to half a turn, from creeping to 100 rad/s, loads from 0.1 to 300 N m.
    """
    low, high = (
        ((-6.0, -4.0, -1.0), (0.5, 2.0, 2.5)) if law.is_force else ((-3.0, -2.0, -4.0), (1.5, 1.5, 2.0))
    )
    reach = (3, *[1] * len(shape))
    exponent = generator.uniform(np.reshape(low, reach), np.reshape(high, reach), (3, *shape))
    sign: FloatArray = np.where(generator.random((3, *shape)) < 0.5, -1.0, 1.0)
    return sign * 10**exponent


def random_path(law: TriedLaw, n_point: int, step: float, seed: int = 0) -> Iterator[Point]:
    """Yield points along a restless motion, each with the state that the law has got into."""
    inputs = random_inputs(law, np.random.default_rng(seed), (n_point,))
    state = law.initial
    for column in inputs.T:
        point = Point(np.ascontiguousarray(column), state)
        yield point
        state = law(point, step)[1]


def check_numbers(law: TriedLaw) -> None:
    """Check that a law is finite for any step, and a function of its arguments alone."""
    for step in (STEP, 1e-3, 0.1, 10.0):
        for point in random_path(law, N_POINT, step):
            first, again = law(point, step), law(point, step)
            if any(not np.array_equal(a, b) for a, b in zip(first, again, strict=True)):
                raise ContractBroken(
                    f"{law.name}: the law gives other numbers the second time at {law.where(point, step)}"
                )


def check_rest(law: TriedLaw) -> None:
    """Check that a force law keeps its state in a step of no length."""
    for point in random_path(law, N_POINT, STEP):
        _, following = law(point, 0.0)
        size = np.maximum(np.abs(point.state), 1.0)
        if not (np.abs(following - point.state) <= 1e-12 * size).all():
            raise ContractBroken(
                f"{law.name}: with step 0 the state changes to {following} at {law.where(point, 0.0)}; a step of no "
                "length asks for the static force"
            )


def check_work(law: TriedLaw) -> None:
    """Check that a force law takes work from a motion that comes back to where it was, as friction and springs do.

    A law that stands in place of a damper of the robot file (a gap) may take a little less than nothing.
    """
    for amplitude, omega, load in itertools.product(AMPLITUDES, OMEGAS, LOADS):
        step, state = 2 * np.pi / omega / N_CYCLE, law.initial
        done = size = 0.0
        for number in range(2 * N_CYCLE):
            phase = omega * (number + 0.5) * step
            velocity = amplitude * omega * np.cos(phase)
            outputs, state = law(Point(np.array([amplitude * np.sin(phase), velocity, load]), state), step)
            if number >= N_CYCLE:  # the state has settled
                done += float(outputs[0] * velocity)
                size += abs(float(outputs[0] * velocity))
        if done < -GIVEN * size:
            raise ContractBroken(
                f"{law.name}: the law pushes with the motion: over a cycle of {amplitude:g} rad at {omega:g} rad/s "
                f"under a load of {load:g} N m it gives {100 * abs(done) / size:.0f} % of the work through it; the "
                "force against the motion is positive where the velocity is (the robot takes minus the force)"
            )


def check_slopes(law: TriedLaw) -> None:
    """Compare a force law's slopes with differences of its force at random points."""
    for point in random_path(law, N_POINT, STEP):
        outputs, _ = law(point, STEP)
        for row in (0, 1):

            def force(value: float, row: int = row, point: Point = point) -> float:
                moved = point.inputs.copy()
                moved[row] = value
                return float(law(Point(moved, point.state), STEP)[0][0])

            slope = float(outputs[1 + row])
            found = compare_slope(force, float(point.inputs[row]), slope)
            if found is not None:
                hint = (
                    "; it holds what the velocity does to the state within half a step"
                    if row == 1 and law.n_state
                    else ""
                )
                raise ContractBroken(
                    f"{law.name}: {OUTPUTS[1 + row]} is {slope:.6g}, differences of the force are {found[0]:.6g} to "
                    f"the left and {found[1]:.6g} to the right at {law.where(point, STEP)}; a law gives the force and "
                    f"its derivatives in position and velocity{hint}"
                )


def compare_slope(function: Callable[[float], float], at: float, slope: float) -> tuple[float, float] | None:
    """Return the one-sided differences of a function where a slope lies outside of them; None where it fits.

    The slope fits if for one of several distances it lies between the differences to the left and to the right,
    to 1e-4: at a kink either side is right. What it may be wrong by without being noticed is a millionth of the
    value, per change of the argument by itself.
    """
    value = function(at)
    worst: tuple[float, float] | None = None
    for distance in abs(at) * 10.0 ** np.arange(-3, -8, -1):
        left = (value - function(at - distance)) / distance
        right = (function(at + distance) - value) / distance
        allowed = SLOPE * max(abs(slope), abs(left + right) / 2) + NOTHING * abs(value / at)
        if min(left, right) - allowed <= slope <= max(left, right) + allowed:
            return None
        worst = worst or (left, right)
    return worst


def check_lanes(law: TriedLaw, n_step: int = 40) -> None:
    """Check that all lanes give what each gives alone, bit by bit, states included."""
    inputs = random_inputs(law, np.random.default_rng(1), (n_step, LANES)).transpose(1, 0, 2)
    state = np.repeat(law.initial[:, None], LANES, axis=1)
    for sample in np.ascontiguousarray(inputs):
        together, following = law.lanes(sample, state, STEP)
        for lane in range(LANES):
            point = Point(sample[:, lane].copy(), state[:, lane].copy())
            alone, after = law(point, STEP)
            if not (np.array_equal(together[:, lane], alone) and np.array_equal(following[:, lane], after)):
                raise ContractBroken(
                    f"{law.name}: on all lanes {together[:, lane]}, next_state {following[:, lane]}; alone {alone}, "
                    f"next_state {after} at {law.where(point, STEP)}; is the law compiled with "
                    "robid_core.mechanics.kernel, which rounds as written?"
                )
        state = following
