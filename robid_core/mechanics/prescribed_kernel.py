"""The compiled steps of prescribed motion: motors move as told, the rest follows, and out comes the torque.

The step is that of `integrator.hold_torque` by the linearly implicit midpoint rule, with the motors' accelerations
given and their torques asked for: the other coordinates are solved, the motors' rows then tell what was missing.
"""

from __future__ import annotations

import numpy as np

from robid_core.compiled.kernel import fused_kernel, kernel
from robid_core.compiled.views import lane_view, row_of
from robid_core.mechanics.closed_loop import (
    note_diverged,
    plant_views,
    scatter,
    state_views,
    step_views,
    term_views,
)
from robid_core.mechanics.integrator import (
    add_forces,
    advance_laws,
    assemble_arm,
    complete_forces,
    eliminate_free,
    pass_torque,
)
from robid_core.mechanics.recursion import chain_views, work_views


@fused_kernel
def hold_motion(chain, plant, terms, chain_work, work, state, given, mean, step):  # type: ignore[no-untyped-def]
    """Advance by one sample under given motor accelerations, (n_step, n_axis); `mean` gets the torques that takes."""
    position, speed, acceleration, law_state = (
        state.position,
        state.speed,
        state.acceleration,
        state.law_state,
    )
    middle, middle_speed, spring, right = work.middle, work.middle_speed, work.spring, work.right
    system, fill, torque = work.system, plant.fill, work.command
    n, n_axis, n_term = right.shape[0], torque.shape[0], terms.force.shape[0]
    n_free, half, share = n - n_axis, 0.5 * step, 1.0 / given.shape[0]
    for a in range(n_axis):
        mean[a] = 0.0
    for part in range(given.shape[0]):
        for i in range(n):
            v = speed[i] + half * acceleration[i]
            middle_speed[i] = v
            middle[i] = position[i] + 0.5 * half * (speed[i] + v)
            spring[i], right[i] = position[i] + half * speed[i], speed[i]
        if n_term > 0:
            for i in range(n):
                work.start[i] = position[i]
        force = row_of(work.stage, 0)
        for i in range(n):
            moment = 0.0 * middle[0]
            for e in range(plant.spring_start[i], plant.spring_start[i + 1]):
                j = plant.spring_column[e]
                moment = moment - (plant.spring_value[e, 0] * spring[j] + plant.spring_value[e, 1] * right[j])
            force[i] = moment
        # A rigid gear passes the motor's torque less what its rotor takes: those of the step before.
        pass_torque(plant, terms, work, torque, law_state, acceleration, step, step, False)
        for a in range(n_axis):
            i = n_free + a
            system[i, i] = plant.constant[i, i]
            for e in range(1, fill[a, 0] + 1):
                system[i, fill[a, e]] = plant.constant[i, fill[a, e]]
        add_forces(plant, terms, work, law_state, force, half, step, False)
        assemble_arm(chain, plant, chain_work, work, force)
        for t in range(n_term):
            first, last = terms.force[t, 6], terms.force[t, 7]
            for e in range(first, last):
                i = terms.column[e]
                for f in range(first, e + 1):
                    j = terms.column[f]
                    system[i, j] = system[i, j] + terms.value[e] * terms.value[f] * work.slope[t]
        for a in range(n_axis):
            i = n_free + a
            torque[a] = system[i, i] * given[part, a] - right[i]
        for a in range(n_axis):
            i = n_free + a
            for e in range(1, fill[a, 0] + 1):
                j = fill[a, e]
                if j < n_free:
                    right[j] = right[j] - system[i, j] * given[part, a]
                else:
                    torque[a] = torque[a] + system[i, j] * given[part, j - n_free]
                    torque[j - n_free] = torque[j - n_free] + system[i, j] * given[part, a]
        eliminate_free(system, right, work.pivot, n_free)
        for a in range(n_axis):
            i = n_free + a
            right[i] = given[part, a]
            for e in range(1, fill[a, 0] + 1):
                j = fill[a, e]
                if j < n_free:
                    torque[a] = torque[a] + system[i, j] * right[j]
        complete_forces(terms, work, right)
        for i in range(n):
            acceleration[i] = right[i]
            position[i] = position[i] + step * (speed[i] + half * right[i])
            speed[i] = speed[i] + step * right[i]
        advance_laws(terms, work, law_state, position, step)
        for a in range(n_axis):
            mean[a] = mean[a] + share * torque[a]


@kernel
def run_prescribed(  # type: ignore[no-untyped-def]
    arrays,
    numbers,
    work,
    state,
    motion,
    experiment,
    n_step,
    sample_time,
    outputs,
    single,
    own,
    first_block,
    last_block,
):
    """Run blocks first_block to last_block - 1.

    `single` is None where a block is one lane; `own` is None where each block is of one robot, else each lane has
    numbers of its own. `numbers` tells which set of numbers in `arrays` each block takes, (n_block,), `experiment`
    which row of `motion` moves each lane, (n_lane,). `motion` holds the motors' accelerations in the steps of some
    samples, (n_exp, n_sample * n_step, n_axis), and begins again where `outputs` take more; torques are means over a
    sample.
    """
    chain_work, step_work = work_views(work.chain, single), step_views(work.step, single)
    n_axis, width, step = motion.shape[2], state.position.shape[2], sample_time / n_step
    given, mean = np.zeros((n_step, n_axis, width)), np.zeros((n_axis, width))
    given_view, mean_view, command = lane_view(given, single), lane_view(mean, single), work.step.command
    motors = state.position.shape[1] - n_axis
    for block in range(first_block, last_block):
        chain = chain_views(arrays.chain, numbers[block], own)
        plant = plant_views(arrays.plant, numbers[block], own)
        terms = term_views(arrays.terms, numbers[block], own)
        first_lane = block * width
        position, speed = state.position[block], state.speed[block]
        views = state_views(state, block, single)
        for a in range(n_axis):  # an assignment of arrays would compile a message about their shapes: seconds
            for lane in range(width):
                command[a, lane] = state.holding_torque[block, a, lane]
        for sample in range(outputs.torque.shape[1]):
            scatter(outputs.position, position[motors:], first_lane, sample)
            scatter(outputs.coordinates, position, first_lane, sample)
            begin = sample * n_step % motion.shape[1]
            for lane in range(width):
                row = experiment[min(first_lane + lane, experiment.shape[0] - 1)]
                for part in range(n_step):
                    for a in range(n_axis):
                        given[part, a, lane] = motion[row, begin + part, a]
            hold_motion(chain, plant, terms, chain_work, step_work, views, given_view, mean_view, step)
            scatter(outputs.torque, mean, first_lane, sample)
            if not note_diverged(outputs, position, speed, work.step.force, first_lane, sample):
                break
