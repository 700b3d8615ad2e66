"""The compiled closed loop: sampled controllers and sensors, the robot between their instants, by blocks of lanes."""

from __future__ import annotations

import numpy as np

from robid_core.compiled.kernel import kernel
from robid_core.compiled.lanes import like, where
from robid_core.compiled.views import lane_view, parameter_view, view_of
from robid_core.mechanics.integrator import act_on_signal, hold_torque
from robid_core.mechanics.mechanical_model import PlantArrays
from robid_core.mechanics.recursion import chain_views, work_views
from robid_core.mechanics.simulation_arrays import ControlArrays, LaneState, StepWork
from robid_core.mechanics.term_arrays import TermArrays
from robid_core.mechanics.terms import POSITION, TORQUE_MEASUREMENT

DIVERGED = 1e6  # rad, rad/s, m or m/s: no motor is there, a numerical explosion soon is


@kernel
def sample_controller(control, terms, work, state, inputs):  # type: ignore[no-untyped-def]
    """Measure, and turn speed references into torque commands; `inputs` are the buffers of `run_blocks`.

    Under a voltage (back EMF above zero) the speed brakes the motor at every instant (`work.braking`), and not through
    the controller; the command is the torque of the stalled motor.
    """
    gains, sample_time = control.gains, control.sample_time
    wanted, aim, feedforward, noise, reported_noise, measured_out, torque_out, saturated, enabled, has = (
        inputs
    )
    n_axis = gains.shape[0]
    motor = state.position.shape[0] - n_axis
    for a in range(n_axis):
        measured = state.position[motor + a]
        if terms.signal.shape[0] > 0:
            measured = act_on_signal(
                terms, work, state.law_state, POSITION, a, measured, measured, state.speed[motor + a], sample_time,
                sample_time, True,
            )  # fmt: skip
        measured = measured + noise[a]
        if gains[a, 5] > 0.0:
            measured = np.rint(measured / gains[a, 5]) * gains[a, 5]
        before, reference = state.measured[a], state.reference[a]
        measured_speed = (measured - where(before == before, before, measured)) / sample_time
        state.measured[a] = measured
        state.reference[a] = where(reference == reference, reference, measured)
        if has[0]:
            state.reference[a] = aim[a]
        cascade = 0.0 if gains[a, 6] > 0.0 else 1.0
        error = (
            gains[a, 3] * wanted[a] + gains[a, 2] * (state.reference[a] - measured) - cascade * measured_speed
        )
        state.reference[a] = state.reference[a] + sample_time * wanted[a]
        state.integral[a] = state.integral[a] + gains[a, 1] * sample_time * error
        held = state.integral[a] + state.holding_torque[a]
        demand = gains[a, 0] * error + cascade * held + feedforward[a]
        limit = gains[a, 4]
        saturated[a] = saturated[a] + where(abs(demand) >= limit, 1.0, 0.0)
        demand = where(demand > limit, limit, demand)
        demand = where(demand < -limit, -limit, demand)
        braking = like(measured, gains[a, 6])
        if has[1]:
            demand, braking = enabled[a] * demand, enabled[a] * gains[a, 6]
            state.integral[a] = enabled[a] * state.integral[a]
        work.command[a], work.braking[a] = demand, braking
        measured_out[a] = measured
        demand = demand - braking * state.speed[motor + a]
        reported = demand
        if terms.signal.shape[0] > 0:
            reported = act_on_signal(
                terms, work, state.law_state, TORQUE_MEASUREMENT, a, demand, measured, measured_speed, sample_time,
                sample_time, True,
            )  # fmt: skip
        torque_out[a] = reported + reported_noise[a]


@kernel
def gather(buffer, signal, first_lane, sample):  # type: ignore[no-untyped-def]
    """Copy one sample of a block of lanes into a buffer (n_axis, width); the last lane fills up the block."""
    if signal.shape[0] == 0:
        return
    for a in range(buffer.shape[0]):
        for lane in range(buffer.shape[1]):
            buffer[a, lane] = signal[min(first_lane + lane, signal.shape[0] - 1), sample, a]


@kernel
def scatter(signal, buffer, first_lane, sample):  # type: ignore[no-untyped-def]
    """Copy a buffer (n, width) into one sample of a block of lanes."""
    if signal.shape[0] == 0:
        return
    for a in range(signal.shape[2]):
        for lane in range(min(buffer.shape[1], signal.shape[0] - first_lane)):
            signal[first_lane + lane, sample, a] = buffer[a, lane]


@kernel
def note_diverged(signals, position, speed, force, first_lane, sample):  # type: ignore[no-untyped-def]
    """Note the lanes of a block that left all bounds; return whether one is still inside."""
    alive = False
    for lane in range(min(position.shape[1], signals.diverged.shape[0] - first_lane)):
        total = 0.0
        for i in range(position.shape[0]):
            total += abs(position[i, lane]) + abs(speed[i, lane])
        if signals.diverged[first_lane + lane] >= 0:
            continue
        if total < DIVERGED:
            alive = True
        else:
            signals.diverged[first_lane + lane] = sample
            for t in range(signals.force.shape[1]):
                signals.force[first_lane + lane, t] = force[t, lane]
    return alive


@kernel
def run_blocks(arrays, work, control, state, signals, single, first_block, last_block):  # type: ignore[no-untyped-def]
    """Run blocks first_block to last_block - 1 over all samples; `single` is None where a block is one lane."""
    chain = chain_views(arrays.chain, 0, None)
    plant = plant_views(arrays.plant, 0, None)
    terms = term_views(arrays.terms, 0, None)
    chain_work, step_work = work_views(work.chain, single), step_views(work.step, single)
    clock = ControlArrays(view_of(control.gains), control.sample_time, control.n_step, control.runge_kutta)
    n_axis, width = control.gains.shape[0], state.position.shape[2]
    step = control.sample_time / control.n_step
    buffers = np.zeros((9, n_axis, width))
    has = np.zeros(2, dtype=np.int64)
    has[0], has[1] = signals.position_reference.shape[0], signals.enabled.shape[0]
    wanted, aim, feedforward, noise = buffers[0], buffers[1], buffers[2], buffers[3]
    reported_noise, measured, torque, saturated, enabled = (
        buffers[4],
        buffers[5],
        buffers[6],
        buffers[7],
        buffers[8],
    )
    inputs = (
        lane_view(wanted, single), lane_view(aim, single), lane_view(feedforward, single), lane_view(noise, single),
        lane_view(reported_noise, single), lane_view(measured, single), lane_view(torque, single),
        lane_view(saturated, single), lane_view(enabled, single), view_of(has),
    )  # fmt: skip
    for block in range(first_block, last_block):
        first_lane = block * width
        position, speed = state.position[block], state.speed[block]
        views = state_views(state, block, single)
        saturated[:] = 0.0
        for sample in range(signals.speed_reference.shape[1]):
            gather(wanted, signals.speed_reference, first_lane, sample)
            gather(aim, signals.position_reference, first_lane, sample)
            gather(feedforward, signals.torque_feedforward, first_lane, sample)
            gather(noise, signals.position_noise, first_lane, sample)
            gather(reported_noise, signals.torque_noise, first_lane, sample)
            gather(enabled, signals.enabled, first_lane, sample)
            sample_controller(clock, terms, step_work, views, inputs)
            scatter(signals.position, measured, first_lane, sample)
            scatter(signals.torque, torque, first_lane, sample)
            scatter(signals.coordinates, position, first_lane, sample)
            hold_torque(
                chain, plant, terms, chain_work, step_work, views, step, control.n_step, control.runge_kutta
            )
            if not note_diverged(signals, position, speed, work.step.force, first_lane, sample):
                break
        for lane in range(min(width, signals.saturated.shape[0] - first_lane)):
            for a in range(n_axis):
                signals.saturated[first_lane + lane, a] = int(saturated[a, lane])


@kernel
def plant_views(plant, numbers, own):  # type: ignore[no-untyped-def]
    """Views of the arrays of a plant, of one set of numbers; `own` as of `parameter_view`."""
    return PlantArrays(
        view_of(plant.joint_column), parameter_view(plant.joint_value[numbers], own), view_of(plant.spring_start),
        view_of(plant.spring_column), parameter_view(plant.spring_value[numbers], own),
        parameter_view(plant.constant[numbers], own), view_of(plant.coupled), view_of(plant.fill),
        view_of(plant.gear_column), parameter_view(plant.gear_value[numbers], own),
        parameter_view(plant.gear_spring[numbers], own), view_of(plant.rigid_column),
        parameter_view(plant.rigid_value[numbers], own), parameter_view(plant.rotor_inertia[numbers], own),
    )  # fmt: skip


@kernel
def term_views(terms, numbers, own):  # type: ignore[no-untyped-def]
    """Views of the arrays of laws, of one set of numbers; `own` as of `parameter_view`."""
    return TermArrays(
        view_of(terms.force), view_of(terms.signal), view_of(terms.column), parameter_view(terms.value[numbers], own),
        view_of(terms.argument[numbers]), parameter_view(terms.weight[numbers], own), view_of(terms.loads),
    )  # fmt: skip


@kernel
def state_views(state, block, single):  # type: ignore[no-untyped-def]
    """Views of the states of one block of lanes."""
    return LaneState(
        lane_view(state.position[block], single), lane_view(state.speed[block], single),
        lane_view(state.acceleration[block], single), lane_view(state.integral[block], single),
        lane_view(state.reference[block], single), lane_view(state.measured[block], single),
        lane_view(state.holding_torque[block], single), lane_view(state.law_state[block], single),
    )  # fmt: skip


@kernel
def step_views(work, single):  # type: ignore[no-untyped-def]
    """Views of the memory of one step."""
    return StepWork(
        lane_view(work.joint, single), lane_view(work.joint_speed, single), lane_view(work.middle, single),
        lane_view(work.middle_speed, single), lane_view(work.spring, single), lane_view(work.start, single),
        lane_view(work.right, single), lane_view(work.pivot, single), lane_view(work.system, single),
        lane_view(work.stage, single), lane_view(work.torque, single), lane_view(work.command, single),
        lane_view(work.braking, single), lane_view(work.load, single), lane_view(work.force, single),
        lane_view(work.slope, single), lane_view(work.place, single), lane_view(work.next_state, single),
    )  # fmt: skip
