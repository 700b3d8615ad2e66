"""The compiled steps of the simulation: the robot under held torques, one experiment or all lanes at once.

The plant is ``M(z) z'' + c(z, z') + g(z) + sum_s e_s (k_s e_s^T z + d_s e_s^T z') + sum_l e_l f_l = B torque``
with laws
f_l of effects. *Linearly implicit midpoint* (a Rosenbrock method of order two): M, c and g at the extrapolated
midpoint, springs, dampers and the slopes of the laws implicit, one evaluation a step. It is stable for springs and
friction slopes far beyond the step's resolution. *Runge-Kutta* of order four, all explicit, is its check.

The functions work on views (`views`); the meaning of each array stands in `chain_arrays`, `mechanical_model`,
`term_arrays` and `simulation_arrays`.
"""

from __future__ import annotations

from robid_core.compiled.kernel import fused_kernel, kernel
from robid_core.compiled.lanes import where
from robid_core.compiled.views import address_of, call_law, row_of
from robid_core.mechanics.chain_arrays import ChainWork
from robid_core.mechanics.recursion import evaluate
from robid_core.mechanics.terms import TORQUE

TINY = 1e-24  # of a squared torque, N^2 m^2: below it a secant is flat
STANDSTILL = 1e-12  # of a squared speed, rad^2/s^2


@fused_kernel
def eliminate_free(system, right, pivot, n_free):  # type: ignore[no-untyped-def]
    """Solve the first n_free rows of system x = right in place, symmetric, lower triangle: U D U^T from below."""
    for k in range(n_free - 1, -1, -1):
        inverse = 1.0 / system[k, k]
        pivot[k] = inverse
        for i in range(k):
            factor = system[k, i] * inverse
            right[i] = right[i] - factor * right[k]
            for j in range(i + 1):
                system[i, j] = system[i, j] - factor * system[k, j]
    for k in range(n_free):
        right[k] = right[k] * pivot[k]
        for i in range(k + 1, n_free):
            right[i] = right[i] - system[i, k] * right[k]


@fused_kernel
def eliminate(system, right, pivot, fill):  # type: ignore[no-untyped-def]
    """Solve system x = right in place, symmetric, lower triangle: U D U^T from the last coordinate up."""
    n, n_axis = right.shape[0], fill.shape[0]
    n_free = n - n_axis
    for a in range(n_axis - 1, -1, -1):
        k = n_free + a
        inverse = 1.0 / system[k, k]
        pivot[k] = inverse
        for e in range(1, fill[a, 0] + 1):
            i = fill[a, e]
            factor = system[k, i] * inverse
            right[i] = right[i] - factor * right[k]
            for f in range(1, e + 1):
                j = fill[a, f]
                system[i, j] = system[i, j] - factor * system[k, j]
    eliminate_free(system, right, pivot, n_free)
    for a in range(n_axis):
        k = n_free + a
        total = right[k]
        for e in range(1, fill[a, 0] + 1):
            total = total - system[k, fill[a, e]] * right[fill[a, e]]
        right[k] = total * pivot[k]


@fused_kernel
def along(terms, first, last, values):  # type: ignore[no-untyped-def]
    """Scalar product of entries first to last - 1 of the terms' sparse rows with values."""
    total = 0.0 * values[0]
    for e in range(first, last):
        total = total + terms.value[e] * values[terms.column[e]]
    return total


@fused_kernel
def act_on_signal(  # type: ignore[no-untyped-def]
    terms, work, law_state, channel, axis, signal, angle, speed, step, stateless_step, keep
):
    """Send a signal of one axis through the laws on a channel, in their order; where `keep`, their states move on.

    Laws without a state are asked for their mean over `stateless_step`: nothing in the stages of Runge-Kutta.
    """
    place, next_state = work.place, work.next_state
    for t in range(terms.signal.shape[0]):
        if terms.signal[t, 5] != channel or terms.signal[t, 4] != axis:
            continue
        n_state, first, argument = terms.signal[t, 1], terms.signal[t, 2], terms.signal[t, 3]
        place[0], place[1], place[2] = signal, angle, speed
        call_law(
            terms.signal[t, 0], address_of(place, 0), address_of(law_state, first), address_of(next_state, 0),
            address_of(terms.argument, argument), step if n_state > 0 else stateless_step,
        )  # fmt: skip
        if keep:
            for k in range(n_state):
                law_state[first + k] = next_state[k]
        signal = place[3]
    return signal


@fused_kernel
def pass_torque(  # type: ignore[no-untyped-def]
    plant, terms, work, command, law_state, acceleration, step, stateless_step, keep
):
    """Acting motor torques from the held commands, braked at the midpoint, and those that the transmissions pass."""
    n_axis = command.shape[0]
    middle, middle_speed, torque, load = work.middle, work.middle_speed, work.torque, work.load
    motor = middle.shape[0] - n_axis
    for a in range(n_axis):
        torque[a] = command[a]
        if terms.signal.shape[0] > 0:
            angle, speed = middle[motor + a], middle_speed[motor + a]
            torque[a] = act_on_signal(
                terms, work, law_state, TORQUE, a, command[a], angle, speed, step, stateless_step, keep
            )
        torque[a] = torque[a] - work.braking[a] * middle_speed[motor + a]
    if terms.loads[0]:
        for a in range(n_axis):
            deflection, rate = 0.0 * middle[0], 0.0 * middle[0]
            for e in range(plant.gear_column.shape[1]):
                i = plant.gear_column[a, e]
                deflection = deflection + plant.gear_value[a, e] * middle[i]
                rate = rate + plant.gear_value[a, e] * middle_speed[i]
            passed = plant.gear_spring[a, 0] * deflection + plant.gear_spring[a, 1] * rate
            for e in range(plant.rigid_column.shape[1]):
                b = plant.rigid_column[a, e]
                driving = torque[b] - plant.rotor_inertia[b] * acceleration[motor + b]
                for t in range(terms.force.shape[0]):
                    if terms.force[t, 10] == b:  # as it acted in the step before
                        driving = driving - work.force[t]
                passed = passed + plant.rigid_value[a, e] * driving
            load[a] = passed


@fused_kernel
def ask_law(terms, work, law_state, t, load, step):  # type: ignore[no-untyped-def]
    """Ask a law for its force at the position and speed in `work.place`, and at a load."""
    work.place[2] = load
    call_law(
        terms.force[t, 0], address_of(work.place, 0), address_of(law_state, terms.force[t, 2]),
        address_of(work.next_state, 0), address_of(terms.argument, terms.force[t, 3]), step,
    )  # fmt: skip
    return work.place[3]


@kernel
def better_guess(guess, answer, other, answer_to_other):  # type: ignore[no-untyped-def]
    """Fixed point of a falling function by the secant through two answers; of a rising one the answer itself."""
    apart = other - guess
    slope = (answer_to_other - answer) * apart / (apart * apart + TINY)
    return where(slope < 0.0, guess + (answer - guess) / (1.0 - slope), answer)


@fused_kernel
def own_part(plant, terms, t):  # type: ignore[no-untyped-def]
    """Part of a law's force on a motor that is missing in the load the law sees: nothing behind an elastic gear."""
    part = 0.0 * terms.value[0]
    for e in range(terms.force[t, 8], terms.force[t, 9]):
        a = terms.column[e]
        for f in range(plant.rigid_column.shape[1]):
            if plant.rigid_column[a, f] == terms.force[t, 10]:
                part = part + terms.value[e] * plant.rigid_value[a, f]
    return part


@kernel
def brake_under_load(terms, work, law_state, t, load, part, step):  # type: ignore[no-untyped-def]
    """Friction F of a motor before a rigid gear that grows with the load, of which it takes its own part.

    The load that the friction before left is known: ``F = law(load - part (F - before))``. Where friction holds
    against the drive, more of it leaves less load, and two secants find the root; with the load of the step before it
    would swing where ``dF/dT`` is above ``(J + I) / I``, and leave all bounds. Where the arm drives the motor, more
    friction is more load, and there may be no root: the motor jams. Then the answer to the load as it was stops it, for
    which the slope in speed is at least that of a line through standstill.
    """
    place, before = work.place, work.force[t]
    first = ask_law(terms, work, law_state, t, load, step)
    second = ask_law(terms, work, law_state, t, load - part * (first - before), step)
    holds = (second - first) * (first - before) < 0.0
    root = better_guess(before, first, first, second)
    third = ask_law(terms, work, law_state, t, where(holds, load - part * (root - before), load), step)
    force = where(holds, better_guess(root, third, first, second), third)
    to_standstill = force * place[1] / (place[1] * place[1] + STANDSTILL)
    place[5] = where(to_standstill > place[5], to_standstill, place[5])
    return force


@fused_kernel
def add_forces(plant, terms, work, law_state, stage, half, step, driven):  # type: ignore[no-untyped-def]
    """Add the laws' forces to `stage`, linearised about the extrapolated midpoint, and keep what their slopes add.

    ``x_mid = (spring . e) + weight e . a`` and ``v_mid = (right . e) + half e . a`` with the acceleration a of
    the step. `driven`: torques are given and motion follows, so that a motor's friction takes its part of the load.
    """
    place, load = work.place, work.load
    for t in range(terms.force.shape[0]):
        first, middle, last, end = terms.force[t, 6], terms.force[t, 7], terms.force[t, 8], terms.force[t, 9]
        position = along(terms, middle, last, work.middle)
        velocity = along(terms, middle, last, work.middle_speed)
        place[0], place[1] = position, velocity
        passed = along(terms, last, end, load)
        if driven and terms.loads[0] and terms.force[t, 10] >= 0 and end > last:
            force = brake_under_load(terms, work, law_state, t, passed, own_part(plant, terms, t), step)
        else:
            force = ask_law(terms, work, law_state, t, passed, step)
        if terms.force[t, 5] >= 0 and terms.loads[0]:
            load[terms.force[t, 5]] = load[terms.force[t, 5]] + force
        if terms.force[t, 4] and half > 0.0:
            force = force + place[4] * (along(terms, middle, last, work.spring) - position)
            force = force + place[5] * (along(terms, middle, last, work.right) - velocity)
            work.slope[t] = terms.weight[t] * place[4] + half * place[5]
        else:
            work.slope[t] = 0.0 * force
        work.force[t] = force
        for e in range(first, middle):
            i = terms.column[e]
            stage[i] = stage[i] - terms.value[e] * force


@fused_kernel
def complete_forces(terms, work, acceleration):  # type: ignore[no-untyped-def]
    """Add to the laws' forces what the step's acceleration does to them: those that acted, not those extrapolated."""
    for t in range(terms.force.shape[0]):
        turned = along(terms, terms.force[t, 7], terms.force[t, 8], acceleration)
        work.force[t] = work.force[t] + work.slope[t] * turned


@fused_kernel
def advance_laws(terms, work, law_state, position, step):  # type: ignore[no-untyped-def]
    """Move the states of laws on by one step, at the motion that the step turned out to have."""
    place, next_state = work.place, work.next_state
    for t in range(terms.force.shape[0]):
        n_state, first_state, argument = terms.force[t, 1], terms.force[t, 2], terms.force[t, 3]
        if n_state == 0:
            continue
        middle, last, end = terms.force[t, 7], terms.force[t, 8], terms.force[t, 9]
        before, after = along(terms, middle, last, work.start), along(terms, middle, last, position)
        place[0], place[1] = 0.5 * (before + after), (after - before) / step
        place[2] = along(terms, last, end, work.load)
        call_law(
            terms.force[t, 0], address_of(place, 0), address_of(law_state, first_state),
            address_of(next_state, 0), address_of(terms.argument, argument), step,
        )  # fmt: skip
        for k in range(n_state):
            law_state[first_state + k] = next_state[k]


@fused_kernel
def add_constant(plant, system):  # type: ignore[no-untyped-def]
    """Add springs and dampers, as the implicit step has them, between coordinates behind the motors."""
    for e in range(plant.coupled.shape[0]):
        i, j = plant.coupled[e, 0], plant.coupled[e, 1]
        system[i, j] = system[i, j] + plant.constant[i, j]


@fused_kernel
def assemble_arm(chain, plant, chain_work, work, stage):  # type: ignore[no-untyped-def]
    """Arm and constants into `system`, right-hand side into `right`; rows of motors hold their constants already."""
    system, right = work.system, work.right
    n, n_axis, n_joint = right.shape[0], work.torque.shape[0], work.joint.shape[0]
    width, motor = plant.joint_value.shape[1], n - n_axis
    if motor == n_joint:  # every gear is elastic: joints are the first coordinates
        memory = ChainWork(
            chain_work.record, chain_work.screw, chain_work.momentum, system, right, chain_work.gravity_stiffness,
            chain_work.sine, chain_work.cosine,
        )  # fmt: skip
        evaluate(chain, memory, work.middle, work.middle_speed)
        for i in range(n_joint):
            right[i] = stage[i] - right[i]
        add_constant(plant, system)
        for i in range(n_joint, n):
            right[i] = stage[i]
        return
    for j in range(n_joint):
        q, v = 0.0 * work.middle[0], 0.0 * work.middle[0]
        for e in range(width):
            q = q + plant.joint_value[j, e] * work.middle[plant.joint_column[j, e]]
            v = v + plant.joint_value[j, e] * work.middle_speed[plant.joint_column[j, e]]
        work.joint[j], work.joint_speed[j] = q, v
    evaluate(chain, chain_work, work.joint, work.joint_speed)
    for i in range(n):
        right[i] = stage[i]
    for i in range(motor):
        for j in range(i + 1):
            system[i, j] = 0.0
    add_constant(plant, system)
    for i in range(n_joint):
        for e in range(width):
            row = plant.joint_column[i, e]
            right[row] = right[row] - plant.joint_value[i, e] * chain_work.bias[i]
            for j in range(n_joint):
                inertia = plant.joint_value[i, e] * chain_work.mass[max(i, j), min(i, j)]
                for f in range(width):
                    column = plant.joint_column[j, f]
                    if column <= row:
                        system[row, column] = system[row, column] + inertia * plant.joint_value[j, f]


@fused_kernel
def hold_torque(chain, plant, terms, chain_work, work, state, step, n_step, runge_kutta):  # type: ignore[no-untyped-def]
    """Advance by n_step steps under constant commanded torques (`work.command`).

    `state` (a `LaneState` of views) changes in place; its acceleration is that of the last step, with which the next
    midpoint is extrapolated.
    """
    position, speed, acceleration, law_state = (
        state.position,
        state.speed,
        state.acceleration,
        state.law_state,
    )
    middle, middle_speed, spring, right = work.middle, work.middle_speed, work.spring, work.right
    system, stage, fill = work.system, work.stage, plant.fill
    n, n_axis, n_term = right.shape[0], work.command.shape[0], terms.force.shape[0]
    motor = n - n_axis
    half = 0.0 if runge_kutta else 0.5 * step
    for evaluation in range(n_step * (4 if runge_kutta else 1)):
        k = evaluation % 4 if runge_kutta else 0
        # where to evaluate: the extrapolated midpoint, or the point that stage k of Runge-Kutta asks for
        if runge_kutta:
            ahead = 0.0 if k == 0 else (step if k == 3 else 0.5 * step)
            for i in range(n):
                x, v = position[i] + ahead * speed[i], speed[i]
                if k > 0:
                    v = v + ahead * stage[k - 1, i]
                if k > 1:
                    x = x + ahead * 0.5 * step * stage[k - 2, i]
                middle[i], middle_speed[i], spring[i], right[i] = x, v, x, v
        else:
            for i in range(n):
                v = speed[i] + half * acceleration[i]
                middle_speed[i] = v
                middle[i] = position[i] + 0.5 * half * (speed[i] + v)
                spring[i], right[i] = position[i] + half * speed[i], speed[i]
        if k == 0 and n_term > 0:
            for i in range(n):
                work.start[i] = position[i]
        # forces of springs, dampers, motors and laws; `right` holds the speed that dampers start from
        force = row_of(stage, k)
        for i in range(n):
            moment = 0.0 * middle[0]
            for e in range(plant.spring_start[i], plant.spring_start[i + 1]):
                j = plant.spring_column[e]
                moment = moment - (plant.spring_value[e, 0] * spring[j] + plant.spring_value[e, 1] * right[j])
            force[i] = moment
        pass_torque(
            plant, terms, work, work.command, law_state, acceleration, step, 0.0 if runge_kutta else step,
            not runge_kutta or k == 3,
        )  # fmt: skip
        for a in range(n_axis):
            i = motor + a
            braking = work.braking[a]
            force[i] = force[i] + work.torque[a] - braking * (right[i] - middle_speed[i])
            system[i, i] = plant.constant[i, i] + half * braking
            for e in range(1, fill[a, 0] + 1):
                system[i, fill[a, e]] = plant.constant[i, fill[a, e]]
        add_forces(plant, terms, work, law_state, force, half, step, True)
        assemble_arm(chain, plant, chain_work, work, force)
        if not runge_kutta:
            for t in range(n_term):
                first, last = terms.force[t, 6], terms.force[t, 7]
                for e in range(first, last):
                    i = terms.column[e]
                    for f in range(first, e + 1):
                        j = terms.column[f]
                        system[i, j] = system[i, j] + terms.value[e] * terms.value[f] * work.slope[t]
        eliminate(system, right, work.pivot, fill)
        if not runge_kutta:
            complete_forces(terms, work, right)
            for i in range(n):
                acceleration[i] = right[i]
                position[i] = position[i] + step * (speed[i] + half * right[i])
                speed[i] = speed[i] + step * right[i]
            advance_laws(terms, work, law_state, position, step)
        else:
            for i in range(n):
                stage[k, i] = right[i]
            if k == 3:
                for i in range(n):
                    position[i] = (
                        position[i]
                        + step * speed[i]
                        + step * step / 6.0 * (stage[0, i] + stage[1, i] + stage[2, i])
                    )
                    mean = (stage[0, i] + 2.0 * stage[1, i] + 2.0 * stage[2, i] + stage[3, i]) / 6.0
                    acceleration[i] = mean
                    speed[i] = speed[i] + step * mean
                advance_laws(terms, work, law_state, position, step)
