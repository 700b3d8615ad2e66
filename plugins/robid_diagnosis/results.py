"""What a search told, as artifacts: findings, values, the extended robot."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import scipy

from robid_core import (
    DiagnosedData,
    Finding,
    Model,
    Parameter,
    ParameterTable,
    Record,
    Robot,
    SeparatingExperiment,
)
from robid_core.residual import effect_class, estimated_robot, friction_of_motors, parts_by_variant
from robid_diagnosis.completeness import still_gains
from robid_diagnosis.hypothesis import Case, Fitted
from robid_diagnosis.least_gains import LeastGains
from robid_diagnosis.selection import LEVEL
from robid_diagnosis.steps import Outcome, Step
from robid_diagnosis.wording import FREE, place_text


def finding_of(
    robot: Robot,
    final: Fitted,
    step: Step,
    partial: bool,
    separation: SeparatingExperiment | None = None,
    hardly: Collection[str] = (),
) -> Finding:
    """Return a cause that was accepted, with the values that the last fit gives it, and what tells it from its ties.

    `robot` has all that was told, the loads of all variants too; `partial`: whether it is a part of what acts there;
    `hardly`: numbers of which no error is stated, since the data do not determine them; nor is one of what is held.
    """
    added = [one.names for one in final.hypothesis.additions if set(one.names) & set(step.names)]
    known = dict.fromkeys((*step.names, *(name for names in added for name in names)))
    names = tuple(name for name in known if name in final.problem.free.names)  # others data do not tell
    estimates = [final.estimate(name) for name in names]
    told = [robot.parameter(name) if name in robot.layout else float("nan") for name in names]
    held = _held(final, step)
    kind = "value" if step.kind != "effect" else "partial" if partial else "cause"
    picture = step.picture
    return Finding(
        kind=kind,
        effect=step.use,
        on=step.on or "",
        side=step.side or "",
        names=(
            *(name.rpartition(".")[2] if step.kind == "effect" else name for name in names),
            *(row.name for row, _ in held),
        ),
        units=(
            *(final.problem.free.robot.parameter_unit(name) for name in names),
            *(row.unit for row, _ in held),
        ),
        nominal=np.array([*told, *(np.nan for _ in held)]),
        value=np.array([*(value for value, _ in estimates), *(value for _, value in held)]),
        standard_error=np.array(
            [
                *(
                    np.nan if name in hardly else error
                    for name, (_, error) in zip(names, estimates, strict=True)
                ),
                *(np.nan for _ in held),
            ]
        ),
        gain=step.gain,
        p_value=step.p_value,
        share=step.share,
        ties=(*(place_text(*tie) for tie in step.ties), *([step.as_well] if step.as_well else [])),
        by_configuration=step.by_configuration,
        held_out=step.held_out,
        by_own_size=step.by_own_size,
        variable=picture.variable if picture else "",
        abscissa=picture.abscissa if picture else None,
        residual=picture.residual if picture else None,
        explained=picture.explained if picture else None,
        separation=separation,
    )


def _held(final: Fitted, step: Step) -> list[tuple[Parameter, float]]:
    """Sizes of a cause that are held, since data do not determine them, and are neither zero nor as by default.

    Without them the numbers that are estimated say another law. Sizes may be zero, shapes may not.
    """
    return [
        (row, one.values[row.name])
        for one in final.hypothesis.additions
        if set(one.names) & set(step.names)
        for row in effect_class(one.use).parameters
        if row.name not in one.free and row.lower <= 0 and one.values[row.name] not in (0.0, row.default)
    ]


def unknown_of(outcome: Outcome) -> tuple[Finding, ...]:
    """What no effect explains and free functions of some variable would; nothing where no more than noise is left.

    Free functions also gain where told numbers need not leave their tolerances for them, which data do not show. The
    misfit of all data hides what is small beside a cause: there they are asked by themselves.
    """
    left = outcome.left[0]
    if outcome.final.leaves_noise and not (outcome.steps and still_gains(left, outcome)):
        return ()
    least = LeastGains.beside(outcome.final, [step.gain for step in outcome.steps], careful=True)
    p_value = min(1.0, outcome.searches[-1].trials * float(scipy.stats.chi2.sf(left.gain, left.freedom)))
    if left.gain <= least.at(least.axis_names.index(left.axis)) or p_value > LEVEL:
        return ()
    return (unknown(f"{FREE}{left.variable}", left.axis, left.gain, p_value),)


def unknown(effect: str, on: str, gain: float, p_value: float) -> Finding:
    """Return a finding without a cause: what is there, where, how much of twice the log-likelihood it is."""
    none = np.empty(0)
    return Finding(
        kind="unknown",
        effect=effect,
        on=on,
        side="",
        gain=gain,
        p_value=p_value,
        share=float("nan"),
        names=(),
        units=(),
        nominal=none,
        value=none,
        standard_error=none,
        by_configuration=none,
        held_out=none,
        by_own_size=none,
    )


def with_unknown(findings: tuple[Finding, ...], unknown: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Return all findings; a cause at whose axis something is left that no effect explains is a part of it."""
    left = {one.on for one in unknown}
    return (
        *(one.replace(kind="partial") if one.kind == "cause" and one.on in left else one for one in findings),
        *unknown,
    )


def values_of(final: Fitted) -> ParameterTable:
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


def data_of(case: Case, final: Fitted, tests: Sequence[Record]) -> DiagnosedData:
    """What was looked at."""
    blocks = final.problem.blocks
    shapes = [block.motion.angle.shape for block in blocks]
    variants = (variant for one in case.records for variant, _ in parts_by_variant(one))
    return DiagnosedData(
        n_config=sum(n_config for n_config, *_ in shapes),
        n_experiment=sum(n_config * n_experiment for n_config, n_experiment, *_ in shapes),
        n_test=sum(run.valid[..., 0, 0].size for one in tests for run in one.runs),
        highest_hz=case.highest_hz,
        noise=tuple(dict.fromkeys(block.noise_source for block in blocks)),
        variants=tuple(dict.fromkeys(variant for variant in variants if variant)),
        n_left_out=sum(final.problem.left_out),
        seconds=sum(run.valid.size * run.sample_time_s for one in case.records for run in one.runs),
        sources=tuple(dict.fromkeys(one.source for one in case.records)),
    )


def model_of(robot: Robot, final: Fitted) -> Model:
    """A robot of the diagnosis as it was found, effects and all; what other variants carry is no part of it.

    The zero-speed width of its friction is that of the functions of speed as the last fit has them.
    """
    problem = final.problem
    extended = final.hypothesis.robot(robot)
    width = final.case.with_fitted_width(final).friction_speed
    assert width is not None
    widths = dict(zip((f"friction.{axis}.speed" for axis in robot.axis_names), width.tolist(), strict=True))
    free = problem.free.without(lambda name: name not in extended.layout)
    own = [name in free.names for name in problem.free.names]
    rows = np.flatnonzero(np.append(own, np.ones(problem.n_unknown - problem.n_free, dtype=bool)))
    laws = problem.blocks[0].laws
    point, covariance = final.point[rows], final.solution.covariance[np.ix_(rows, rows)]
    wide = extended.with_parameters(widths)
    friction = friction_of_motors(wide, problem.speeds(), laws, free, point, covariance, held=widths)
    return estimated_robot(extended, laws, free, point, covariance, friction)
