"""compensate.simulation: what moving inertia scatters goes, with a wrong model too, and the response stays."""

from __future__ import annotations

import numpy as np
import pytest

from robid_compensation.simulation import SimulationCompensation, other_realisations
from robid_core import Channel, ComplexArray, DenseRun, Frf, Record, Robot
from robid_core.estimation.excitation.multisine import logarithmic_odd_lines, multisine, sine
from robid_core.testing import check_stage, example_context, example_fit, example_robot
from robid_frf.joint import JointInputOutput
from robid_frf.spectral import Spectral

PERIOD_S, N_SAMPLE, N_BLOCK = 4.0, 4000, 12
LINE = logarithmic_odd_lines((4.0, 60.0), 60, PERIOD_S)
POSE = np.array([[0.2, 0.9]])


@pytest.fixture(scope="module")
def plant() -> Robot:
    """Two arms without friction: all that scatters is what moving about does to their inertia."""
    return example_robot(2).without_friction()


@pytest.fixture(scope="module")
def record(plant: Robot) -> Record:
    """Multisines on a slow sine that carries the arms 0.2 rad to and fro; second of two periods, no noise."""
    chance = np.random.default_rng(5)
    amplitude = np.tile((60.0 / LINE)[:, None], (1, 2))
    reference = np.empty((N_BLOCK, 2, N_SAMPLE, 2))
    for m in range(N_BLOCK):
        phase, own = chance.uniform(0, 2 * np.pi, (2, *amplitude.shape))
        reference[m] = multisine(amplitude, phase, own, LINE, N_SAMPLE)
        reference[m] += sine(np.full(2, 60.0), chance.uniform(0, 2 * np.pi, 2), 2, N_SAMPLE)
    lanes = reference.reshape(-1, N_SAMPLE, 2)
    step = PERIOD_S / N_SAMPLE
    start = POSE - 0.01 * (np.cumsum(lanes, axis=1) * step).mean(axis=1)
    result = plant.simulate(np.tile(lanes, (1, 2, 1)), start)
    shape = (1, N_BLOCK, 2, 1, N_SAMPLE, 2)
    channels = {
        "motor_position": Channel("motor", "rad", result.position[:, N_SAMPLE:].reshape(shape)),
        "motor_torque": Channel("motor", "N m", result.torque[:, N_SAMPLE:].reshape(shape)),
        "speed_reference": Channel("motor", "rad/s", reference.reshape(shape)),
    }
    run = DenseRun(step, channels, np.arange(N_SAMPLE) * step, np.ones(shape[:-1], dtype=bool))
    return Record(plant.axis_names, "simulated", "zero_order_hold", (run,), POSE, LINE)


def responses(record: Record) -> ComplexArray:
    u, y = record.spectra()
    return np.asarray(y[0] @ np.linalg.inv(u[0]))


def scatter(record: Record) -> float:
    blocks = responses(record)
    size = np.abs(blocks.mean(axis=0)).max(axis=(-2, -1), keepdims=True)
    return float(np.sqrt(np.mean(np.var(blocks / size, axis=0, ddof=1))))


def softer(robot: Robot, factor: float) -> Robot:
    return robot.with_parameters(
        {name: factor * value for name, value in robot.parameters().items() if "stiffness" in name}
    )


def test_the_true_model_takes_nearly_all_a_near_one_much_and_a_wrong_one_does_no_harm(
    plant: Robot, record: Record
) -> None:
    before = scatter(record)
    # The true model leaves what its own response to the reference is off, from as many blocks as 16: a quarter.
    exact = SimulationCompensation(realizations=16).run(record, plant, example_context())
    near = SimulationCompensation().run(record, softer(plant, 0.98), example_context())
    wrong = SimulationCompensation().run(record, softer(plant, 0.8), example_context())
    assert scatter(exact) < 0.1 * before  # that error is common to all blocks and no scatter
    assert scatter(near) < 0.8 * before
    assert scatter(wrong) < 1.01 * before  # its resonance scatters elsewhere: little is confirmed


def test_nothing_is_drawn_towards_a_wrong_model(plant: Robot, record: Record) -> None:
    # What is taken off has mean zero over realisations: means of 12 blocks before and after differ by its scatter over
    # sqrt(12), and by the error of the model's own response, from 32 blocks. If the model's response came
    # in, the difference would be that of the responses: it is ten times larger.
    model = softer(plant, 0.8)
    after = SimulationCompensation(realizations=32).run(record, model, example_context())
    change = responses(after) - responses(record)
    expected = np.std(change, axis=0, ddof=1) * np.sqrt(1 / N_BLOCK + 1 / 32)
    ratio = float(np.sqrt(np.mean(np.abs(change.mean(axis=0)) ** 2) / np.mean(expected**2)))
    assert ratio < 1.5
    frequency = LINE / PERIOD_S
    apart = model.response(POSE, frequency)[0] - plant.response(POSE, frequency)[0]
    assert np.sqrt(np.mean(np.abs(change.mean(axis=0)) ** 2)) < 0.1 * np.sqrt(np.mean(np.abs(apart) ** 2))


def test_what_a_model_had_a_part_in_claims_no_best_linear_approximation(plant: Robot, record: Record) -> None:
    still = SimulationCompensation(realizations=2).run(record, plant, example_context())
    assert still.model_based
    for stage in (JointInputOutput(), Spectral(approach="jio")):
        assert stage.run(record, example_context()).covers == Frf.BEST_LINEAR_APPROXIMATION
        assert stage.run(still, example_context()).covers == Frf.OWN_MEAN


def test_a_fit_replaces_the_nominal_parameters(plant: Robot, record: Record) -> None:
    model = softer(plant, 0.8)
    names = [name for name in plant.parameters() if "stiffness" in name]
    values = {name: plant.parameter(name) for name in names}
    fit = example_fit(model).replace(model=model.model(values))
    stage = SimulationCompensation()
    fitted = stage.run(record, model, example_context(), fit)
    right = stage.run(record, plant, example_context())
    name = "motor_torque"
    assert np.array_equal(fitted.run.values(name), right.run.values(name))


def test_other_realisations_have_the_amplitudes_and_nothing_above_the_band() -> None:
    chance = np.random.default_rng(0)
    reference = chance.standard_normal((3, 400, 2))
    line = np.array([5, 9, 41])
    drawn = other_realisations(reference, line, 7, np.random.default_rng(1))
    assert drawn.shape == (7, 400, 2)
    size, given = (np.abs(np.fft.rfft(x, axis=1)) for x in (drawn, reference))
    assert size[4, 1:42] == pytest.approx(given[1, 1:42])
    assert np.abs(size[:, 42:]).max() < 1e-9
    assert not np.allclose(drawn[0], drawn[3])


def test_simulation_compensation_keeps_the_contract() -> None:
    check_stage(SimulationCompensation)
