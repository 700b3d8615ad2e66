"""Records of a plant under the worked example's excitation, as an acquisition would have left them."""

from __future__ import annotations

import numpy as np

from robid_core import Channel, DenseRun, FloatArray, Record
from studies.fit_accuracy.experiments import Experiments, excitation_of, references
from studies.fit_accuracy.plants import Plant
from studies.fit_accuracy.simulators import Own, Simulator, earlier

VARIANTS = ("bare", "loaded")


def measured(plant: Plant, experiments: Experiments, seed: int, simulator: Simulator) -> Record:
    """Record of one period of settling and those that count; with a payload, half of the poses carry it."""
    nominal, n_config = plant.nominal, experiments.poses
    heaviest = plant.loaded(experiments.payload_kg).nominal if experiments.payload_kg else nominal
    where, excitation = excitation_of(heaviest, experiments, seed)
    generator = np.random.default_rng([seed, 2])
    reference, start = references(nominal, where, excitation, experiments, generator)
    position, torque = _simulated(plant, experiments, reference, nominal.joint_angle(start), seed, simulator)
    n_period = round(experiments.period_s / nominal.sample_time_s)
    line, periods = None, 1
    if experiments.cut_s:
        n_cut = round(experiments.cut_s / nominal.sample_time_s)
        first = generator.integers(n_period, position.shape[1] - n_cut, len(position))
        position, torque = (
            np.stack([own[k : k + n_cut] for own, k in zip(values, first, strict=True)])
            for values in (position, torque)
        )
    elif not experiments.move_rad[1]:
        position, torque = position[:, n_period:], torque[:, n_period:]
        line, periods = excitation.line, experiments.periods
    if isinstance(simulator, Own) and plant.hidden.late:
        torque = earlier(torque, plant.hidden.late)
    n_sample, n_axis = position.shape[1] // periods, nominal.n_axis
    blocks = excitation.realization(0).shape[0]
    rows = (n_config, blocks, experiments.each // blocks, periods, n_sample, n_axis)
    channels = {
        "motor_position": Channel("motor", "rad", position.reshape(rows)),
        "motor_torque": Channel("motor", "N m", torque.reshape(rows)),
    }
    time = nominal.sample_time_s * np.arange(n_sample)
    run = DenseRun(nominal.sample_time_s, channels, time, np.ones(rows[:-1], dtype=bool))
    record = Record(nominal.axis_names, simulator.name, "zero_order_hold", (run,), where.angle, line)
    if not experiments.payload_kg:
        return record
    return record.replace(variants=tuple(VARIANTS[c >= n_config // 2] for c in range(n_config)))


def _simulated(
    plant: Plant,
    experiments: Experiments,
    reference: FloatArray,
    start: FloatArray,
    seed: int,
    simulator: Simulator,
) -> tuple[FloatArray, FloatArray]:
    """Measured angle and torque, those of the second half from the plant with the payload."""
    if not experiments.payload_kg:
        return simulator.measure(plant, reference, start, seed)
    bare = experiments.poses // 2 * experiments.each
    loaded = plant.loaded(experiments.payload_kg)
    parts = (
        simulator.measure(plant, reference[:bare], start[:bare], seed),
        simulator.measure(loaded, reference[bare:], start[bare:], seed + 1),
    )
    position, torque = (np.concatenate(values) for values in zip(*parts, strict=True))
    return position, torque
