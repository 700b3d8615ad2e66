"""What the simulation gets wrong, and why: effects of the catalogue held against the torque that was measured.

First all that the model has is refitted: springs, dampers, friction, inertia within what drawings promise, a delay of
each torque. What is left is held against every effect at every place, strangers' included; the best are put into the
robot and fitted with all else, and taken where they are significant after the search. So it goes on until nothing is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Literal

from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from robid_core import (
    MILESTONE,
    AxisKey,
    ConfigurationError,
    Context,
    Diagnosis,
    DiagnosisStage,
    Model,
    PredictionErrors,
    Record,
    RobidError,
    Robot,
    RobotName,
    SearchRecord,
    SeparatingExperiment,
    StageRef,
)
from robid_core.estimation.copies import refuse_copies
from robid_core.residual import (
    check_variants,
    effect_names,
    leading_periods,
    misfit_table,
    refuse_weightless,
    variant_robots,
)
from robid_diagnosis.asked import asked_lines, nearest_lines
from robid_diagnosis.asked_effects import wrong_names
from robid_diagnosis.candidates import catalogue
from robid_diagnosis.comparison import has_references
from robid_diagnosis.completeness import are_partial
from robid_diagnosis.diagnosable import check_records, check_related
from robid_diagnosis.free_motion import closed_loop_errors
from robid_diagnosis.gear_ratio import gear_ratio_lines
from robid_diagnosis.hardly_told import hardly_told
from robid_diagnosis.hypothesis import Case, Fitted, Hypothesis
from robid_diagnosis.impossible_motion import check_possible
from robid_diagnosis.judgement import errors_of, parted
from robid_diagnosis.parts import cut_into_parts
from robid_diagnosis.reservations import reservations
from robid_diagnosis.residual_curves import residual_curves
from robid_diagnosis.response_check import Chain, disagreements, response_check_of
from robid_diagnosis.results import (
    data_of,
    finding_of,
    model_of,
    unknown_of,
    values_of,
    with_unknown,
)
from robid_diagnosis.second_search import searched_without_turns
from robid_diagnosis.selection import Selection
from robid_diagnosis.separation import separation
from robid_diagnosis.settling import unsettled_axes
from robid_diagnosis.steps import Outcome, Step
from robid_diagnosis.sticking import with_sticking_axes
from robid_diagnosis.timing import held_torque_line, timing_lines, timing_of
from robid_diagnosis.trials import DOUBTFUL
from robid_diagnosis.wording import (
    data_line,
    errors_line,
    finding_line,
    held_line,
    increment_line,
    left_out_line,
    misfit_line,
    own_friction_line,
    response_check_line,
    rests_line,
    separation_line,
    settling_line,
    silent_line,
    sticking_line,
    untried_line,
    values_line,
)


class Effects(DiagnosisStage):
    """Finds which effects the model lacks, adds them to it, and says how much better it predicts.

    Effects on forces and signals are searched, and changes of the robot itself: foundations, elastic coordinates,
    coupled axes. Bodies, rotors and springs whose values in the robot file are wrong are reported. Experiments that
    separate ties are recorded motions, slower or faster, in other configurations; of more than three rivals the best
    are compared.

    Records may be of several variants (payloads, tools): all share springs, friction and what is found; `robots:` gives
    the robot file of each that is not the nominal one, with its payload as an effect (`load.payload`), whose values may
    turn out to be wrong. Experiments of the role `test` are used only for the final prediction error.

    Where records give frequency responses, stiffnesses are estimated from them, too (`response_check`).

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
    """Standard deviations of parameters of the robot file by pattern, in natural scales (0.01: one percent)."""
    model_error: PositiveFloat = 2e-4
    """Relative error of the model's torque per bin and axis, beside the noise.

    Half of it may be alike in all bins: what gains less than such an error could is not named."""
    at_rest: Literal["leave_out", "keep"] = "leave_out"
    """What becomes of samples at which friction holds an axis by any torque up to its level: where it stands still, in
    motions that do not repeat, and where it turns back more abruptly than its angle resolves."""
    passes: PositiveInt = 12
    """Prescribed motions of a fit at most."""
    discard: NonNegativeInt | None = None
    """Leading periods dropped as transient; null: decided from the data, as many as differ from those after them."""
    blocks: Annotated[int, Field(ge=1, le=100)] = 1
    """Blocks into which each experiment that does not repeat is cut: a cause must be seen in each of them."""
    skip_s: NonNegativeFloat = 0.0
    """Left out at the beginning of each such experiment."""
    separate: bool = True
    """Whether to search, by simulation, for the experiment that distinguishes tied causes."""
    closed_loop: bool | None = None
    """Whether the nominal, the refitted and the extended robot are simulated under the recorded references, with the
    controllers of the robot file; null: where references were recorded and the file gives the controllers."""
    robots: dict[str, RobotName] = {}
    """Robots under which variants were measured, where they are not the nominal one: `{loaded: arm.yaml}`."""

    constants: dict[str, str] = {}
    """Constants of the records that are parameters of the robot, `{payload_kg: effect.load.mass}`: each variant's robot
    has the value of its experiments, and needs no file under `robots`."""

    response_check: tuple[StageRef, ...] = (
        StageRef(use="compensate.friction"),
        StageRef(use="frf.lrm"),
        StageRef(use="fit.log_response", with_={"starts": 1}),
    )
    """Stages from a record to a fit of its responses, an independent estimate of the stiffnesses; []: no check.

    Those that prepare the record are left out where it lacks what they take."""

    handles_variants: ClassVar[bool] = True

    def uses(self) -> list[tuple[str, str]]:
        """Every effect that is tried, and may come into the robot."""
        return [("robid.effects", name) for name in self._asked()]

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """What a closed loop takes, where it is asked for; else it is left out where the file lacks it."""
        return ("torque_limit", "controller") if self.closed_loop else ()

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """Effects, and places of them, that there are not."""
        return dict(wrong_names(robot, self.only, self.exclude))

    def run(self, record: tuple[Record, ...], robot: Robot, context: Context) -> Diagnosis:
        """Refit, search, extend, tell."""
        for place, message in self.problems_with(robot).items():
            raise ConfigurationError(f"{place[0]}: {message}")
        uses, whole, chain = self._asked(), record, Chain.of(self.response_check)
        refuse_copies(record)
        missing = robot.left_out(("torque_limit",)) if self.separate else ""
        if missing:
            context.log.log(MILESTONE, "experiments that separate ties will not be simulated: %s", missing)
        record = tuple(cut_into_parts(one, self.blocks, self.skip_s) for one in record)
        robot, robots = variant_robots(record, robot, self.robots, self.constants)
        discard = leading_periods(record, self.discard, context.log)
        case, tests = self._case(record, robot, robots, discard)
        selection = self._selection(case, uses, context)
        outcome = selection.run()
        selection, outcome, unseen = searched_without_turns(
            selection, outcome, lambda other: self._selection(other, uses, context), context
        )
        check_related(outcome.final)
        for one in self.only:
            if one.partition("@")[0] not in outcome.searches[0].tried:
                raise ConfigurationError(
                    f"diagnosis.effects: '{one}' could be tried nowhere in {robot.name}; masses, rotors and "
                    "springs are refitted in any case"
                )
        return self._told(robot, whole, tests, selection, outcome, unseen, chain, context)

    def _selection(self, case: Case, uses: Sequence[str], context: Context) -> Selection:
        return Selection(
            case, uses, self._places(), context.generator, context.progress, self.most, context.log
        )

    def _case(
        self, records: tuple[Record, ...], robot: Robot, robots: Mapping[str, Robot], discard: int
    ) -> tuple[Case, tuple[Record, ...]]:
        """What is diagnosed, and the experiments that judge it; all that cannot be is refused here."""
        for one in (robot, *robots.values()):
            refuse_weightless(one)
        check_variants(records, robot, robots, ())
        training, tests = parted(records)
        check_records(records, training, robot)
        check_possible(records, robot)
        case = Case(
            training, robot, self.prior, self.highest_hz, discard, self.passes, self.model_error,
            robots=robots, leave_out_rests=self.at_rest == "leave_out", held_out=tests,
        )  # fmt: skip
        case = with_sticking_axes(case, records) if case.leave_out_rests else case
        if tests:
            case.problem(Hypothesis(), tests)
        return case, tests

    def _asked(self) -> list[str]:
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
        tests: tuple[Record, ...],
        selection: Selection,
        outcome: Outcome,
        unseen: Sequence[str],
        chain: Chain,
        context: Context,
    ) -> Diagnosis:
        case, final = selection.case, outcome.written
        problem = final.problem
        model = model_of(robot, final)
        whole = case.variants.whole
        hardly = hardly_told(outcome.motion, final.hypothesis.additions)
        causes = tuple(
            finding_of(
                whole,
                final,
                step,
                partial,
                self._separation(step, case, outcome.final, model, context),
                hardly,
            )
            for step, partial in zip(outcome.steps, are_partial(outcome), strict=True)
        )
        timing, data = timing_of(final), data_of(case, final, tests)
        response_check = (
            response_check_of(chain, case, final, model, timing, context) if self.response_check else None
        )
        unknown = unknown_of(outcome)
        causes = with_unknown(causes, unknown)
        findings = (*causes, *disagreements(response_check))
        lines = [settling_line(unsettled_axes(problem))]
        lines += [
            line
            for finding in causes
            for line in (
                finding_line(finding, data.n_config, sum(problem.left_out), [one.on for one in unknown]),
                increment_line(finding, robot),
                separation_line(finding),
            )
        ]
        lines.append(own_friction_line(causes, robot))
        lines += nearest_lines(outcome, () if self.only else unknown, selection.refused)
        lines += hardly.values()
        values = values_of(final)
        lines.append(held_torque_line(case.torque_held_s, timing.sample_time_s))
        lines += [*timing_lines(timing, final.misfit, case.torque_held_s), values_line(values, final.misfit)]
        lines += [held_line(final.hypothesis.held), left_out_line(problem.left_out, data.n_experiment)]
        lines.append(rests_line(robot.axis_names, problem.at_rest.tolist()))
        lines.append(sticking_line(unseen))
        lines += gear_ratio_lines(causes, values)
        if response_check is not None:
            lines.append(response_check_line(response_check))
        if data.n_config == 1:
            lines.append("One configuration: nothing was held out in another pose.")
        asked = asked_lines(outcome, causes, selection.refused) if self.only else []
        lines.append(
            silent_line(
                robot.axis_names, findings, final.misfit > DOUBTFUL, bool(asked and selection.refused)
            )
        )
        lines += asked
        refitted = outcome.base if outcome.steps else final
        lines.append(misfit_line(refitted.misfit, final.misfit if outcome.steps else None))
        errors, gain = errors_of(case, tests, robot, outcome, context.generator)
        moving, moving_line = self._moving(records, case, outcome, context)
        lines += [errors_line(errors, gain), moving_line]
        lines.append(untried_line([one.use for one in outcome.searches[-1].failures if one.on is None]))
        if final.misfit > DOUBTFUL:
            lines.append(f"Left unexplained: misfit {final.misfit:.3g}.")
        lines.append(data_line(data))
        failed = tuple(
            f"{one.where}: {one.reason}" for one in (*outcome.searches[-1].failures, *selection.failures)
        )
        tried = outcome.searches[0].tried
        excluded = tuple(name for name in effect_names() if name not in tried)
        left = misfit_table(problem, final.point)
        return Diagnosis(
            method="effects held against the torque residual",
            verdict="\n".join(line for line in lines if line),
            findings=findings,
            errors=(*errors, *moving),
            values=values,
            search=SearchRecord(
                outcome.searches[0].n_tried,
                outcome.searches[0].trials,
                tried,
                excluded,
                failed,
                outcome.visible,
            ),
            timing=timing,
            left=left,
            doubts=reservations(findings, final.misfit, left),
            data=data,
            residuals=residual_curves(refitted, final, outcome.motion),
            model=model,
            response_check=response_check,
        )

    def _moving(
        self, records: tuple[Record, ...], case: Case, outcome: Outcome, context: Context
    ) -> tuple[tuple[PredictionErrors, ...], str]:
        """Errors in closed loop, and a line about them: nothing without references, unless they are asked for."""
        asked = has_references(records) if self.closed_loop is None else self.closed_loop
        if not asked:
            return (), ""
        training, tests = parted(records)
        try:
            errors, gain = closed_loop_errors(
                case, tests or training, bool(tests), outcome, context.generator, context.progress
            )
        except RobidError as error:
            if self.closed_loop:
                raise
            return (), f"The closed loop could not be simulated: {error}"
        return errors, errors_line(errors, gain)

    def _separation(
        self, step: Step, case: Case, final: Fitted, model: Model, context: Context
    ) -> SeparatingExperiment | None:
        """Return the experiment that tells a cause from its ties."""
        if not (self.separate and step.rivals):
            return None
        (generator,) = context.generator.spawn(1)  # what is drawn afterwards stays as it is
        try:
            best = separation(case, Robot.of_model(model), final, step, generator, context.progress)
        except RobidError as error:
            context.log.warning("experiments that separate ties could not be simulated: %s", error)
            return None
        if best is None:
            context.log.warning(
                "experiments that separate ties could not be simulated: the recorded motions leave the robot's limits, "
                "or the robot file's drives cannot follow them"
            )
        return best
