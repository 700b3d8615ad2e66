"""What the simulation gets wrong, and why: effects of the catalogue held against the torque that was measured.

First all that the model has is refitted: springs, dampers, friction, inertia within what drawings promise, a delay of
each torque. What is left is held against every effect at every place, strangers' included; the best are put into the
robot and fitted with all else, and taken where they are significant after the search. So it goes on until nothing is.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Annotated

import numpy as np
import scipy
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from robid_core import (
    ComplexArray,
    ConfigurationError,
    Context,
    DataRejected,
    Diagnosis,
    DiagnosisStage,
    Finding,
    FloatArray,
    Model,
    ParameterTable,
    PredictionErrors,
    Record,
    Robot,
    SearchRecord,
)
from robid_core.registry import EFFECTS
from robid_core.residual import estimated_robot
from robid_diagnosis.candidates import catalogue
from robid_diagnosis.hypothesis import Case, Fitted
from robid_diagnosis.intervals import intervals, relative_errors
from robid_diagnosis.selection import DOUBTFUL, LEAST, NAMED, Outcome, Selection, Step
from robid_diagnosis.wording import asked_line, finding_line, silent_line, timing_lines

CAUSE = 0.9  # of the gain of free functions: what explains less is a part of the cause
STILL = 1e-3  # of travel at the joint, rad or m
FEWEST = 4  # experiments, all configurations together: fewer cannot be held out


class Effects(DiagnosisStage):
    """Names what a model lacks, extends it, and says how much better it is.

    Effects on forces and signals are searched; of bodies, rotors and springs it says whether they are told wrong. Not
    searched yet: changes of the structure (elastic coordinates, foundations), and records of several payloads.

    Example::

        explain: {use: diagnosis.effects, inputs: {record: verify}}
    """

    only: tuple[str, ...] = ()
    """Effects that are tried, `friction.stribeck`, or effects at one place, `friction.stribeck@axis_2`; empty: all."""
    exclude: tuple[str, ...] = ()
    """Effects that are not."""
    most: Annotated[int, Field(ge=0, le=20)] = 5
    """Findings at most; 0: only the refit and the search."""
    highest_hz: PositiveFloat = 100.0
    """Bins above are left out."""
    prior: dict[str, PositiveFloat] = {}
    """Standard deviations of told parameters by pattern, in natural scales (0.01: one percent)."""
    model_error: PositiveFloat = 5e-4
    """Relative error of the model's torque per bin and axis, beside the noise."""
    passes: PositiveInt = 12
    """Prescribed motions of a fit at most."""
    discard: NonNegativeInt = 0
    """Leading periods dropped as transient."""

    def uses(self) -> list[tuple[str, str]]:
        """Every effect that is tried, and may come into the robot."""
        asked = {one.partition("@")[0] for one in self.only}
        return [(EFFECTS, name) for name in catalogue(self.exclude) if not asked or name in asked]

    def run(self, record: tuple[Record, ...], robot: Robot, context: Context) -> Diagnosis:
        """Refit, search, extend, tell."""
        uses = self._uses()
        records = tuple(_trained(one) for one in record)
        _check(records, robot)
        case = Case(records, robot, self.prior, self.highest_hz, self.discard, self.passes, self.model_error)
        selection = Selection(case, uses, self._places(), context.generator, context.progress, self.most)
        outcome = selection.run()
        return self._told(robot, records, selection, outcome, uses, context)

    def _uses(self) -> list[str]:
        known = catalogue()
        for name in (*(one.partition("@")[0] for one in self.only), *self.exclude):
            if name not in known:
                near = difflib.get_close_matches(name, known, n=1)
                hint = f"did you mean '{near[0]}'?" if near else f"there are {', '.join(known)}"
                raise ConfigurationError(f"diagnosis.effects: there is no effect '{name}'; {hint}")
        return catalogue(self.exclude, [one.partition("@")[0] for one in self.only])

    def _places(self) -> dict[str, set[str]]:
        """Axes, bearings or bodies at which an effect is tried, of those that are tried at some only."""
        places: dict[str, set[str]] = {}
        for use, at, on in (one.partition("@") for one in self.only):
            if at:
                places.setdefault(use, set()).add(on)
        return places

    def _told(
        self,
        robot: Robot,
        records: tuple[Record, ...],
        selection: Selection,
        outcome: Outcome,
        uses: list[str],
        context: Context,
    ) -> Diagnosis:
        final = outcome.final
        problem = final.problem
        findings = tuple(_finding(robot, final, step) for step in outcome.steps)
        findings += _unknown(outcome)
        n_config = sum(len(block.motion.angle) for block in problem.blocks)
        lines = [finding_line(finding, n_config) for finding in findings]
        deviation = np.sqrt(np.diag(final.solution.covariance))[-problem.n_delay :]
        delay = problem.delay(final.point)
        lines += timing_lines(robot.axis_names, delay, deviation, problem.blocks[0].motion.sample_time_s)
        lines.append(silent_line(robot.axis_names, findings, final.misfit > DOUBTFUL))
        if self.only:
            last = outcome.searches[-1]
            lines += [asked_line(*hit.candidate.key, hit.gain.total, last.p_value(hit)) for hit in last.hits]
        lines.append(
            f"Misfit {outcome.base.misfit:.3g} with all values refitted"
            + (f", {final.misfit:.3g} with what was found." if outcome.steps else ".")
        )
        if final.misfit > DOUBTFUL:
            lines.append(f"Left unexplained: misfit {final.misfit:.3g}.")
        failed = tuple(
            f"{one.use} at {one.on} ({one.side}): {one.reason}"
            for one in (*outcome.searches[-1].failures, *selection.failures)
        )
        excluded = tuple(name for name in catalogue() if name not in uses)
        return Diagnosis(
            method="effects held against the torque residual",
            verdict="\n".join(line for line in lines if line),
            findings=findings,
            errors=_errors(records, robot, outcome, context.generator),
            values=_values(final),
            search=SearchRecord(
                outcome.searches[0].n_tried, outcome.searches[0].trials, tuple(uses), excluded, failed
            ),
            model=_model(robot, selection.case, final),
        )


def _trained(record: Record) -> Record:
    """Return the experiments that are not held out for tests."""
    if any(run.test is not None and run.test.any() for run in record.runs):
        assert record.run.test is not None
        return record.part(~record.run.test)
    return record


def _check(records: Sequence[Record], robot: Robot) -> None:
    """Refuse in one sentence what cannot be diagnosed."""
    for record in records:
        if record.axis_names != robot.axis_names:
            raise DataRejected(
                f"the record has the axes {', '.join(record.axis_names)}, the robot {robot.name} has "
                f"{', '.join(robot.axis_names)}; take the robot that was measured"
            )
    runs = [run for record in records for run in record.runs]
    for name in ("motor_position", "motor_torque"):
        if any(name not in run.channels for run in runs):
            raise DataRejected(f"the record has no {name}; a diagnosis needs angle and torque of every motor")
    n_experiment = sum(run.valid[..., 0, 0].size for run in runs)
    if n_experiment < FEWEST:
        raise DataRejected(
            f"{n_experiment} experiments: what is found must hold in data that were held out; measure at least "
            f"{FEWEST}, better in several configurations"
        )
    for run in runs:
        still = np.ptp(run.lanes("motor_torque").reshape(-1, robot.n_axis), axis=0) == 0
        if still.any():
            axis = robot.axis_names[int(np.argmax(still))]
            raise DataRejected(
                f"the torque of {axis} never changes: the channel is dead, or the drive was off"
            )


def _finding(robot: Robot, final: Fitted, step: Step) -> Finding:
    names = step.names
    estimates = [final.estimate(name) for name in names]
    told = [robot.parameter(name) if name in robot.layout else float("nan") for name in names]
    if step.kind != "effect":
        kind = "value"
    elif not step.share < CAUSE:
        kind = "cause"
    else:
        kind = "partial"
    picture = step.picture
    return Finding(
        kind=kind,
        effect=step.use,
        on=step.on or "",
        side=step.side or "",
        names=tuple(name.rpartition(".")[2] if step.kind == "effect" else name for name in names),
        units=tuple(final.problem.free.robot.parameter_unit(name) for name in names),
        told=np.array(told),
        value=np.array([value for value, _ in estimates]),
        standard_error=np.array([error for _, error in estimates]),
        gain=step.gain,
        p_value=step.p_value,
        share=step.share,
        ties=tuple(f"{use} at {on}" + (f" ({side})" if side else "") for use, on, side in step.ties),
        by_configuration=step.by_configuration,
        held_out=step.held_out,
        variable=picture.variable if picture else "",
        abscissa=picture.abscissa if picture else None,
        residual=picture.residual if picture else None,
        explained=picture.explained if picture else None,
    )


def _unknown(outcome: Outcome) -> tuple[Finding, ...]:
    """What no effect explains and free functions of some variable would."""
    left = outcome.left
    least = LEAST * max(1.0, outcome.final.misfit) + NAMED * sum(step.gain for step in outcome.steps)
    if left is None or left.gain <= least:
        return ()
    none = np.empty(0)
    return (
        Finding(
            kind="unknown",
            effect=f"a function of {left.variable}",
            on=left.axis,
            side="",
            gain=left.gain,
            p_value=float(outcome.searches[-1].trials * scipy.stats.chi2.sf(left.gain, left.freedom)),
            share=float("nan"),
            names=(),
            units=(),
            told=none,
            value=none,
            standard_error=none,
            by_configuration=none,
            held_out=none,
        ),
    )


def _errors(
    records: Sequence[Record], robot: Robot, outcome: Outcome, generator: np.random.Generator
) -> tuple[PredictionErrors, ...]:
    """Torque that each model leaves, of that which was measured; experiments are drawn again for intervals."""
    models = {"robot file, values refitted": outcome.base, "extended robot": outcome.final}
    if not outcome.steps:
        models.popitem()
    runs = [run for record in records for run in record.runs]
    travels = [np.ptp(robot.joint_angle(run.lanes("motor_position")), axis=1) for run in runs]
    still = np.concatenate(travels).max(axis=0) < STILL
    error, power = [], None
    for fitted in models.values():
        residuals = fitted.problem.residuals(fitted.point)
        error.append(_sums(residuals))
        power = _sums([block.motion.torque_spectrum for block in fitted.problem.blocks])
    assert power is not None
    errors = np.stack(error)
    found = intervals(errors, power, generator)
    relative = relative_errors(errors.sum(axis=1), power.sum(axis=0))
    return tuple(
        PredictionErrors(
            model=name,
            quantity="torque that the model leaves, all bins but the mean",
            unit_symbol=records[0].runs[0].channel("motor_torque").unit_symbol,
            axis_names=robot.axis_names,
            rms=np.sqrt(2 * errors[m].mean(axis=0)),
            relative=relative[m],
            low=found.relative[0, m],
            high=found.relative[1, m],
            still=still,
        )
        for m, name in enumerate(models)
    )


def _sums(spectra: Sequence[ComplexArray]) -> FloatArray:
    """Power of each experiment, the mean left out, (n_experiment, n_axis)."""
    return np.concatenate(
        [(np.abs(one[:, :, 1:]) ** 2).sum(axis=2).reshape(-1, one.shape[-1]) for one in spectra]
    )


def _values(final: Fitted) -> ParameterTable:
    """All parameters of the robot that were estimated: told, found, how sure."""
    problem = final.problem
    robot, names = problem.free.robot, problem.free.names
    rows = [final.estimate(name) for name in names]
    told = problem.free.start
    slope = problem.free.jacobian(final.point[: problem.n_free])
    prior = np.sqrt(((slope * problem.prior[: problem.n_free]) ** 2).sum(axis=1))
    kinds = tuple(robot.parameter_kind(name) for name in names)
    return ParameterTable(
        names=names,
        units=tuple(robot.parameter_unit(name) for name in names),
        groups=kinds,
        start=told,
        estimate=np.array([value for value, _ in rows]),
        standard_error=np.array([error for _, error in rows]),
        reported=np.array([kind in ("stiffness", "effect") for kind in kinds]),
        at_bound=np.zeros(len(names), dtype=bool),
        prior=prior,
    )


def _model(robot: Robot, case: Case, final: Fitted) -> Model:
    """The robot that was found, effects and all."""
    problem = final.problem
    extended = final.hypothesis.robot(robot)
    if case.friction_speed is not None:
        extended = extended.with_parameters(
            {
                f"friction.{axis}.speed": float(width)
                for axis, width in zip(robot.axis_names, case.friction_speed, strict=True)
            }
        )
    motions = [block.motion for block in problem.blocks]
    laws = problem.blocks[0].laws
    return estimated_robot(extended, motions, laws, problem.free, final.point, final.solution.covariance)
