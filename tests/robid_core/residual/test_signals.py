"""Laws on signals are taken off a record as they were put on, and their columns are differences of predictions."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import DataRejected, FreeParameters, Robot
from robid_core.estimation.torque.periodic import periodic_motion_of
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.estimation.torque.windowed import windowed_motion_of
from robid_core.residual import PeriodicBlock, TorqueProblem
from robid_core.residual.derivatives import derivatives
from robid_core.residual.signals import true_motion

T, N = 1e-3, 1000
AMPLITUDE, ORDER, PHASE, GAIN, LATE = 3e-4, 4.0, 0.4, 0.03, 2


@pytest.fixture(scope="module")
def robot() -> Robot:
    """Return one axis whose resolver waves and is two samples late, whose drive reports too much torque."""
    bare = Robot.load("one_axis")
    wave = {"amplitude": AMPLITUDE, "order": ORDER, "phase": PHASE}
    waving = bare.with_effect("wave", "sensing.resolver_ripple", "axis_1", "position", wave)
    late = waving.with_effect("late", "sensing.delay", "axis_1", "position", {"delay": LATE * T})
    much = late.with_effect("much", "sensing.gain_error", "axis_1", "torque_measurement", {"error": GAIN})
    ripple = {"amplitude": 0.05, "relative": 0.02, "order": 6.0, "phase": 1.0}
    return much.with_effect("ripple", "drive.torque_ripple", "axis_1", "torque", ripple)


def angles(time: np.ndarray) -> np.ndarray:
    """Three waves about a pose, up to 40 Hz, in closed form."""
    waves = [(1.5, 1, 0.0), (0.1, 13, 1.0), (0.02, 40, 2.0)]
    return 0.3 + sum(a * np.sin(2 * np.pi * line * time / (N * T) + p) for a, line, p in waves)


def torques(time: np.ndarray) -> np.ndarray:
    return 1.2 + 0.7 * np.cos(2 * np.pi * 13 * time / (N * T))


def measured(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the sensors tell, from the definitions of the laws: the wave is that of the angle when it was sampled."""
    before = angles(time - LATE * T)
    return before + AMPLITUDE * np.sin(ORDER * before + PHASE), (1 + GAIN) * torques(time)


def test_a_periodic_record_is_what_it_was_before_the_sensors(robot: Robot) -> None:
    time, shape = T * np.arange(N), (1, 1, 1, 2, N, 1)
    angle, torque = (np.broadcast_to(values[:, None], shape) for values in measured(time))
    motion = true_motion(robot, periodic_motion_of(angle, torque, T, np.array([1, 13, 40]), 100.0))
    np.testing.assert_allclose(motion.angle[0, 0, :, 0], angles(time), atol=1e-11)
    np.testing.assert_allclose(motion.torque[0, 0, :, 0], torques(time), atol=1e-11)
    whole = np.fft.rfft(angles(time))[:100] / N
    omega = 2 * np.pi * np.arange(100) / (N * T)
    np.testing.assert_allclose(motion.acceleration_spectrum[0, 0, :100, 0], -(omega**2) * whole, atol=1e-8)


def test_of_a_cut_all_is_found_but_what_came_before_its_first_sample(robot: Robot) -> None:
    """A law that is late fills its memory with the first angle: some samples there, under the taper, are not known."""
    time, shape = T * (np.arange(N) + 137.3), (1, 1, N, 1)
    angle, torque = (values.reshape(shape) for values in measured(time))
    motion = true_motion(robot, windowed_motion_of(angle, torque, T, 100.0))
    inside = slice(N // 20, -N // 20)
    np.testing.assert_allclose(motion.angle[0, 0, inside, 0], angles(time)[inside], atol=2e-4)
    assert np.abs(angle[0, 0, inside, 0] - angles(time)[inside]).max() > 0.02
    np.testing.assert_allclose(motion.torque[0, 0, :, 0], torques(time), atol=1e-11)


def test_a_law_that_folds_angles_cannot_be_taken_off(robot: Robot) -> None:
    folding = robot.with_parameters({"effect.wave.amplitude": 0.4})
    time, shape = T * np.arange(N), (1, 1, 1, 2, N, 1)
    angle, torque = (np.broadcast_to(values[:, None], shape) for values in measured(time))
    record = periodic_motion_of(angle, torque, T, np.array([1, 13, 40]), 100.0)
    with pytest.raises(DataRejected, match=r"effect wave, late: .*too strong"):
        true_motion(folding, record)


def test_columns_of_signals_are_differences_of_residuals(robot: Robot) -> None:
    """Central, by 1e-3 of a parameter, of an order by 1e-5: many turns on it moves the wave's phase.

    Of the torque as it was, not as it is reported.
    """
    time, shape = T * np.arange(N), (1, 1, 1, 2, N, 1)
    angle, torque = (np.broadcast_to(values[:, None], shape) for values in measured(time))
    record = periodic_motion_of(angle, torque, T, np.array([1, 13, 40]), 100.0)
    free = FreeParameters.of_robot(robot, [n for n in robot.layout if n.startswith("effect.")])
    block, size = (
        PeriodicBlock.of_record(robot, record, SpeedFunctions.of_widths((5.0,), 1)),
        np.zeros((3, 1)),
    )

    def residual(point: np.ndarray) -> np.ndarray:
        block.renew_signals(free, point, np.zeros_like(record.torque_spectrum), np.zeros(1))
        told = block.residual(block.predicted(block.robot_at(free, point), point, size), np.zeros(1))
        assert block.reported is not None
        return told / block.reported

    middle = np.zeros(len(free.names))
    residual(middle)
    columns = {column.index: column.torque for column in block.signal_columns}
    assert len(columns) == len(free.names) == 9
    for i, name in enumerate(free.names):
        step = np.zeros(len(free.names))
        step[i] = 1e-3 if not name.endswith("order") else 1e-5
        slope = (residual(-step) - residual(step)) / (2 * step[i])
        assert np.linalg.norm(columns[i] - slope) < 5e-3 * np.linalg.norm(slope), name


def test_noise_of_a_reported_torque_is_as_large_in_the_residual() -> None:
    """Whatever the gain of the report, which is taken off the record: a gain must not make noise smaller."""
    robot = Robot.load("one_axis").with_effect(
        "much", "sensing.gain_error", "axis_1", "torque_measurement", {"error": 0.5}
    )
    time, shape = T * np.arange(N), (1, 1, 1, 2, N, 1)
    angle, torque = (np.broadcast_to(values[:, None], shape) for values in (angles(time), torques(time)))
    noise = np.random.default_rng(1).standard_normal((N, 1))
    free, left = FreeParameters.of_robot(robot, ["effect.much.error"]), []
    for pull in (torque, torque + noise):
        record = periodic_motion_of(angle, pull, T, np.array([1, 13, 40]), 100.0)
        block = PeriodicBlock.of_record(robot, record, SpeedFunctions.of_widths((5.0,), 1))
        block.renew_signals(free, np.zeros(1), np.zeros_like(record.torque_spectrum), np.zeros(1))
        predicted = block.predicted(block.robot_at(free, np.zeros(1)), np.zeros(1), np.zeros((3, 1)))
        left.append(block.residual(predicted, np.zeros(1)))
    np.testing.assert_allclose((left[1] - left[0])[0, 0], np.fft.rfft(noise, axis=0)[:101] / N, atol=1e-12)


def test_derivatives_beside_a_lag_of_the_torque_are_those_of_the_command() -> None:
    """Of the lag itself, a spring, a rotor and friction: a lag that is undone turns what they change by its own phase.

    Central differences of predictions that are renewed until they agree with the command they were made with. Left are
    images of the held torque and what a step of integration does not resolve, 1e-2; undone by the gain of the lag, up
    to 0.25 here, which forgotten would show.
    """
    robot = Robot.load("one_axis").with_effect(
        "lag", "drive.current_loop", "axis_1", "torque", {"time_constant": 4e-4}
    )
    time, shape = T * np.arange(N), (1, 1, 1, 2, N, 1)
    wave = 0.3 + sum(
        a * np.sin(2 * np.pi * k * time / (N * T) + k) for a, k in ((1.5, 1), (0.1, 40), (0.03, 95))
    )
    angle, torque = (np.broadcast_to(values[:, None], shape) for values in (wave, torques(time)))
    record = periodic_motion_of(angle, torque, T, np.array([1, 40, 95]), 100.0)
    names = ("effect.lag.time_constant", "gear_stiffness.axis_1", "rotor_inertia.axis_1")
    free = FreeParameters.of_robot(robot, names)
    problem = TorqueProblem(
        free,
        (PeriodicBlock.of_record(robot, record, SpeedFunctions.of_widths((5.0,), 1)),),
        ("odd", "even", "constant"),
    )
    (block,) = problem.blocks

    def predicted(point: np.ndarray) -> np.ndarray:
        for _ in range(8):
            (left,) = problem.residuals(point)
            block.renew_signals(free, point[:3], left, problem.delay(point))
        return problem.predicted(point)[0]

    middle = np.zeros(problem.n_unknown)
    middle[3] = 0.5
    here = predicted(middle)
    (runs,) = derivatives(block, free, middle[:3], here, each_delay=False)
    columns = np.concatenate(list(runs))[:, 0, 0]
    for i in range(4):
        step = 1e-3 * np.eye(problem.n_unknown)[i]
        slope = ((predicted(middle + step) - predicted(middle - step)) / 2e-3)[0, 0, :, 0]
        assert np.linalg.norm(columns[:, i] - slope) < 1e-2 * np.linalg.norm(slope), i
