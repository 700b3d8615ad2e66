"""Closed-loop simulation of many experiments: the robot under a cascade of position, speed and torque.

Torque is held from one sampling instant to the next; position is sampled at the instant, before the torque that
it causes. Each lane is one experiment, computed alone, so that results do not depend on what runs beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.compiled.lanes import LANES
from robid_core.errors import ConfigurationError, NotTrustworthy
from robid_core.mechanics.closed_loop import run_blocks
from robid_core.mechanics.display import simulation_html, simulation_text
from robid_core.mechanics.equilibrium import solve_equilibrium
from robid_core.mechanics.mechanical_model import MechanicalModel, motors_last
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.simulation_arrays import (
    Arrays,
    ControlArrays,
    LaneState,
    Signals,
    robot_arrays,
    work_memory,
)
from robid_core.mechanics.terms import ForceTerm, SignalTerm

Method = Literal["implicit_midpoint", "runge_kutta"]


@dataclass(frozen=True)
class Controller:
    """Cascade controller of each axis, motor side, every field of shape (n_axis,).

    error = speed_feedforward * speed reference + position_gain * (position reference - measured position)
    - measured speed; torque = speed_gain * error + integral, within the limit. The measured speed is the difference
    of the measured positions over the sampling time. A drive that sets a voltage has a back EMF: its command has no
    measured speed, integral and holding torque in it, and is the torque of the stalled motor; the motor gives that less
    back_emf * speed, at every instant.
    """

    speed_gain: FloatArray
    """N m s/rad."""
    integral_gain: FloatArray
    """Torque per integrated speed error, N m/rad."""
    position_gain: FloatArray
    """1/s."""
    speed_feedforward: FloatArray
    """1: the speed reference counts in full; 0: it acts through the position only."""
    torque_limit: FloatArray
    """N m."""
    encoder_step: FloatArray
    """Angle of one encoder count, rad; 0 measures without steps."""
    back_emf: FloatArray | None = None
    """Torque lost per speed, torque constant squared over resistance, N m s/rad; 0 or None: the drive sets a torque."""


class SimulationDiverged(NotTrustworthy):
    """A simulation left all bounds; `partial` holds what was computed, NaN behind the instant where it did."""

    def __init__(self, message: str, partial: Simulation) -> None:
        super().__init__(message)
        self.partial = partial


@dataclass(frozen=True)
class SimulationState:
    """Robot and controllers at a sampling instant, every field of shape (n_lane, ...)."""

    position: FloatArray
    """Generalised coordinates, (n_lane, n_coordinate)."""
    speed: FloatArray
    """(n_lane, n_coordinate)."""
    acceleration: FloatArray
    """Of the last step, (n_lane, n_coordinate)."""
    integral: FloatArray
    """Of the speed controllers, N m, (n_lane, n_axis)."""
    reference: FloatArray
    """Of the position controllers, rad, (n_lane, n_axis); NaN: what the first sample measures."""
    measured: FloatArray
    """Measured position at the last instant, rad, (n_lane, n_axis); NaN: nothing was measured yet."""
    holding_torque: FloatArray
    """Constant part of the motor torque, N m, (n_lane, n_axis)."""
    law_state: FloatArray
    """States of the laws, forces before signals, (n_lane, n_state)."""

    def moving(self, mechanism: Mechanism, motor_speed: FloatArray) -> SimulationState:
        """Return the state with these motor speeds (n_lane, n_axis), no spring changing its deflection."""
        rate = np.zeros((mechanism.chain.n_coordinate, mechanism.n_axis))
        rate[mechanism.arm] = mechanism.gear
        free = [mechanism.chain.index(name) for name in mechanism.coordinate_names[mechanism.n_axis :]]
        return replace(self, speed=np.concatenate((motor_speed, motor_speed @ rate[free].T), axis=1))


@dataclass(frozen=True, repr=False)
class Simulation:
    """What the drives would sample."""

    position: FloatArray
    """Measured motor angle, rad, (n_lane, n_sample, n_axis)."""
    torque: FloatArray
    """Measured motor torque, N m, (n_lane, n_sample, n_axis): held from this instant to the next; of a motor
    under a voltage that at this instant."""
    saturated: FloatArray
    """Share of samples at the torque limit, (n_lane, n_axis)."""
    coordinates: FloatArray | None
    """True generalised coordinates where they were asked for, (n_lane, n_sample, n_coordinate)."""
    state: SimulationState
    """After the last sample; a run can go on from it."""

    def __repr__(self) -> str:
        return simulation_text(self.position, self.saturated)

    def _repr_html_(self) -> str:
        return simulation_html(self.position, self.torque, self.saturated)


def rest_state(
    mechanism: Mechanism,
    stiffness: FloatArray,
    motor_angle: FloatArray,
    forces: Sequence[ForceTerm] = (),
    signals: Sequence[SignalTerm] = (),
) -> SimulationState:
    """State of robots that stand still at these motor angles (n_lane, n_axis), gravity held."""
    angle = np.atleast_2d(np.asarray(motor_angle, dtype=np.float64))
    rest = solve_equilibrium(mechanism, stiffness, angle, forces)
    still, none = np.zeros_like(rest.position), np.zeros_like(angle)
    start = [np.zeros(term.n_state) for term in forces]
    start += [np.zeros(term.n_state) if term.initial is None else term.initial for term in signals]
    laws = np.tile(np.concatenate([np.zeros(0), *start]), (len(angle), 1))
    unknown = np.full_like(angle, np.nan)
    return SimulationState(rest.position, still, still, none, unknown, unknown, rest.torque, laws)


def simulate(
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    controller: Controller,
    state: SimulationState,
    speed_reference: FloatArray,
    *,
    forces: Sequence[ForceTerm] = (),
    signals: Sequence[SignalTerm] = (),
    position_reference: FloatArray | None = None,
    torque_feedforward: FloatArray | None = None,
    position_noise: FloatArray | None = None,
    torque_noise: FloatArray | None = None,
    enabled: FloatArray | None = None,
    sample_time: float = 1e-3,
    step: float = 2.5e-4,
    method: Method = "implicit_midpoint",
    keep_coordinates: bool = False,
    n_thread: int = 1,
) -> Simulation:
    """Closed-loop motion of n_lane robots from given states.

    Parameters
    ----------
    mechanism, stiffness, damping
        The robot; spring constants N m/rad and N m s/rad, shape (n_spring,).
    controller
        Of the motors.
    state
        Where each lane starts: `rest_state`, or the state another run ended in.
    speed_reference
        Motor speed, rad/s, shape (n_lane, n_sample, n_axis).
    forces, signals
        Laws that act, such as friction; the state must be of the same ones.
    position_reference
        Motor angle, rad, same shape; left out, it is the integral of the speed reference.
    torque_feedforward
        Added to the controller's torque before the limit, N m, same shape.
    position_noise, torque_noise
        Added to what is measured, rad and N m, same shape; position noise acts through the controller too,
        torque noise does not act.
    enabled
        1 where a drive is on, 0 where it is off and its motor coasts, same shape; by default all are on.
    sample_time, step
        Of controller and integration, s; the sample time is a whole number of steps.
    method
        "implicit_midpoint", or "runge_kutta" as a check.
    keep_coordinates
        Whether to return the true coordinates too.
    n_thread
        Lanes are dealt to that many threads; results do not depend on it.

    Raises
    ------
    SimulationDiverged
        Where a lane leaves all bounds; the message names lane, time, coordinate and effect.
    """
    mechanism.check_springs(stiffness=stiffness, damping=damping)
    if method not in ("implicit_midpoint", "runge_kutta"):
        raise ConfigurationError(f"simulate: no method '{method}'; there are implicit_midpoint, runge_kutta")
    n_step = round(sample_time / step)
    if n_step < 1 or abs(n_step * step - sample_time) > 1e-9 * sample_time:
        raise ConfigurationError(f"simulate: {sample_time} s is not a whole number of steps of {step} s")
    n_axis, n = mechanism.n_axis, mechanism.n_coordinate
    wanted = np.array(speed_reference, dtype=np.float64, order="C")
    if wanted.ndim != 3 or wanted.shape[2] != n_axis:
        raise ConfigurationError(
            f"simulate: speed reference of shape {wanted.shape}, expected (n_lane, n_sample, {n_axis})"
        )
    n_lane, n_sample = wanted.shape[:2]

    def signal(value: FloatArray | None, name: str) -> FloatArray:
        if value is None:
            return np.empty((0, 0, 0))
        if np.shape(value) != wanted.shape:
            raise ConfigurationError(f"simulate: {name} has shape {np.shape(value)}, expected {wanted.shape}")
        return np.array(value, dtype=np.float64, order="C")

    if n_lane == 0:
        raise ConfigurationError("simulate: no experiment; give at least one row of speed references")
    channels = Signals(
        wanted,
        signal(position_reference, "position_reference"),
        signal(torque_feedforward, "torque_feedforward"),
        signal(position_noise, "position_noise"),
        signal(torque_noise, "torque_noise"),
        signal(enabled, "enabled"),
        np.zeros(wanted.shape),
        np.zeros(wanted.shape),
        np.zeros((n_lane, n_sample, n) if keep_coordinates else (0, 0, 0)),
        np.zeros((n_lane, n_axis), dtype=np.int64),
        np.full(n_lane, -1, dtype=np.int64),
        np.zeros((n_lane, len(forces))),
    )
    width = LANES if n_lane >= FEWEST_LANES else 1
    lanes = lanes_of_state(state, mechanism, (*forces, *signals), n_lane, width)
    gains = np.column_stack([_axes(controller, field.name, n_axis) for field in fields(controller)])
    control = ControlArrays(np.ascontiguousarray(gains), float(sample_time), n_step, method == "runge_kutta")
    model, alone = (
        MechanicalModel(mechanism, stiffness, damping, tuple(forces)),
        np.zeros((1, 1), np.int64),
    )
    arrays, entries = robot_arrays([model], signals, alone, width, 0.0 if control.runge_kutta else step)
    _run(mechanism, arrays, control, lanes, channels, width, n_thread)
    del entries  # machine code of the laws, no longer called
    result = Simulation(
        channels.position,
        channels.torque,
        channels.saturated / max(n_sample, 1),
        channels.coordinates[..., np.argsort(motors_last(mechanism))] if keep_coordinates else None,
        state_of_lanes(lanes, mechanism, (*forces, *signals), n_lane),
    )
    if (channels.diverged >= 0).any():
        raise divergence(
            "simulate", mechanism, forces, result, channels.diverged, channels.force, sample_time
        )
    return result


FEWEST_LANES = 3  # from this many experiments on, all lanes at once are faster than one after the other
_ALL = ("position", "speed", "acceleration")  # fields of the state that hold every coordinate


def _run(
    mechanism: Mechanism,
    arrays: Arrays,
    control: ControlArrays,
    lanes: LaneState,
    channels: Signals,
    width: int,
    n_thread: int,
) -> None:
    def share(first: int, last: int) -> None:
        work = work_memory(mechanism, len(arrays.terms.force), lanes.law_state.shape[1], width)
        run_blocks(arrays, work, control, lanes, channels, None if width == 1 else width, first, last)

    deal(len(lanes.position), n_thread, share)


def deal(n_block: int, n_thread: int, share: Callable[[int, int], None]) -> None:
    """Deal blocks to threads: `share(first, last)` runs blocks first to last - 1."""
    n_thread = max(1, min(n_thread, n_block))
    edges = np.linspace(0, n_block, n_thread + 1).round().astype(int).tolist()
    if n_thread == 1:
        share(*edges)
        return
    with ThreadPoolExecutor(n_thread) as pool:
        list(pool.map(share, edges[:-1], edges[1:]))


def divergence(
    what: str,
    mechanism: Mechanism,
    forces: Sequence[ForceTerm],
    result: Simulation,
    diverged: IntArray,
    force_then: FloatArray,
    sample_time: float,
) -> SimulationDiverged:
    """Say when, where and by which effect a lane left all bounds; what was computed comes along.

    `diverged` holds the sample of each lane, -1 where it did not; `force_then` the laws' forces at that sample.
    """
    lost = np.flatnonzero(diverged >= 0).tolist()
    for lane in lost:
        for signal in (result.position, result.torque, result.coordinates):
            if signal is not None:
                signal[lane, diverged[lane] + 1 :] = np.nan
    lane = lost[0]
    largest = np.nan_to_num(
        np.abs(result.state.position[lane]) + np.abs(result.state.speed[lane]), nan=np.inf, posinf=np.inf
    )
    name = mechanism.coordinate_names[int(np.argmax(largest))]
    message = (
        f"{what}: lane {lane} left all bounds at {diverged[lane] * sample_time:.3f} s, "
        f"coordinate '{name}' first"
    )
    if len(forces):
        force = np.nan_to_num(np.abs(force_then[lane]), nan=np.inf, posinf=np.inf)
        worst = forces[int(np.argmax(force))]
        message += f"; the largest force of an effect there was {force.max():.3g} of '{worst.label}'"
    return SimulationDiverged(
        f"{message}; is a controller gain too high, a parameter of the effect wrong, or the step too long for an "
        "explicit method?",
        result,
    )


def lanes_of_state(
    state: SimulationState,
    mechanism: Mechanism,
    laws: Sequence[ForceTerm | SignalTerm],
    n_lane: int,
    width: int,
) -> LaneState:
    """Lay states out in blocks of `width` lanes, motors after the other coordinates."""
    order, sizes = motors_last(mechanism), _sizes(mechanism, laws)
    return LaneState(
        *(_blocks(state, f.name, n_lane, sizes[f.name], order, width) for f in fields(SimulationState))
    )


def state_of_lanes(
    lanes: LaneState, mechanism: Mechanism, laws: Sequence[ForceTerm | SignalTerm], n_lane: int
) -> SimulationState:
    """Return the states that stand in blocks of lanes."""
    back, sizes = np.argsort(motors_last(mechanism)), _sizes(mechanism, laws)
    return SimulationState(
        **{
            name: _lanes(value, n_lane, sizes[name])[:, back if name in _ALL else slice(None)]
            for name, value in lanes._asdict().items()
        }
    )


def _sizes(mechanism: Mechanism, laws: Sequence[ForceTerm | SignalTerm]) -> dict[str, int]:
    """Length of each field of a state."""
    sizes = dict.fromkeys((f.name for f in fields(SimulationState)), mechanism.n_axis)
    whole = dict.fromkeys(_ALL, mechanism.n_coordinate)
    return sizes | whole | {"law_state": sum(law.n_state for law in laws)}


def _blocks(
    state: SimulationState, name: str, n_lane: int, size: int, order: IntArray, width: int
) -> FloatArray:
    """Rows of a field as blocks of lanes (n_block, size, width); the last lane fills up the last block."""
    value = np.asarray(getattr(state, name), dtype=np.float64)
    if value.shape != (n_lane, size):
        hint = "; was the state made with the same laws?" if name == "law_state" else ""
        raise ConfigurationError(
            f"simulate: state.{name} has shape {value.shape}, expected {(n_lane, size)}{hint}"
        )
    if name in _ALL:
        value = value[:, order]
    n_block = -(-n_lane // width)
    value = value[np.minimum(np.arange(n_block * width), n_lane - 1)]
    blocks = np.zeros((n_block, max(size, 1), width))
    blocks[:, :size] = value.reshape(n_block, width, size).transpose(0, 2, 1)
    return blocks


def _lanes(blocks: FloatArray, n_lane: int, size: int) -> FloatArray:
    return np.ascontiguousarray(blocks.transpose(0, 2, 1).reshape(-1, blocks.shape[1])[:n_lane, :size])


def _axes(values: Controller, name: str, n_axis: int) -> FloatArray:
    given = getattr(values, name)
    value = np.zeros(n_axis) if given is None else np.array(given, dtype=np.float64, order="C")
    if value.shape != (n_axis,) or not np.isfinite(value).all() or (value < 0).any():
        raise ConfigurationError(
            f"simulate: {name} needs {n_axis} finite numbers >= 0, one an axis; it is {value}"
        )
    return value
