"""Laws along given motions: force, slopes and state of one law, step by step, as the simulator would run it.

One sample is one step: its motion is that in the middle of the step, the law's state goes from its beginning to its
end. A periodic motion has no first step: there the last samples are run before, until bristles have forgotten how
they stood.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.compiled.kernel import kernel
from robid_core.compiled.lanes import LANES
from robid_core.compiled.laws import N_INPUT, N_OUTPUT, entries_of
from robid_core.compiled.views import address_of, call_law, view_of
from robid_core.errors import ConfigurationError
from robid_core.mechanics.terms import ForceTerm, SignalTerm


@dataclass(frozen=True, eq=False)
class LawRun:
    """What a force law gives along a motion, each (n_lane, n_sample) but the state."""

    force: FloatArray
    """In the middle of each step, N m (N), against the motion."""
    slope_position: FloatArray
    """N m/rad."""
    slope_velocity: FloatArray
    """N m s/rad, with what the velocity does to the state within half a step."""
    state: FloatArray
    """After the last step, shape (n_lane, n_state)."""


def law_along(
    term: ForceTerm,
    position: FloatArray,
    velocity: FloatArray,
    load: FloatArray | float,
    step: float,
    *,
    settle: int = 0,
    state: FloatArray | None = None,
) -> LawRun:
    """Force of a law along a motion of the coordinate that it sees.

    Parameters
    ----------
    term
        The law and its arguments.
    position, velocity
        In the middle of each step, rad and rad/s, shape (n_lane, n_sample).
    load
        Torque of the transmissions as the term weighs it, N m, same shape, or one number.
    step
        s; 0 asks for the static force.
    settle
        How many samples, from the end of the motion, are run before its first one.
    state
        In which each lane begins, shape (n_lane, n_state); by default zero.

    Raises
    ------
    ConfigurationError
        Where shapes do not fit, or `settle` is more than there are samples.
    """
    start = np.zeros(term.n_state) if state is None else state
    outputs, end = _run(term, N_OUTPUT, (position, velocity, load), step, settle, start)
    return LawRun(outputs[0], outputs[1], outputs[2], end)


def signal_along(
    term: SignalTerm,
    signal: FloatArray,
    angle: FloatArray,
    speed: FloatArray,
    step: float,
    *,
    settle: int = 0,
) -> FloatArray:
    """What a law makes of a signal along a motion, shape (n_lane, n_sample).

    Parameters
    ----------
    term
        The law and its arguments.
    signal
        Of the channel, in its unit, shape (n_lane, n_sample).
    angle, speed
        Of the motor, rad and rad/s, same shape.
    step
        Between two samples, s.
    settle
        As of `law_along`, which says what is raised too.
    """
    start = np.zeros(term.n_state) if term.initial is None else term.initial
    outputs, _ = _run(term, 1, (signal, angle, speed), step, settle, start)
    heard: FloatArray = outputs[0]
    return heard


def _run(
    term: ForceTerm | SignalTerm,
    n_output: int,
    given: tuple[FloatArray, FloatArray, FloatArray | float],
    step: float,
    settle: int,
    start: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Outputs (n_output, n_lane, n_sample) of a law, and its states at the end (n_lane, n_state)."""
    shape = np.shape(given[0])
    if len(shape) != 2 or np.shape(given[1]) != shape or np.shape(given[2]) not in ((), shape):
        raise ConfigurationError(
            f"effect '{term.label}': its law is asked along {', '.join(str(np.shape(value)) for value in given)}; "
            "give three arrays (n_lane, n_sample)"
        )
    if not 0 <= settle <= shape[1]:
        raise ConfigurationError(
            f"effect '{term.label}': {settle} samples to settle of {shape[1]} that there are; give no more than these"
        )
    inputs = np.empty((N_INPUT, *shape))
    for row, value in zip(inputs, given, strict=True):
        row[:] = value
    state = np.array(np.broadcast_to(start, (shape[0], term.n_state)), dtype=np.float64, order="C")
    outputs = np.empty((n_output, *shape))
    entries = entries_of(term.law, "force" if n_output == N_OUTPUT else "signal", term.n_state, term.label)
    arguments = np.append(np.asarray(term.arguments, dtype=np.float64), 0.0)
    run_law(entries.lanes, inputs, outputs, state, arguments, float(step), settle)
    return outputs, state


def run_law(
    entry: int,
    inputs: FloatArray,
    outputs: FloatArray,
    state: FloatArray,
    arguments: FloatArray,
    step: float,
    settle: int = 0,
) -> None:
    """Run the law at an address over inputs (3, n_lane, n_sample) into outputs (n_output, n_lane, n_sample).

    `state` (n_lane, n_state) moves on in place; `arguments` must not be empty. Without a state no sample depends on
    another one: then samples stand side by side in a register, which is faster, and else lanes.
    """
    memory = np.zeros((N_INPUT + N_OUTPUT + 2 * max(state.shape[1], 1), LANES))
    if state.shape[1]:
        _march(entry, inputs, outputs, state, arguments, step, settle, memory)
    else:
        flat = (values.reshape(len(values), -1) for values in (inputs, outputs))
        _sample_by_sample(entry, *flat, arguments, step, memory)


@kernel
def _sample_by_sample(entry, inputs, outputs, arguments, step, memory):  # type: ignore[no-untyped-def]
    """Call a law without a state for as many samples at once as a register holds; `memory` as of `_march`."""
    n_input, n_output, n_sample = inputs.shape[0], outputs.shape[0], inputs.shape[1]
    rows, numbers = view_of(memory), view_of(arguments)
    state = address_of(rows, memory.shape[0] - 1)
    for first in range(0, n_sample, LANES):
        width = min(LANES, n_sample - first)
        for i in range(n_input):
            for lane in range(LANES):
                memory[i, lane] = inputs[i, first + min(lane, width - 1)]
        call_law(entry, address_of(rows, 0), state, state, address_of(numbers, 0), step)
        for i in range(n_output):
            for lane in range(width):
                outputs[i, first + lane] = memory[n_input + i, lane]


@kernel
def _march(entry, inputs, outputs, state, arguments, step, settle, memory):  # type: ignore[no-untyped-def]
    """Call the law for each block of lanes and sample; `memory` has rows of its place, its state and the next."""
    n_place, n_input = memory.shape[0] - 2 * max(state.shape[1], 1), inputs.shape[0]
    n_lane, n_sample, n_state = inputs.shape[1], inputs.shape[2], state.shape[1]
    following = n_place + max(n_state, 1)
    rows, numbers = view_of(memory), view_of(arguments)
    for block in range(0, n_lane, LANES):
        last = min(n_lane - block, LANES) - 1
        for lane in range(LANES):
            for k in range(n_state):
                memory[n_place + k, lane] = state[block + min(lane, last), k]
        for sample in range(-settle, n_sample):
            now = sample if sample >= 0 else sample + n_sample
            for i in range(n_input):
                for lane in range(LANES):
                    memory[i, lane] = inputs[i, block + min(lane, last), now]
            call_law(
                entry, address_of(rows, 0), address_of(rows, n_place), address_of(rows, following),
                address_of(numbers, 0), step,
            )  # fmt: skip
            for k in range(n_state):
                for lane in range(LANES):
                    memory[n_place + k, lane] = memory[following + k, lane]
            if sample >= 0:
                for i in range(outputs.shape[0]):
                    for lane in range(last + 1):
                        outputs[i, block + lane, now] = memory[n_input + i, lane]
        for lane in range(last + 1):
            for k in range(n_state):
                state[block + lane, k] = memory[n_place + k, lane]
