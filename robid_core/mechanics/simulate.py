"""Closed-loop simulation of many experiments: the robot under a cascade of position, speed and torque.

Torque is held from one sampling instant to the next; position is sampled at the instant, before the torque that
it causes. Each lane is one experiment, computed alone, so that results do not depend on what runs beside it.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from robid_core.errors import ConfigurationError, NotTrustworthy
from robid_core.mechanics.chain import FloatArray, IntArray
from robid_core.mechanics.equilibrium import solve_equilibrium
from robid_core.mechanics.integrator import run_lanes
from robid_core.mechanics.layout import (
    ControlArrays,
    LaneState,
    PlantArrays,
    Signals,
    motors_last,
    plant_arrays,
    step_work,
)
from robid_core.mechanics.mechanism import Mechanism

Method = Literal["implicit_midpoint", "runge_kutta"]


@dataclass(frozen=True)
class Controller:
    """Cascade controller of each axis, motor side, every field of shape (n_axis,).

    error = speed_feedforward * speed reference + position_gain * (position reference - measured position)
    - measured speed; torque = speed_gain * error + integral, within the limit. The measured speed is the difference
    of the measured positions over the sampling time.
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


@dataclass(frozen=True)
class Friction:
    """Friction at the motor shafts, coulomb tanh(v / speed) + viscous v + offset, every field of shape (n_axis,)."""

    coulomb: FloatArray
    """N m."""
    viscous: FloatArray
    """N m s/rad."""
    speed: FloatArray
    """rad/s, > 0; below coulomb * step / rotor inertia a motor that comes to rest rattles at that speed."""
    offset: FloatArray
    """Constant torque that the motor works against whatever its speed, N m; a rest state does not hold it."""


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
    """Of the position controllers, rad, (n_lane, n_axis)."""
    measured: FloatArray
    """Measured position at the last instant, rad, (n_lane, n_axis)."""
    holding_torque: FloatArray
    """Constant part of the motor torque, N m, (n_lane, n_axis)."""


@dataclass(frozen=True)
class Simulation:
    """What the drives would sample."""

    position: FloatArray
    """Measured motor angle, rad, (n_lane, n_sample, n_axis)."""
    torque: FloatArray
    """Measured motor torque, held from this instant to the next, N m, (n_lane, n_sample, n_axis)."""
    saturated: FloatArray
    """Share of samples at the torque limit, (n_lane, n_axis)."""
    coordinates: FloatArray | None
    """True generalised coordinates where they were asked for, (n_lane, n_sample, n_coordinate)."""
    state: SimulationState
    """After the last sample; a run can go on from it."""


def rest_state(mechanism: Mechanism, stiffness: FloatArray, motor_angle: FloatArray) -> SimulationState:
    """State of robots that stand still at these motor angles (n_lane, n_axis), gravity held."""
    angle = np.atleast_2d(np.asarray(motor_angle, dtype=np.float64))
    rest = solve_equilibrium(mechanism, stiffness, angle)
    still, none = np.zeros_like(rest.position), np.zeros_like(angle)
    return SimulationState(rest.position, still, still, none, angle, angle, rest.torque)


def simulate(
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    controller: Controller,
    friction: Friction,
    state: SimulationState,
    speed_reference: FloatArray,
    *,
    position_reference: FloatArray | None = None,
    torque_feedforward: FloatArray | None = None,
    position_noise: FloatArray | None = None,
    torque_noise: FloatArray | None = None,
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
    controller, friction
        Of the motors.
    state
        Where each lane starts: `rest_state`, or the state another run ended in.
    speed_reference
        Motor speed, rad/s, shape (n_lane, n_sample, n_axis).
    position_reference
        Motor angle, rad, same shape; left out, it is the integral of the speed reference.
    torque_feedforward
        Added to the controller's torque before the limit, N m, same shape.
    position_noise, torque_noise
        Added to what is measured, rad and N m, same shape; position noise acts through the controller too,
        torque noise does not act.
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
    NotTrustworthy
        Where a lane leaves all bounds; the message names lane and time.
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

    saturated = np.zeros((n_lane, n_axis), dtype=np.int64)
    diverged = np.full(n_lane, -1, dtype=np.int64)
    signals = Signals(
        wanted,
        signal(position_reference, "position_reference"),
        signal(torque_feedforward, "torque_feedforward"),
        signal(position_noise, "position_noise"),
        signal(torque_noise, "torque_noise"),
        np.zeros(wanted.shape),
        np.zeros(wanted.shape),
        np.zeros((n_lane, n_sample, n) if keep_coordinates else (0, 0, 0)),
        saturated,
        diverged,
    )
    order = motors_last(mechanism)
    lanes = LaneState(*(_rows(state, field.name, n_lane, n_axis, order) for field in fields(state)))
    gains = np.column_stack([_axes(controller, field.name, n_axis) for field in fields(controller)])
    control = ControlArrays(np.ascontiguousarray(gains), float(sample_time), n_step, method == "runge_kutta")
    law = (
        _axes(friction, "coulomb", n_axis),
        _axes(friction, "viscous", n_axis),
        _axes(friction, "speed", n_axis),
        _axes(friction, "offset", n_axis),
    )
    if not (law[2] > 0).all():
        raise ConfigurationError(
            f"simulate: friction speed {law[2].min():.6g} rad/s; give a speed above zero"
        )
    plant = plant_arrays(mechanism, stiffness, damping, law, 0.0 if method == "runge_kutta" else step)
    _run(mechanism, plant, control, lanes, signals, max(1, min(n_thread, n_lane)))
    if (diverged >= 0).any():
        lane = int(np.flatnonzero(diverged >= 0)[0])
        raise NotTrustworthy(
            f"simulate: lane {lane} left all bounds at {diverged[lane] * sample_time:.3f} s; is a controller gain too "
            "high, or the step too long for an explicit method?"
        )
    back = np.argsort(order)
    return Simulation(
        signals.position,
        signals.torque,
        saturated / max(n_sample, 1),
        signals.coordinates[..., back] if keep_coordinates else None,
        SimulationState(
            **{name: value[:, back] if name in _ALL else value for name, value in lanes._asdict().items()}
        ),
    )


def _run(
    mechanism: Mechanism,
    plant: PlantArrays,
    control: ControlArrays,
    lanes: LaneState,
    signals: Signals,
    n_thread: int,
) -> None:
    edges = np.linspace(0, len(lanes.position), n_thread + 1).round().astype(int).tolist()

    def share(first: int, last: int) -> None:
        run_lanes(plant, step_work(mechanism), control, lanes, signals, first, last)

    if n_thread == 1:
        share(*edges)
        return
    with ThreadPoolExecutor(n_thread) as pool:
        list(pool.map(share, edges[:-1], edges[1:]))


_ALL = ("position", "speed", "acceleration")  # fields of the state that hold every coordinate


def _rows(state: SimulationState, name: str, n_lane: int, n_axis: int, order: IntArray) -> FloatArray:
    value = np.asarray(getattr(state, name), dtype=np.float64)
    shape = (n_lane, len(order) if name in _ALL else n_axis)
    if value.shape != shape:
        raise ConfigurationError(f"simulate: state.{name} has shape {value.shape}, expected {shape}")
    return np.array(value[:, order] if name in _ALL else value, order="C")


def _axes(values: Controller | Friction, name: str, n_axis: int) -> FloatArray:
    value = np.array(getattr(values, name), dtype=np.float64, order="C")
    signed = name == "offset"
    if value.shape != (n_axis,) or not np.isfinite(value).all() or ((value < 0).any() and not signed):
        bound = "" if signed else " >= 0"
        raise ConfigurationError(
            f"simulate: {name} needs {n_axis} finite numbers{bound}, one an axis; it is {value}"
        )
    return value
