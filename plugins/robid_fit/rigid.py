"""Rigid-body identification by inverse-dynamics least squares.

The torque of a rigid robot is linear in inertia and friction (`rigid_model`), so that sampled motion and torque
give them in one step. Only base parameters can be told apart (Gautier 1991): of parameters that every motion
shows together the first one is estimated, the others stand at the robot file's values. Filters and differences
as Janot, Gautier and Brunot (2019) do it for the benchmark "EMPS".
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from robid_core import (
    BoolArray,
    DataRejected,
    Estimator,
    Fit,
    FloatArray,
    IntArray,
    Model,
    ParameterTable,
    Record,
    Robot,
    TimeComparison,
)
from robid_core.estimation.rigid.regression import (
    BaseParameters,
    LinearFit,
    base_parameters,
    decimate,
    decimated_index,
    linear_least_squares,
)
from robid_fit.mass_matrix import mass_matrix_doubts
from robid_fit.rigid_bodies import model_of
from robid_fit.rigid_effects import refuse_effects
from robid_fit.rigid_model import (
    KINDS,
    Columns,
    Kind,
    RigidMotion,
    experiments,
    motion_of,
    random_motion,
    torque_columns,
    without_bearings,
)

RANDOM_STATES = 40  # random states per coordinate: many more equations than the ten unknowns of a body
# A fit that leaves more than this share of the torque unexplained describes another machine.
LARGEST_RELATIVE_ERROR = 0.5


def structure(
    robot: Robot, unknowns: tuple[str, ...], friction_speed: FloatArray
) -> tuple[Columns, BoolArray, BaseParameters]:
    """Which columns are estimated at all, and which of them stand for others.

    Returns the columns at random states, the mask of those of the wanted kinds, (n_parameter,), and the base
    parameters among these (indices count within the mask).
    """
    columns = torque_columns(
        robot, random_motion(robot, RANDOM_STATES * robot.chain.n_coordinate), friction_speed
    )
    wanted = np.array([kind in unknowns for kind in columns.kinds])
    regressor = columns.regressor[:, :, wanted]
    return columns, wanted, base_parameters(regressor.reshape(-1, regressor.shape[2]))


def not_physical(names: tuple[str, ...], fit: LinearFit) -> list[str]:
    """Names of masses, rotor inertias and friction coefficients that are negative by more than two standard errors."""
    positive = [
        n.startswith(("mass.", "rotor_inertia.")) or n.endswith((".viscous", ".coulomb")) for n in names
    ]
    below = np.asarray(positive) & (fit.estimate < -2 * fit.standard_error)
    return [names[i] for i in np.flatnonzero(below)]


class RigidBodyFit(Estimator):
    """Inertia and friction of a rigid robot by inverse-dynamics least squares.

    Estimates go by the robot's own names: mass.<joint>, rotor_inertia.<axis>, friction.<axis>.coulomb, .viscous,
    .offset; base parameters that the robot file cannot hold are first_moment.<joint>.x and joint_inertia.<joint>.xx,
    about the joint's frame. It knows bodies, rotors and the friction under `axes`: a robot with effects that it would
    ignore, or count twice, is refused.

        fit:
          use: fit.rigid
          with: {cutoff_hz: 100, decimation: 10}
    """

    unknowns: Annotated[tuple[Kind, ...], Field(min_length=1)] = KINDS
    """What is estimated; the rest stands at the robot file's values and its torque is subtracted."""
    cutoff_hz: PositiveFloat = 100.0
    """Edge of the low-pass on position, forward and backward; ten times the bandwidth of the motion is usual."""
    filter_order: PositiveInt = 4
    """Order of that Butterworth filter."""
    decimation: PositiveInt = 10
    """Every such sample is kept after a common low-pass: residuals become white, standard errors honest."""
    drop_first: NonNegativeInt = 50
    """Samples left out at the start of each experiment, where filters have no past."""
    drop_last: NonNegativeInt = 50
    """Samples left out at the end."""
    friction_speed: NonNegativeFloat | None = None
    """Speed scale of Coulomb friction, tanh(v / v_s), at the motor; 0: plain sign(v); null: the robot's."""
    discard: NonNegativeInt = 0
    """Leading periods left out of a periodic record."""

    def run(self, record: Record, robot: Robot) -> Fit:
        """Smooth, differentiate, decimate, solve."""
        speed = robot.drives.friction_speed
        if self.friction_speed is not None:
            speed = np.full(robot.n_axis, self.friction_speed)
        nominal, robot = robot, without_bearings(robot)
        refuse_effects(robot, self.unknowns)
        columns, wanted, base = structure(robot, self.unknowns, speed)
        named = np.flatnonzero(wanted)[base.independent]
        held = np.setdiff1d(np.arange(len(columns.names)), named)
        regressors, explained, torques, times, positions = [], [], [], [], []
        elapsed = 0.0
        for run in record.runs:
            for position, torque in experiments(run, robot, self.discard):
                motion = motion_of(position, run.sample_time_s, self.cutoff_hz, self.filter_order)
                kept = self._window(len(torque))
                full = torque_columns(robot, _cut(motion, kept), speed)
                regressors.append(decimate(full.regressor[:, :, named], self.decimation))
                explained.append(decimate(full.regressor[:, :, held] @ full.value[held], self.decimation))
                torques.append(decimate(torque[kept], self.decimation))
                positions.append(motion.position[kept])
                index = np.arange(len(position))[kept][decimated_index(len(torque[kept]), self.decimation)]
                times.append(elapsed + index * run.sample_time_s)
                elapsed += len(position) * run.sample_time_s
        measured, known = np.concatenate(torques), np.concatenate(explained)
        names = tuple(columns.names[i] for i in named)
        fit = linear_least_squares(np.concatenate(regressors), measured - known, names)
        symbol = record.runs[0].channel("motor_torque").unit_symbol
        value = columns.value.copy()
        value[named] = fit.estimate
        doubts = mass_matrix_doubts(robot, value, np.concatenate(positions))
        model = model_of(nominal, columns, named, fit)
        result = _result(
            columns, named, fit, model, symbol, np.concatenate(times), measured, robot.axis_names
        )
        return result.replace(stated_doubts=doubts)

    def _window(self, n_sample: int) -> slice:
        if n_sample <= self.drop_first + self.drop_last + self.decimation:
            raise DataRejected(
                f"fit.rigid: an experiment has {n_sample} samples only; lower drop_first and drop_last"
            )
        return slice(self.drop_first, n_sample - self.drop_last)


def _cut(motion: RigidMotion, kept: slice) -> RigidMotion:
    return RigidMotion(motion.position[kept], motion.velocity[kept], motion.acceleration[kept])


def _result(
    columns: Columns,
    named: IntArray,
    fit: LinearFit,
    model: Model,
    symbol: str,
    time: FloatArray,
    measured: FloatArray,
    axis_names: tuple[str, ...],
) -> Fit:
    names = tuple(columns.names[i] for i in named)
    relative = float(np.linalg.norm(fit.residual) / np.linalg.norm(measured))
    wrong = not_physical(names, fit)
    status = (
        f"linear least squares, {measured.size} equations, {len(names)} base parameters, condition number "
        f"{fit.condition:.3g}, relative torque error {100 * relative:.2f} %"
    )
    if wrong:
        status = f"not physical: {', '.join(wrong)} negative; {status}"
    elif relative > LARGEST_RELATIVE_ERROR:
        status = f"the model leaves more than half of the torque unexplained; {status}"
    return Fit(
        method="rigid body, inverse-dynamics least squares",
        status=status,
        converged=not wrong and relative <= LARGEST_RELATIVE_ERROR,
        misfit=1.0,
        misfit_against="",  # the residual itself gives the noise level
        n_starts=1,
        n_agree=1,
        parameters=ParameterTable(
            names=names,
            units=tuple(columns.units[i] for i in named),
            groups=tuple(columns.groups[i] for i in named),
            start=columns.value[named],
            estimate=fit.estimate,
            standard_error=fit.standard_error,
            reported=np.ones(len(names), dtype=bool),
            at_bound=np.zeros(len(names), dtype=bool),
        ),
        covariance=fit.covariance,
        free_names=names,
        time=(
            TimeComparison(
                axis_names=axis_names,
                channel="motor_torque",
                unit_symbol=symbol,
                relative_error=relative,
                time_s=time,
                measured=measured,
                modelled=measured - fit.residual,
            ),
        ),
        model=model,
    )
