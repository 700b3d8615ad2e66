"""Ties of two causes, the experiment that is to tell them apart, and that measured there they are told apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid_core import (
    Channel,
    DenseRun,
    Diagnosis,
    FloatArray,
    Record,
    Robot,
    SeparatingExperiment,
    mean_travel,
)
from robid_diagnosis.hypothesis import Addition, Case, Fitted, Hypothesis
from robid_diagnosis.likelihood import lost
from robid_diagnosis.proposals import drawn_configurations, proposals
from robid_diagnosis.results import finding_of, model_of
from robid_diagnosis.selection import Selection
from robid_diagnosis.separation import _load, ratios, separation
from robid_diagnosis.steps import Outcome
from robid_diagnosis.trials import TIE
from robid_diagnosis.wording import finding_line, load_text, separation_line

PERIOD, T = 3000, 1e-3
LINES = np.unique(2 * np.round((np.geomspace(3.0, 80.0, 60) * PERIOD * T - 1) / 2).astype(int) + 1)
SURE = 3.0  # of a log-likelihood: half of what two causes may differ by and be tied


def measured(plant: Robot, reference: FloatArray, angle: FloatArray, n_exp: int, seed: int) -> Record:
    """Two periods of each experiment after one from rest; lanes of one configuration follow each other."""
    start = plant.joint_angle(plant.motor_angle(angle) - mean_travel(reference, T))
    run = plant.simulate(np.tile(reference, (1, 3, 1)), start, seed=seed)
    shape = (len(angle) // n_exp, 1, n_exp, 2, PERIOD, 1)
    channels = {
        "motor_position": Channel("motor", "rad", run.position[:, PERIOD:].reshape(shape)),
        "motor_torque": Channel("motor", "N m", run.torque[:, PERIOD:].reshape(shape)),
    }
    dense = DenseRun(T, channels, T * np.arange(PERIOD), np.ones(shape[:5], dtype=bool))
    return Record(plant.axis_names, "simulated", "zero_order_hold", (dense,), angle[::n_exp], line=LINES)


def multisines(count: int, seed: int) -> FloatArray:
    """Speeds of a multisine on a slow sine, rad/s, (count, PERIOD, 1)."""
    generator, time = np.random.default_rng(seed), T * np.arange(PERIOD)
    phase = generator.uniform(0, 2 * np.pi, (count, len(LINES)))
    turn = 2 * np.pi * np.outer(time, LINES / (PERIOD * T))
    wave = np.cos(turn[None] + phase[:, None]).sum(axis=2)
    slow = 10 * np.sin(4 * np.pi * time / (PERIOD * T) + phase[:, :1])
    speed: FloatArray = 4 * wave / wave.std(axis=1, keepdims=True) + slow
    return speed[..., None]


def searched(
    told: Robot, use: str, values: Mapping[str, float], rival: str
) -> tuple[Robot, Record, Case, Outcome]:
    """A plant with a hidden effect, its record in two poses on one side, and what the search says of two effects."""
    plant = told.with_parameters({"gear_stiffness.axis_1": 1.2 * told.parameter("gear_stiffness.axis_1")})
    plant = plant.with_effect("hidden", use, "axis_1", values=values)
    angle = np.repeat([[0.3], [1.1]], 2, axis=0)
    record = measured(plant, multisines(4, 3), angle, 2, 4)
    case = Case((record,), told, {}, 100.0, 0, 12, 5e-4)
    generator = np.random.default_rng(0)
    selection = Selection(case, (use, rival), {}, generator, lambda *_: None, 1)
    return plant, record, case, selection.run()


@pytest.fixture(scope="module")
def told() -> Robot:
    return Robot.load("one_axis")


def test_a_cable_and_a_counterbalance_are_told_apart_by_the_experiment_that_was_proposed(
    told: Robot, tmp_path: Path
) -> None:
    """Measured there, refits to old and new data differ by more than a tie; after a repeat they do not.

    Both hold the arm by a torque of its angle, one in proportion to it, one by its sine: on one side of the arm they
    are alike.
    """
    plant, record, case, outcome = searched(
        told, "load.cable_spring", {"stiffness": 20.0}, "load.counterbalance"
    )
    (step,), final = outcome.steps, outcome.final
    first, *others = (step.use, *(use for use, _, _ in step.ties))
    assert {first, others[0]} == {"load.cable_spring", "load.counterbalance"}
    assert set(others[1:]) <= {"body"}  # told wrong, it weighs the same on one side
    model = model_of(told, final)
    robot = Robot.of_model(model)
    best = separation(case, robot, final, step, np.random.default_rng(1), lambda *_: None)
    assert best is not None
    assert best.tells.all()
    assert best.expected > 10 * best.repeat.max()

    finding = finding_of(told, final, step, False, best)
    text = separation_line(finding)
    assert f"configuration [{best.configuration[0]:.3g}]" in text
    assert step.ties[0][0] in text
    there, before = (robot.gravity_torque(angle)[:, 0] for angle in (best.configuration[None], record.angle))
    assert ("opposite gravity torque at axis_1" in text) == bool((there * before < 0).all())
    Diagnosis("effects", finding_line(finding, 2), findings=(finding,)).write(tmp_path / "told.h5")
    again = Diagnosis.read(tmp_path / "told.h5").findings[0].separation
    assert again is not None
    assert again.sentence == best.sentence
    assert np.array_equal(again.reference, best.reference)

    rival = step.rivals[list(step.ties).index(step.ties[0])].fitted
    sign = 1 if step.use == "load.cable_spring" else -1

    def told_apart(reference: FloatArray, angle: FloatArray) -> float:
        """What the new experiment adds to the logarithm of the likelihood ratio, for the cause that is hidden."""
        new = measured(plant, reference[None], angle[None], 1, 5)
        both = replace(case, records=(record, new))
        fits = [both.fit(one.hypothesis, lambda *_: None, begin=one) for one in (final, rival)]
        after = lost(fits[1], fits[0], fits[0].about)
        return sign * 0.5 * (after - lost(rival, final, final.about))

    assert told_apart(best.reference, best.configuration) > SURE
    assert abs(told_apart(multisines(4, 3)[0], record.angle[0])) < SURE


@pytest.fixture(scope="module")
def waves(told: Robot) -> tuple[Case, Fitted, Fitted]:
    """Cogging that was measured, fitted as cogging and as torque ripple, of which it is a special case."""
    wave = {"amplitude": 0.15, "order": 6.0, "phase": 0.3}
    plant = told.with_effect("hidden", "drive.cogging", "axis_1", values=wave)
    record = measured(plant, multisines(4, 3), np.repeat([[0.3], [1.1]], 2, axis=0), 2, 4)
    case = Case((record,), told, {}, 100.0, 0, 12, 5e-4)
    case = case.with_fitted_width(case.fit(Hypothesis(), lambda *_: None, roughly=True))
    laws = {
        "drive.cogging": ("amplitude", "order", "phase"),
        "drive.torque_ripple": ("amplitude", "relative", "order", "phase"),
    }
    cogging, ripple = (
        case.fit(Hypothesis((Addition("wave", use, "axis_1", "torque", wave, free),)), lambda *_: None)
        for use, free in laws.items()
    )
    return case, cogging, ripple


def test_no_experiment_separates_a_law_from_one_that_holds_it_as_a_special_case(
    told: Robot, waves: tuple[Case, Fitted, Fitted]
) -> None:
    """Cogging is torque ripple without its part in proportion to the torque: a fit of ripple follows it anywhere."""
    case, cogging, ripple = waves
    assert 0 <= lost(cogging, ripple, cogging.about) < TIE
    robot = Robot.of_model(model_of(told, cogging))
    found = [
        ratios(cogging, [ripple], one.record)
        for one in proposals(case.records, robot, 0, np.random.default_rng(1))
    ]
    assert len(found) >= 2
    assert np.concatenate(found, axis=1).max() < SeparatingExperiment.TELLING


def test_what_does_not_repeat_is_proposed_as_a_whole(told: Robot) -> None:
    """One cut after the other, without settling, as fast as it was recorded."""
    record = measured(told, multisines(2, 6), np.array([[0.3], [1.1]]), 1, 7).replace(line=None)
    found = {one.amplitude: one for one in proposals((record,), told, 0, np.random.default_rng(2))}
    one = found[1.0]
    assert one.record.run.values("motor_position").shape[1:] == (1, 1, 1, 2 * PERIOD, 1)
    assert (one.n_settling, one.duration_s) == (0, pytest.approx(2 * PERIOD * T))
    speed = np.gradient(record.run.lanes("motor_position"), T, axis=1)
    assert np.allclose(one.reference[one.recorded], speed)
    assert np.allclose(found[2.0].reference[found[2.0].recorded], 2 * speed)


def test_proposals_stay_within_the_limits_and_scatter_as_the_record_did(told: Robot) -> None:
    record = measured(told, multisines(2, 6), np.array([[0.3], [1.1]]), 1, 7)
    position = record.run.values("motor_position")
    spread = (position - position.mean(axis=3, keepdims=True)).std()
    found = list(proposals((record,), told, 0, np.random.default_rng(2)))
    assert {one.amplitude for one in found} <= {0.5, 1.0, 2.0}
    assert all(one.recorded.any() for one in found if one.amplitude == 1.0)
    for one in found:
        moved, torque = (one.record.run.values(name) for name in ("motor_position", "motor_torque"))
        joint = told.joint_angle(moved.reshape(-1, 1))
        assert (joint >= told.drives.lower).all()
        assert (joint <= told.drives.upper).all()
        assert np.abs(torque).max() < told.drives.torque_limit[0]
        # Noise of two recorded lanes, drawn again and again: alike within the sampling error of their choice.
        assert (moved - moved.mean(axis=3, keepdims=True)).std() == pytest.approx(spread, rel=0.05)
        # The loop follows: the motion is about its configuration within a hundredth of its travel.
        middle = told.joint_angle(moved.mean(axis=(1, 2, 3, 4)))
        assert np.abs(middle - one.record.angle).max() < 0.01 * np.ptp(joint)


def test_drawn_configurations_can_be_held(told: Robot) -> None:
    heavy = told.with_parameters({"mass.axis_1": 20 * told.parameter("mass.axis_1")})
    angle = drawn_configurations(heavy, 10, np.random.default_rng(0))
    light = drawn_configurations(told, 10, np.random.default_rng(0))
    assert 0 < len(angle) < len(light) == 10
    assert (np.abs(heavy.gravity_torque(angle)) <= 0.5 * heavy.drives.torque_limit).all()


@pytest.mark.parametrize(
    ("here", "recorded", "how"),
    [
        (-3.0, [1.0, 4.0], "opposite"),
        (-0.2, [1.0, 4.0], "smaller"),
        (-3.0, [-1.0, 4.0], ""),
        (6.0, [-1.0, 4.0], "larger"),
        (2.0, [1.0, 4.0], ""),
        (0.0, [0.0, 0.0], ""),
    ],
)
def test_gravity_is_called_otherwise_only_where_it_is(here: float, recorded: list[float], how: str) -> None:
    text = load_text("axis_1", here, np.array(recorded))
    assert text.startswith(f"{how} gravity torque at axis_1" if how else "")
    assert bool(text) == bool(how)


@pytest.mark.parametrize(("cable", "load"), [(0.0, "gravity"), (2e4, "static")])
def test_what_holds_an_axis_against_a_cable_is_not_called_gravity(cable: float, load: str) -> None:
    """Half of the torque at rest, or more, is gravity's without the cable, and little of it beside one."""
    robot = Robot.load("one_axis").with_effect(
        "cable", "load.cable_spring", "axis_1", values={"stiffness": cable}
    )
    assert _load(robot, 0, np.array([[1.0]])) == load
