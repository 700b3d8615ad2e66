"""What the motions are for: parameters of a simulated rigid robot, with the standard errors that were predicted."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_acquisition.batch import SimulatedAcquisition
from robid_core import Configurations, Context, Excitation, Fit, Record, Robot
from robid_core.estimation.excitation.fourier_trajectory import TrajectoryProblem, random_coefficients
from robid_core.estimation.excitation.velocity_sweep import plateaus
from robid_core.estimation.rigid.rigid_torque import motor_inertia, motor_torque, motor_torque_regressor
from robid_core.residual import rigid_drives
from robid_core.robot import RobotDescription
from robid_core.stage import map_in_process
from robid_excitation.constant_velocity import ConstantVelocity
from robid_excitation.fourier import Fourier, problem_of, speed_reference
from robid_fit.rigid import RigidBodyFit

NOISE = 0.05  # N m
COULOMB, VISCOUS = (0.3, 0.2), (4e-3, 2e-3)
SEARCH = Fourier(period_s=6.0, harmonics=4, draws=10, starts=1, evaluations=150)


@pytest.fixture(scope="module")
def robot() -> Robot:
    """A turret with an arm on it, gears stiff: nothing but what the rigid-body fit knows."""
    arm: dict[str, Any] = {"mass": 8.0, "centre_of_mass": (0.15, 0.02, 0.3)}
    bodies = (
        {"joint": "turret", "axis": (0.0, 0.0, 1.0), "mass": 20.0, "inertia": np.diag([1.0, 1.0, 0.8]).tolist()},
        {"joint": "arm", "parent": "turret", "axis": (0.0, 1.0, 0.0), "translation": (0.2, 0.0, 0.5), **arm,
         "inertia": np.diag([0.5, 0.55, 0.1]).tolist()},
    )  # fmt: skip
    axes = {
        name: {
            "position_limits": (-2.0, 2.0),
            "gear_ratio": 50.0,
            "rotor_inertia": 5e-4,
            "torque_limit": 8.0,
            "speed_limit": 200.0,
            "friction": {"coulomb": COULOMB[a], "viscous": VISCOUS[a], "speed": 0.5},
            "sensors": {"torque_noise": NOISE},
            "controller": {"speed_gain": 0.1, "integral_gain": 1.0},
        }
        for a, name in enumerate(("turret", "arm"))
    }
    document = {"robid_robot": 1, "name": "turret", "bodies": bodies, "axes": axes}
    return Robot(RobotDescription.model_validate(document, strict=False))


@pytest.fixture(scope="module")
def standing(robot: Robot) -> Configurations:
    return Configurations(robot.axis_names, np.array([[0.0, 0.6]]))


PROMISED = ("mass.*", "centre_of_mass.*", "inertia.*", "rotor_inertia.*")


def context(seed: int = 1) -> Context:
    log = logging.getLogger("test.identification")
    return Context(np.random.default_rng(seed), map_in_process, lambda done, total, note="": None, log)


@pytest.fixture(scope="module")
def measure(robot: Robot, standing: Configurations, tmp_path_factory: pytest.TempPathFactory) -> Any:
    path: Path = tmp_path_factory.mktemp("plant") / "robot.yaml"
    path.write_text(robot.to_yaml())
    stage = SimulatedAcquisition(plant=str(path), periods=1, settle_periods=0)

    def measured(excitation: Excitation) -> Record:
        return stage.run(standing, excitation, robot, context(3))

    return measured


def predicted_errors(problem: TrajectoryProblem, excitation: Excitation, robot: Robot) -> np.ndarray:
    """Standard errors of the base parameters along a reference, by the regressor of the reference itself."""
    speed = excitation.reference[0, 0, 0]
    spectrum = np.fft.rfft(speed, axis=0)
    omega = 2j * np.pi * np.fft.rfftfreq(len(speed), robot.sample_time_s)[:, None]
    position = np.fft.irfft(
        np.divide(spectrum, omega, out=0 * spectrum, where=omega != 0), n=len(speed), axis=0
    )
    acceleration = np.fft.irfft(omega * spectrum, n=len(speed), axis=0)
    w = motor_torque_regressor(problem.drives, problem.centre + position, speed, acceleration)[
        :, :, problem.column
    ]
    rows = (w / NOISE).reshape(-1, w.shape[2])
    # Every tenth sample behind a filter that lets 0.8 of the new band pass: noise power 0.08 of what it was.
    result: np.ndarray = np.sqrt(0.08 * np.diag(np.linalg.inv(rows.T @ rows / 10)))
    return result


def test_an_optimised_trajectory_tells_the_parameters_as_much_better_as_predicted(
    robot: Robot, standing: Configurations, measure: Any
) -> None:
    problem = problem_of(robot, standing.angle[0], SEARCH)
    best = SEARCH.run(standing, robot, context())
    generator = np.random.default_rng(5)
    # A random trajectory of middling quality, out of nine.
    draws = sorted((random_coefficients(problem, generator) for _ in range(9)), key=problem.cost)
    plain = replace(best, reference=speed_reference(0.9 * draws[4][None], SEARCH, best.n_sample))
    fits: list[Fit] = []
    predictions = []
    for excitation in (best, plain):
        record = measure(excitation)
        assert record.line is None
        fit = RigidBodyFit(cutoff_hz=50.0, drop_first=0, drop_last=0, prior=dict.fromkeys(PROMISED, 3.0))
        fits.append(fit.run((record,), robot))
        predictions.append(predicted_errors(problem, excitation, robot))
    for fit, predicted in zip(fits, predictions, strict=True):
        # The drives follow within some per cent, and the columns are of second order in the motion; the variance of a
        # sum of 1200 equations, estimated from them and their neighbours, scatters by a tenth.
        assert fit.base is not None
        ratio = fit.base.standard_error / predicted
        np.testing.assert_allclose(ratio, 1.0, rtol=0.35)
        assert np.exp(np.log(ratio).mean()) == pytest.approx(1.0, abs=0.1)
    ours, theirs = (fit.base.standard_error for fit in fits if fit.base is not None)
    ratio, expected = theirs / ours, predictions[1] / predictions[0]
    np.testing.assert_allclose(ratio, expected, rtol=0.35)
    assert np.log(ratio / expected).mean() == pytest.approx(0.0, abs=0.1)
    assert np.exp(np.log(ratio).mean()) > 1.3
    # And what is estimated so precisely is right.
    assert fits[0].base is not None
    known, names = robot.parameters(), fits[0].base.names
    for axis, name in enumerate(robot.axis_names):
        for kind, value in (("coulomb", COULOMB[axis]), ("viscous", VISCOUS[axis])):
            at = names.index(f"friction.{name}.{kind}")
            assert known[names[at]] == value
            assert abs(fits[0].base.estimate[at] - value) < 5 * ours[at]


def test_friction_is_recovered_from_the_plateaus_of_a_sweep(
    robot: Robot, standing: Configurations, measure: Any
) -> None:
    excitation = ConstantVelocity(steps=6, lowest_share=0.02, highest_share=0.4).run(
        standing, robot, context()
    )
    run = measure(excitation).run
    drives, still = rigid_drives(robot), np.zeros((1, 2))
    torque, position = run.values("motor_torque"), run.values("motor_position")
    reference = run.values("speed_reference")
    for axis in range(2):
        found = plateaus(reference[0, 0, axis, 0], run.sample_time_s)
        assert len(found) == 12
        mean = np.array([torque[0, 0, axis, 0, one.samples, one.axis].mean() for one in found])
        friction = 0.5 * (mean[::2] - mean[1::2])
        speed = np.array([one.speed for one in found[::2]])
        assert speed.min() > 3.9  # eight times the speed of the smooth sign: tanh is 1 to 4e-7
        rows = np.column_stack([np.ones(6), speed])
        count = np.array([one.last - one.first for one in found[::2]])
        weight = np.sqrt(2 * count) / NOISE  # a mean of n samples, half the difference of two
        estimate = np.linalg.lstsq(rows * weight[:, None], friction * weight)[0]
        error = np.sqrt(np.diag(np.linalg.inv((rows * weight[:, None]).T @ (rows * weight[:, None]))))
        # There and back are friction / integral gain apart in angle: so much of gravity's change over the plateau is
        # left. And the speed may still change by what is left of the settling, times the inertia.
        left = []
        for one, level in zip(found[::2], friction, strict=True):
            angle = position[0, 0, axis, 0, one.samples]
            ends = [motor_torque(drives, angle[[k]], still, still)[0, axis] for k in (0, -1)]
            apart = level / robot.drives.integral_gain[axis]
            gravity = abs(ends[1] - ends[0]) * apart / abs(angle[-1, axis] - angle[0, axis])
            steps = np.diff(angle[:, axis])
            tenth = len(steps) // 10
            change = (steps[-tenth:].mean() - steps[:tenth].mean()) / run.sample_time_s
            inertia = motor_inertia(drives, angle[:1])[0, axis]
            left.append(gravity + inertia * abs(change) / (len(angle) * run.sample_time_s))
        bound = np.abs(np.linalg.pinv(rows * weight[:, None]) * weight) @ np.array(left)
        assert (np.abs(estimate - [COULOMB[axis], VISCOUS[axis]]) < 5 * error + bound).all()
        # Which is not much: a per cent or so.
        assert (5 * error + bound < [0.05 * COULOMB[axis], 0.1 * VISCOUS[axis]]).all()
