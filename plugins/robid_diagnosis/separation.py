"""The next experiment that tells a cause from what explains the data as well.

Every proposed experiment is simulated with the robot that was found, its motion prescribed to that robot and to its
rivals, and the torques compared in standard deviations of noise and model error. What the unknowns of a hypothesis can
take up of the difference does not count (`expected_ratio.py`). The pair's smaller ratio counts, since either may be
right; of several rivals the one that is told worst.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robid_core import ComplexArray, FloatArray, Record, RobidError, Robot, SeparatingExperiment
from robid_core.residual import Linearisation, TorqueProblem, linearise_at
from robid_diagnosis.expected_ratio import expected_ratio
from robid_diagnosis.hypothesis import Case, Fitted
from robid_diagnosis.proposals import Proposals, proposals
from robid_diagnosis.steps import Step
from robid_diagnosis.wording import load_text, place_text

MOST = 3  # rivals: the best
MOSTLY = 0.5  # of a torque at rest that is gravity's, by name

Progress = Callable[[float, float, str], None]


@dataclass(frozen=True, eq=False)
class Predicted:
    """The torque that a fitted hypothesis predicts for new records."""

    problem: TorqueProblem
    point: FloatArray
    about: Linearisation
    torque: list[ComplexArray]
    """Without the delay, N m, (n_config, n_exp, n_bin, n_axis) of each block."""

    @classmethod
    def of(cls, fitted: Fitted, record: Record) -> Predicted:
        """Prescribe the motion of a record to the robot as it was fitted to others."""
        problem, point = fitted.case.problem(fitted.hypothesis, (record,)), fitted.point
        about = linearise_at(problem, point, fitted.model_error)
        if problem.robots(point)[0].signals:  # along the torques that the first round expects
            about = linearise_at(problem, point, fitted.model_error)
        return cls(problem, point, about, problem.predicted(point))

    def rows(self, weights: Linearisation) -> tuple[FloatArray, ...]:
        """Derivatives of each configuration with the weights of another hypothesis, (n_row, n_unknown) each."""
        return self.problem.linearise(self.point, weights.weights).rows

    def less(self, other: Predicted) -> list[FloatArray]:
        """Difference of the torques that drives report, in this one's standard deviations, (n_row,) of each lane."""
        late = self.problem.delay(self.point) - other.problem.delay(other.point)
        (block,), (weight,) = self.problem.blocks, self.about.weights
        turn = np.exp(-1j * block.motion.omega[:, None] * late)
        difference = turn * self.torque[0] - other.torque[0]
        return list(weight.residual(difference).reshape(len(difference), -1))


def separation(
    case: Case,
    robot: Robot,
    final: Fitted,
    step: Step,
    generator: np.random.Generator,
    progress: Progress,
) -> SeparatingExperiment | None:
    """Return the experiment with the largest ratio a minute; None where none could be tried, or nothing is tied.

    Parameters
    ----------
    case
        Records and the robot that was told.
    robot
        The one that was found, friction of its motors in it.
    final, step
        How it was fitted, and the cause that is in question.
    """
    records = case.nominal_records  # simulated under the robot that was found, which carries nothing more
    if not records:
        return None
    rivals = [one.fitted for one in step.rivals[:MOST]]
    if not rivals:
        return None
    names = tuple(place_text(*tie) for tie in step.ties[:MOST])
    found: list[tuple[Proposals, FloatArray]] = []
    for proposed in proposals(records, robot, case.discard, generator):
        progress(len(found), len(found) + 1, "experiments that could separate ties")
        try:
            found.append((proposed, ratios(final, rivals, proposed.record)))
        except RobidError:
            continue
    if not found:
        return None
    return _best(robot, records, step, names, found)


def ratios(final: Fitted, rivals: Sequence[Fitted], record: Record) -> FloatArray:
    """Expected logarithm of the likelihood ratio for each rival and configuration of a record, (n_rival, n_config)."""
    own = Predicted.of(final, record)
    found = []
    for rival in rivals:
        other = Predicted.of(rival, record)
        lanes = zip(own.less(other), own.about.rows, other.rows(own.about), strict=True)
        found.append(
            [
                min(
                    expected_ratio(difference, mine, final.about.whole),
                    expected_ratio(difference, its, rival.about.whole),
                )
                for difference, mine, its in lanes
            ]
        )
    return np.array(found)


def _best(
    robot: Robot,
    records: Sequence[Record],
    step: Step,
    names: tuple[str, ...],
    found: Sequence[tuple[Proposals, FloatArray]],
) -> SeparatingExperiment:
    """Choose among the experiments of all proposals, with their ratios (n_rival, n_lane)."""
    ratio = np.concatenate([own for _, own in found], axis=1)
    lanes = [(proposed, lane) for proposed, own in found for lane in range(own.shape[1])]
    duration = np.array([proposed.duration_s for proposed, _ in lanes])
    repeats = np.array([proposed.amplitude == 1.0 and bool(proposed.recorded[i]) for proposed, i in lanes])
    told = ratio.max(axis=1) >= SeparatingExperiment.TELLING
    worst = ratio[told].min(axis=0) if told.any() else ratio.max(axis=0)
    best = int(np.argmax(worst / duration))
    proposed, lane = lanes[best]
    angle = proposed.record.angle[lane]
    recorded = np.concatenate([record.angle for record in records])
    axis = robot.axis_names.index(step.on) if step.on in robot.axis_names else None
    difference = ""
    if axis is not None and not (proposed.recorded[lane]):
        here, there = robot.gravity_torque(angle[None])[0, axis], robot.gravity_torque(recorded)[:, axis]
        difference = load_text(robot.axis_names[axis], float(here), there, _load(robot, axis, recorded))
    return SeparatingExperiment(
        rivals=names,
        amplitude=proposed.amplitude,
        duration_s=proposed.duration_s,
        n_period=proposed.record.run.n_period,
        n_settling=proposed.n_settling,
        difference=difference,
        configuration=angle,
        reference=proposed.reference[lane],
        ratio=ratio[:, best],
        repeat=ratio[:, repeats].max(axis=1) if repeats.any() else np.full(len(names), np.nan),
        line=proposed.record.line,
    )


def _load(robot: Robot, axis: int, angle: FloatArray) -> str:
    """What loads an axis at rest in some configurations: mostly gravity, or effects (a cable, a counterbalance)."""
    try:
        whole, weight = (
            np.abs(one.gravity_torque(angle)[:, axis]).max()
            for one in (robot, robot.without_effect(*robot.description.effects))
        )
    except RobidError:  # without its counterbalance an arm may fall
        return "static"
    return "gravity" if weight >= MOSTLY * whole else "static"
