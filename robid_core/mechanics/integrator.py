"""The compiled inner loop of the simulation: robot in a sampled speed loop, one experiment after another.

The plant is ``M(z) z'' + c(z, z') + g(z) + sum_s e_s (k_s e_s^T z + d_s e_s^T z') + f(z'_motor) = B torque``.
*Linearly implicit midpoint* (a Rosenbrock method of order two): M, c and g at the extrapolated midpoint, springs,
dampers and the slope of friction implicit, one evaluation a step. It is stable for springs and friction slopes
far beyond the step's resolution. *Runge-Kutta* of order four, all explicit, is its check.

Functions take plain arrays, for numba counts references of every member of a tuple; the meaning of each stands in
`layout`.
"""

from __future__ import annotations

import numpy as np

from robid_core.mechanics.dynamics import evaluate
from robid_core.mechanics.friction import friction_law
from robid_core.mechanics.kernel import kernel

DIVERGED = 1e6  # rad, rad/s, m or m/s: no motor is there, a numerical explosion soon is


@kernel
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
            right[i] -= factor * right[k]
            for f in range(1, e + 1):
                system[i, fill[a, f]] -= factor * system[k, fill[a, f]]
    for k in range(n_free - 1, -1, -1):
        inverse = 1.0 / system[k, k]
        pivot[k] = inverse
        for i in range(k):
            factor = system[k, i] * inverse
            right[i] -= factor * right[k]
            for j in range(i + 1):
                system[i, j] -= factor * system[k, j]
    for k in range(n_free):
        right[k] *= pivot[k]
        for i in range(k + 1, n_free):
            right[i] -= system[i, k] * right[k]
    for a in range(n_axis):
        k = n_free + a
        total = right[k]
        for e in range(1, fill[a, 0] + 1):
            total -= system[k, fill[a, e]] * right[fill[a, e]]
        right[k] = total * pivot[k]


@kernel
def hold_torque(  # type: ignore[no-untyped-def]
    tree, body, ancestor, gravity, joint_column, joint_value, spring_start, spring_column, spring_value, motor_law,
    constant, fill, record, screw, momentum, mass, bias, gravity_stiffness, joint, joint_speed, middle, middle_speed,
    spring, right, pivot, system, stage, torque, position, speed, acceleration, step, n_step, runge_kutta,
):  # fmt: skip
    """Advance one lane by n_step steps under a constant motor torque.

    `position`, `speed` and `acceleration` (n,) change in place; the last is that of the last step, with which the
    next midpoint is extrapolated. The other arrays are the fields of `PlantArrays` and `StepWork` in `layout`.
    """
    n, n_axis, n_joint, width = right.shape[0], torque.shape[0], tree.shape[0], joint_value.shape[1]
    motor = n - n_axis
    half = 0.0 if runge_kutta else 0.5 * step
    for evaluation in range(n_step * (4 if runge_kutta else 1)):
        k = evaluation % 4 if runge_kutta else 0
        # where to evaluate: the extrapolated midpoint, or the point that stage k of Runge-Kutta asks for
        if runge_kutta:
            ahead = 0.0 if k == 0 else (step if k == 3 else 0.5 * step)
            for i in range(n):
                middle[i], middle_speed[i] = position[i] + ahead * speed[i], speed[i]
                if k > 0:
                    middle_speed[i] += ahead * stage[k - 1, i]
                if k > 1:
                    middle[i] += ahead * 0.5 * step * stage[k - 2, i]
                spring[i], right[i] = middle[i], middle_speed[i]
        else:
            for i in range(n):
                middle_speed[i] = speed[i] + half * acceleration[i]
                middle[i] = position[i] + 0.5 * half * (speed[i] + middle_speed[i])
                spring[i], right[i] = position[i] + half * speed[i], speed[i]
        # forces of springs, dampers and motors; `right` holds the speed that dampers start from
        for i in range(n):
            moment = 0.0
            for e in range(spring_start[i], spring_start[i + 1]):
                j = spring_column[e]
                moment -= spring_value[e, 0] * spring[j] + spring_value[e, 1] * right[j]
            stage[k, i] = moment
        for a in range(n_axis):
            i = motor + a
            moment, slope = friction_law(middle_speed[i], motor_law[a, 0], motor_law[a, 1], motor_law[a, 2])
            stage[k, i] += torque[a] - motor_law[a, 3] - moment - slope * (right[i] - middle_speed[i])
            system[i, i] = constant[i, i] + half * slope
            for e in range(1, fill[a, 0] + 1):
                system[i, fill[a, e]] = constant[i, fill[a, e]]
        # the arm
        if motor == n_joint:  # every gear is elastic: joints are the first coordinates
            evaluate(
                tree, body, ancestor, gravity, record, screw, momentum, system, right, gravity_stiffness,
                middle, middle_speed, False,
            )  # fmt: skip
            for i in range(n_joint):
                right[i] = stage[k, i] - right[i]
                for j in range(i + 1):
                    system[i, j] += constant[i, j]
            for i in range(n_joint, n):
                right[i] = stage[k, i]
        else:
            for j in range(n_joint):
                joint[j] = joint_speed[j] = 0.0
                for e in range(width):
                    joint[j] += joint_value[j, e] * middle[joint_column[j, e]]
                    joint_speed[j] += joint_value[j, e] * middle_speed[joint_column[j, e]]
            evaluate(
                tree, body, ancestor, gravity, record, screw, momentum, mass, bias, gravity_stiffness,
                joint, joint_speed, False,
            )  # fmt: skip
            for i in range(n):
                right[i] = stage[k, i]
            for i in range(motor):
                for j in range(i + 1):
                    system[i, j] = constant[i, j]
            for i in range(n_joint):
                for e in range(width):
                    row = joint_column[i, e]
                    right[row] -= joint_value[i, e] * bias[i]
                    for j in range(n_joint):
                        inertia = joint_value[i, e] * mass[max(i, j), min(i, j)]
                        for f in range(width):
                            if joint_column[j, f] <= row:
                                system[row, joint_column[j, f]] += inertia * joint_value[j, f]
        eliminate(system, right, pivot, fill)
        if not runge_kutta:
            for i in range(n):
                acceleration[i] = right[i]
                position[i] += step * (speed[i] + half * right[i])
                speed[i] += step * right[i]
        else:
            for i in range(n):
                stage[k, i] = right[i]
            if k == 3:
                for i in range(n):
                    position[i] += step * speed[i] + step * step / 6.0 * (
                        stage[0, i] + stage[1, i] + stage[2, i]
                    )
                    acceleration[i] = (
                        stage[0, i] + 2.0 * stage[1, i] + 2.0 * stage[2, i] + stage[3, i]
                    ) / 6.0
                    speed[i] += step * acceleration[i]


@kernel
def run_lanes(plant, work, control, state, signals, first_lane, last_lane):  # type: ignore[no-untyped-def]
    """Run the closed loop of lanes first_lane to last_lane - 1 over all samples."""
    (tree, body, ancestor, gravity, joint_column, joint_value, spring_start, spring_column, spring_value, motor_law,
     constant, fill) = plant  # fmt: skip
    (record, screw, momentum, mass, bias, gravity_stiffness, joint, joint_speed, middle, middle_speed, spring, right,
     pivot, system, stage, torque) = work  # fmt: skip
    (speed_reference, position_reference, torque_feedforward, position_noise, torque_noise, out_position, out_torque,
     coordinates, saturated, diverged) = signals  # fmt: skip
    integral, reference, last_measured, holding = (
        state.integral,
        state.reference,
        state.measured,
        state.holding_torque,
    )
    gains, sample_time, n_step, runge_kutta = control
    n, n_axis = state.position.shape[1], gains.shape[0]
    motor = n - n_axis
    step = sample_time / n_step
    for lane in range(first_lane, last_lane):
        position, speed, acceleration = state.position[lane], state.speed[lane], state.acceleration[lane]
        for sample in range(speed_reference.shape[1]):
            for a in range(n_axis):
                measured = position[motor + a]
                if position_noise.shape[0] > 0:
                    measured += position_noise[lane, sample, a]
                if gains[a, 5] > 0.0:
                    measured = np.rint(measured / gains[a, 5]) * gains[a, 5]
                measured_speed = (measured - last_measured[lane, a]) / sample_time
                last_measured[lane, a] = measured
                wanted_speed = speed_reference[lane, sample, a]
                if position_reference.shape[0] > 0:
                    reference[lane, a] = position_reference[lane, sample, a]
                error = (
                    gains[a, 3] * wanted_speed
                    + gains[a, 2] * (reference[lane, a] - measured)
                    - measured_speed
                )
                reference[lane, a] += sample_time * wanted_speed
                integral[lane, a] += gains[a, 1] * sample_time * error
                demand = gains[a, 0] * error + integral[lane, a] + holding[lane, a]
                if torque_feedforward.shape[0] > 0:
                    demand += torque_feedforward[lane, sample, a]
                if abs(demand) >= gains[a, 4]:
                    saturated[lane, a] += 1
                    demand = gains[a, 4] if demand > 0.0 else -gains[a, 4]
                torque[a] = demand
                out_position[lane, sample, a] = measured
                out_torque[lane, sample, a] = demand
                if torque_noise.shape[0] > 0:
                    out_torque[lane, sample, a] += torque_noise[lane, sample, a]
            if coordinates.shape[0] > 0:
                for i in range(n):
                    coordinates[lane, sample, i] = position[i]
            hold_torque(
                tree, body, ancestor, gravity, joint_column, joint_value, spring_start, spring_column, spring_value,
                motor_law, constant, fill, record, screw, momentum, mass, bias, gravity_stiffness, joint, joint_speed,
                middle, middle_speed, spring, right, pivot, system, stage, torque, position, speed, acceleration,
                step, n_step, runge_kutta,
            )  # fmt: skip
            inside = True
            for i in range(n):
                inside = inside and abs(position[i]) < DIVERGED and abs(speed[i]) < DIVERGED
            if not inside:
                diverged[lane] = sample
                break
