"""Rigid-body identification by inverse dynamics: bodies, rotors, friction and effects from motion and torque.

The torque of a rigid robot is linear in inertia and friction (`rigid_model`). Only base parameters can be told apart
(Gautier 1991), so that the robot file's bodies and their tolerances stand beside the data: what comes out is a whole
robot whose bodies can be (Wensing, Kim and Slotine 2018), and a report of its base parameters. Filters and differences
as Janot, Gautier and Brunot (2019) do it for the benchmark "EMPS"; instruments as in Janot, Vandanjon and Gautier
(2014).
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from robid_core import (
    BoolArray,
    Context,
    DataRejected,
    EssentialParameters,
    Estimator,
    Fit,
    FloatArray,
    IntArray,
    NotIdentifiable,
    ParameterTable,
    Record,
    Robot,
    TimeComparison,
    pattern_problems,
)
from robid_core.estimation.copies import refuse_copies
from robid_core.estimation.disagreement import spread_over_experiments
from robid_core.estimation.rigid.essential import eliminate
from robid_core.estimation.rigid.regression import BaseParameters, base_parameters
from robid_core.residual import excited_range, leading_periods, variant_robots, whole_pieces, words_of_pieces
from robid_fit.rigid_doubts import doubts, prediction_doubts
from robid_fit.rigid_effects import rigid_robot
from robid_fit.rigid_equations import RigidEquations, Sampling
from robid_fit.rigid_model import KINDS, Columns, Kind, random_motion, torque_columns
from robid_fit.rigid_rows import marginalised
from robid_fit.rigid_solution import Linearised, RigidProblem, RigidSolution
from robid_fit.rigid_unknowns import Delays, RigidUnknowns

RANDOM_STATES = 40  # random states per coordinate: many more equations than the ten unknowns of a body
# A fit that leaves more than this share of the torque unexplained describes another machine.
LARGEST_RELATIVE_ERROR = 0.5
FEWEST_EQUATIONS = 10  # of a piece between gaps, each of `decimation` samples
PADDING = 50  # samples that filters, and the search for rests, ask for
TOLD = 0.005  # of the samples: fewer at rest are not worth a word
SEEN = 0.5  # of what was known before: a short table shows what the data have told better


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


class RigidBodyFit(Estimator):
    """Inertia, friction and effects of a rigid robot by inverse-dynamics least squares.

    Estimates go by the names of the robot file: mass.<joint>, centre_of_mass.<joint>.x, inertia.<joint>.xx,
    rotor_inertia.<axis>, friction.<axis>.coulomb, .viscous, .offset, effect.<label>.<parameter>. The data move what
    they show; the rest stays with the robot file's bodies, as near as their tolerances ask. Laws on motors and joints
    are run along the measured motion, those with a memory too, with the load that the robot predicts; payloads are
    known. Ripple of a torque (drive.torque_ripple, drive.cogging) is found with size and phase at its stated order.
    `Fit.base` has the base parameters, which alone a motion can show, `Fit.essential` those that the record determines.

        fit:
          use: fit.rigid
          with: {cutoff_hz: 100, decimation: 10}
    """

    unknowns: Annotated[tuple[Kind, ...], Field(min_length=1)] = KINDS
    """What is estimated; the rest stands at the robot file's values and its torque is subtracted. `effects`: the
    parameters of laws on motors and joints, too."""
    fixed: tuple[str, ...] = ()
    """Patterns of parameters that are held all the same."""
    prior: dict[str, PositiveFloat] = {}
    """Standard deviations by pattern, in natural scales (0.01: one percent); 0.1 for bodies and rotors."""
    widen: bool = False
    """Whether all tolerances of bodies and rotors are widened by one factor where the data ask for it; a doubt says
    where they ask for three times as much. What the model lacks asks for it, too."""
    delays: Delays = "each"
    """Whether the measured torques lag the angles by a number of each axis, or by one in common, half a sample or so
    before the data, beside the half sample of a held torque; `none`: they are taken as they were recorded."""
    loss: Literal["squares", "huber"] = "squares"
    """How residuals count; huber: those beyond 1.3 deviations by their size only (knocks, drop-outs)."""
    instruments: Literal["none", "reference"] = "none"
    """reference: the motion that was asked for (channel position_reference) is the instrument for the noisy one."""
    cutoff_hz: PositiveFloat = 100.0
    """Edge of the low-pass on position, forward and backward; ten times the bandwidth of the motion is usual."""
    filter_order: PositiveInt = 4
    """Order of that Butterworth filter."""
    decimation: PositiveInt = 10
    """Every such sample is kept after a common low-pass."""
    drop_first: NonNegativeInt = 50
    """Samples left out at the start of each experiment, where filters have no past."""
    drop_last: NonNegativeInt = 50
    """Samples left out at the end."""
    friction_speed: NonNegativeFloat | None = None
    """Speed v_s within which Coulomb friction turns, tanh(v / v_s), at all motors; 0: plain sign(v); null: found for
    each motor from the robot file's value on (fixed: ["friction.*.speed"] holds that)."""
    at_rest: Literal["leave_out", "keep"] = "leave_out"
    """What becomes of samples at which an axis stands still: friction holds it there by any torque up to its level."""
    discard: NonNegativeInt | None = None
    """Leading periods left out of a periodic record; null: decided from the data, as many as differ from
    those after them."""
    blocks: Annotated[int, Field(ge=2, le=100)] | None = None
    """Blocks into which the record is cut: each is left out of a fit in turn, and its torque is predicted
    from the others; null: none."""
    constants: dict[str, str] = {}
    """Constants of the record that are parameters of the robot, `{payload_kg: effect.load.mass}`; one value each."""

    names_several: ClassVar[bool] = True

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """Patterns that mean nothing in this robot."""
        return pattern_problems(robot, list(robot.layout), self.fixed, self.prior, lambda name: "")

    def _whole(self, records: tuple[Record, ...], context: Context | None) -> tuple[Record, ...]:
        """Return records without gaps; of those that have some, the pieces between that give equations."""
        kept = max(FEWEST_EQUATIONS * self.decimation, PADDING)
        step = max(run.sample_time_s for one in records for run in one.runs)
        shortest_s = step * (self.drop_first + self.drop_last + kept)
        found = whole_pieces(records, shortest_s, "fit.rigid", "lower drop_first, drop_last or decimation")
        if context is not None and (words := words_of_pieces(records, found)):
            context.log.warning("fit.rigid %s", words)
        return found

    def run(self, record: tuple[Record, ...], robot: Robot, context: Context | None = None) -> Fit:
        """Smooth, differentiate, decimate, solve; of one record, or several together."""
        if len(record) > 1:
            refuse_copies(record)
        progress = context.progress if context is not None else lambda *_: None
        _refuse_variants(record)
        record = self._whole(record, context)
        robot, _ = variant_robots(record, robot, {}, self.constants)
        fixed = self.fixed
        if self.friction_speed is not None:
            held = tuple(f"friction.{axis}.speed" for axis in robot.axis_names)
            fixed += held
            if self.friction_speed > 0:  # a robot file has no plain sign
                robot = robot.with_parameters(dict.fromkeys(held, self.friction_speed))
        stiff = rigid_robot(robot)
        speed = np.zeros(robot.n_axis) if self.friction_speed == 0 else robot.drives.friction_speed
        sampling = Sampling(
            self.cutoff_hz,
            self.filter_order,
            self.decimation,
            self.drop_first,
            self.drop_last,
            leading_periods(record, self.discard, context.log if context is not None else None),
            self.at_rest == "leave_out",
        )
        timed = self.delays != "none"
        equations = RigidEquations.of_records(record, stiff, speed, sampling, timed=timed)
        instruments = None
        if self.instruments == "reference":
            instruments = RigidEquations.of_records(
                record, stiff, speed, sampling, "position_reference", timed=timed
            )
        unknowns = RigidUnknowns.of_robot(
            stiff,
            equations.columns,
            self.unknowns,
            fixed,
            self.prior,
            self.delays,
            record[0].runs[0].sample_time_s,
        )
        columns, wanted, base = structure(stiff, self.unknowns, speed)
        _refuse_still(equations, np.flatnonzero(wanted)[base.independent])
        problem = RigidProblem(
            equations, unknowns, instruments, robust=self.loss == "huber", widen=self.widen
        )
        progress(0, 1 + (self.blocks or 0), "fitting bodies")
        solution = problem.solve()
        shown = problem.unweighted(solution.at.point)
        found = _result(robot, record[0], equations, unknowns, solution, shown, columns, wanted, base)
        found = found.replace(excited=excited_range(record))
        if self.blocks is None:
            return found
        residual, n_unsettled = problem.left_out(solution, self.blocks, progress)
        left = _share(residual, equations)
        told = ", ".join(
            f"{name} {100 * own:.3g} %" for name, own in zip(robot.axis_names, left.tolist(), strict=True)
        )
        return found.replace(
            status=f"{found.status}; torque of blocks left out, {self.blocks} in turn"
            + (f" ({n_unsettled} of these fits did not settle)" if n_unsettled else "")
            + f": {told}",
            stated_doubts=found.stated_doubts
            + prediction_doubts(_share(solution.at.residual, equations), left, robot.axis_names),
        )


def _refuse_variants(records: tuple[Record, ...]) -> None:
    """Raise DataRejected where records are of several robots: one set of bodies would be fitted to all of them."""
    names = list(dict.fromkeys(name for record in records for name in record.variants))
    if len(names) > 1:
        raise DataRejected(
            f"fit.rigid: the records are of several variants ({', '.join(names)}), and it fits one robot; "
            "fit.torque_residual fits them together (robots: a file for each variant, or constants: the load of each), "
            "or name one of the records under `inputs:`"
        )


def _share(residual: FloatArray, equations: RigidEquations) -> FloatArray:
    """What is left of each torque that counts, rms, (n_axis,)."""
    counted = equations.counted
    result: FloatArray = np.linalg.norm(counted * residual, axis=0) / np.linalg.norm(
        counted * equations.torque, axis=0
    )
    return result


def _refuse_still(equations: RigidEquations, independent: IntArray) -> None:
    """Refuse a record in which a base parameter does not act at all."""
    regressor = equations.regressor[:, :, independent]
    still = np.flatnonzero(~(regressor * equations.counted[..., None]).any(axis=(0, 1)))
    if len(still):
        unseen = ", ".join(equations.columns.names[independent[i]] for i in still)
        raise NotIdentifiable(f"the motion does not excite {unseen}; move these axes or hold the parameters")


def _essential(
    equations: RigidEquations,
    solution: RigidSolution,
    names: tuple[str, ...],
    index: IntArray,
    base: FloatArray,
    bends: list[int],
) -> EssentialParameters:
    """Return what least squares without tolerances keep of base parameters: columns `index`, values `base`.

    Unknowns that the torque is not linear in, `bends`, stand beside them.
    """
    weight = equations.counted / (solution.deviation * np.sqrt(solution.inflation))
    columns = solution.at.regressor[:, :, index]
    target = solution.at.residual + columns @ base
    bent = solution.at.rows[..., bends] * solution.prior[bends]
    rows = (np.concatenate((columns, target[..., None], bent), axis=2) * weight[..., None]).reshape(
        weight.size, -1
    )
    n = len(index) + 1
    rows = marginalised(rows[:, :n], rows[:, n:])
    freedom = float((equations.counted.sum(axis=0) / solution.inflation).sum())
    found = eliminate(rows[:, :-1], rows[:, -1], freedom)
    units = [equations.columns.units[i] for i in index]
    return EssentialParameters(
        names=tuple(names[i] for i in found.kept),
        units=tuple(units[i] for i in found.kept),
        removed=tuple(names[i] for i in found.removed),
        estimate=found.estimate,
        standard_error=found.standard_error,
        relative_error=found.relative_error,
        increase=found.increase,
        probability=found.probability,
    )


def _result(
    robot: Robot,
    record: Record,
    equations: RigidEquations,
    unknowns: RigidUnknowns,
    solution: RigidSolution,
    shown: Linearised,
    columns: Columns,
    wanted: BoolArray,
    base: BaseParameters,
) -> Fit:
    point, covariance, residual = solution.at.point, solution.covariance, solution.at.residual
    names, n_own = unknowns.names, unknowns.n_own
    slope = unknowns.slopes(point)
    values = unknowns.values(point)
    own = slope @ covariance @ slope.T
    at_bound = (point <= unknowns.lower) | (point >= unknowns.upper)
    seen = ~(np.diag(covariance) > (SEEN * solution.prior) ** 2)
    # Base parameters: independent columns, and what stands for others with them.
    combined = np.zeros((len(base.independent), len(columns.names)))
    places = np.flatnonzero(wanted)
    combined[np.arange(len(base.independent)), places[base.independent]] = 1.0
    combined[:, places[base.dependent]] = base.grouping
    by_unknown = combined @ unknowns.linear_slopes(point)
    base_names = tuple(columns.names[i] for i in places[base.independent])
    base_error = np.sqrt(np.maximum(np.einsum("bi,ij,bj->b", by_unknown, covariance, by_unknown), 0.0))
    measured = solution.at.torque
    counted = equations.counted
    relative = float(np.linalg.norm(counted * residual) / np.linalg.norm(counted * measured))
    known = int((base_error < 0.1 * np.abs(combined @ unknowns.linear(point))).sum())
    status = (
        f"{measured.size} equations, {len(names)} unknowns; {len(base_names)} base parameters, {known} of them known "
        f"to a tenth; relative torque error {100 * relative:.2f} %"
    )
    if unknowns.delays:
        late = unknowns.delay(point)[: len(unknowns.delays)]
        status += f"; torque lags by {', '.join(f'{1e6 * each:.3g}' for each in late.tolist())} us"
    resting = [
        f"{name} {100 * share:.0f} %"
        for name, share in zip(robot.axis_names, 1 - counted.mean(axis=0), strict=True)
        if share > TOLD
    ]
    if resting:
        status += f"; left out, since at rest: {', '.join(resting)} of the samples"
    if solution.widened > 1:
        status += f"; tolerances of bodies widened {solution.widened:.3g} times"
    if relative > LARGEST_RELATIVE_ERROR:
        status = f"the model leaves more than half of the torque unexplained; {status}"
    elif not solution.converged:
        status = f"{solution.n_rounds} rounds were not enough; {status}"
    return Fit(
        method="rigid body, inverse-dynamics least squares",
        status=status,
        converged=solution.converged and relative <= LARGEST_RELATIVE_ERROR,
        misfit=1.0,
        misfit_against="",  # the residual itself gives the noise level
        n_starts=1,
        n_agree=1,
        parameters=ParameterTable(
            names=names,
            units=unknowns.units,
            groups=unknowns.groups,
            start=unknowns.values(unknowns.start),
            estimate=values,
            standard_error=np.sqrt(np.maximum(np.diag(own), 0.0)),
            reported=seen,
            at_bound=at_bound,
            prior=np.sqrt(
                ((slope * np.where(np.isfinite(solution.prior), solution.prior, 0.0)) ** 2).sum(axis=1)
            ),
            spread=spread_over_experiments(solution.experiments, solution.hessian, slope),
        ),
        base=ParameterTable(
            names=base_names,
            units=tuple(columns.units[i] for i in places[base.independent]),
            groups=tuple(columns.groups[i] for i in places[base.independent]),
            start=combined @ unknowns.linear(unknowns.start),
            estimate=combined @ unknowns.linear(point),
            standard_error=base_error,
            reported=np.ones(len(base_names), dtype=bool),
            at_bound=np.zeros(len(base_names), dtype=bool),
            spread=spread_over_experiments(solution.experiments, solution.hessian, by_unknown),
        ),
        covariance=covariance,
        free_names=names,
        time=(
            TimeComparison(
                axis_names=robot.axis_names,
                channel="motor_torque",
                unit_symbol=record.runs[0].channel("motor_torque").unit_symbol,
                relative_error=relative,
                time_s=equations.time_s,
                measured=shown.torque,
                modelled=shown.torque - shown.residual,
            ),
        ),
        essential=_essential(
            equations,
            solution,
            base_names,
            places[base.independent],
            combined @ unknowns.linear(point),
            unknowns.bends,
        ),
        stated_doubts=doubts(equations, unknowns, solution, by_unknown, base_names),
        model=robot.model(
            dict(zip(names[:n_own], values[:n_own].tolist(), strict=True)), names[:n_own], own[:n_own, :n_own]
        ),
    )
