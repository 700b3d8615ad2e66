"""Records of a plant under the worked example's excitation, on robid's own simulator or on a foreign one."""

from __future__ import annotations

import logging
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robid_core import (
    Channel,
    Configurations,
    Context,
    DenseRun,
    Excitation,
    MotionRefused,
    Record,
    Robot,
    load_plugin,
)
from robid_core.stage import map_in_process
from studies.fit_accuracy import foreign
from studies.fit_accuracy.plants import Plant

FloatArray = npt.NDArray[np.float64]

TRIES = 20
FOREIGN_NOISE = 0.004  # of the torque limit


@dataclass(frozen=True)
class Experiments:
    """How a plant is excited."""

    poses: int = 4
    each: int = 6
    """Experiments a pose."""
    periods: int = 2
    period_s: float = 8.0
    amplitude: float = 1.0
    """Over that of the worked example."""
    cut_s: float = 0.0
    """Above zero: so many seconds of each experiment from a random instant on, told as what does not repeat."""
    move_rad: tuple[float, float] = (0.0, 0.0)
    """Least and greatest move of each axis, forth and back within a period, from rest; told likewise."""

    @property
    def motion_s(self) -> float:
        """Seconds of motion that are measured, without settling."""
        return self.poses * self.each * self.periods * self.period_s


def context(seed: int) -> Context:
    """Return what a stage is handed, without display."""
    quiet = logging.getLogger("study")
    return Context(np.random.default_rng(seed), map_in_process, lambda *_, **__: None, quiet)


def excitation_of(nominal: Robot, experiments: Experiments, seed: int) -> tuple[Configurations, Excitation]:
    """Draw poses as `design.candidates` does, and multisines as `excitation.multisine` does."""
    stages = "robid.stages"
    candidates = load_plugin(stages, "design.candidates")(count=experiments.poses)
    stage = load_plugin(stages, "excitation.multisine")(
        band_hz=(4, 80), lines=100, period_s=experiments.period_s, blocks=1, slow_sine_rad_s=9
    )
    for other in range(TRIES):  # in some poses gravity leaves too little torque: others are drawn
        where = candidates.run(nominal, context(seed + 1000 * other))
        try:
            return where, stage.run(where, nominal, context(seed + 1))
        except MotionRefused:
            continue
    raise RuntimeError(f"seed {seed}: no poses that the motors can be excited in")


def measured(plant: Plant, experiments: Experiments, seed: int, own: bool) -> Record:
    """Record of one period of settling and those that count."""
    nominal = plant.nominal
    where, excitation = excitation_of(nominal, experiments, seed)
    references, starts = [], []
    for c, middle in enumerate(nominal.motor_angle(where.angle)):
        kept = excitation.realization(c).reshape(-1, *excitation.reference.shape[3:])[: experiments.each]
        references.append(experiments.amplitude * kept)
        offset = np.asarray(excitation.start_offset(c)).reshape(-1, nominal.n_axis)[: experiments.each]
        starts.append(middle - experiments.amplitude * offset)
    reference, start = np.concatenate(references), np.concatenate(starts)
    n_sample, n_axis = reference.shape[1:]
    generator = np.random.default_rng([seed, 2])
    if experiments.move_rad[1]:
        reference = _with_moves(nominal, where.angle, reference, experiments, generator)
        start = np.repeat(nominal.motor_angle(where.angle), experiments.each, axis=0)
    else:
        repeats = max(experiments.periods + 1, math.ceil(experiments.cut_s / experiments.period_s) + 2)
        reference = np.tile(reference, (1, repeats, 1))
    position, torque = (_own if own else _foreign)(plant, reference, plant.robot.joint_angle(start), seed)
    if experiments.move_rad[1]:
        line, periods = None, 1
    elif experiments.cut_s:
        n_cut = round(experiments.cut_s / nominal.sample_time_s)
        first = generator.integers(n_sample, position.shape[1] - n_cut, len(position))
        position, torque = (
            np.stack([own[k : k + n_cut] for own, k in zip(values, first, strict=True)])
            for values in (position, torque)
        )
        line, periods, n_sample = None, 1, n_cut
    else:
        position, torque = position[:, n_sample:], torque[:, n_sample:]
        line, periods = excitation.line, experiments.periods
    if own and plant.hidden.late:
        torque = _earlier(torque, plant.hidden.late)
    rows = (experiments.poses, 1, experiments.each, periods, n_sample, n_axis)
    channels = {
        "motor_position": Channel("motor", "rad", position.reshape(rows)),
        "motor_torque": Channel("motor", "N m", torque.reshape(rows)),
    }
    time = nominal.sample_time_s * np.arange(n_sample)
    dense = DenseRun(nominal.sample_time_s, channels, time, np.ones(rows[:-1], dtype=bool))
    source = "simulated" if own else "MuJoCo"
    return Record(nominal.axis_names, source, "zero_order_hold", (dense,), where.angle, line)


def _with_moves(
    nominal: Robot,
    angle: FloatArray,
    reference: FloatArray,
    experiments: Experiments,
    generator: np.random.Generator,
) -> FloatArray:
    """Speeds of a multisine that fades in, on top of one move of each axis, away from the nearer limit and back."""
    n_sample, n_axis = reference.shape[1:]
    time = nominal.sample_time_s * np.arange(n_sample)
    shape = np.sin(2 * np.pi * time / experiments.period_s) * np.pi / experiments.period_s
    middle = 0.5 * (np.array(nominal.drives.lower) + np.array(nominal.drives.upper))
    fade = np.minimum(1.0, time / 0.2)[:, None]
    found = []
    for k, own in enumerate(reference):
        size = generator.uniform(*experiments.move_rad, n_axis)
        way = np.where(angle[k // experiments.each] > middle, -1.0, 1.0)
        found.append(fade * own + shape[:, None] * nominal.motor_angle(way * size))
    return np.stack(found)


def _own(plant: Plant, reference: FloatArray, start: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
    """Measured angle and torque of the product's simulator, the hidden things as effects of a robot file."""
    with tempfile.TemporaryDirectory() as folder:
        robot = _with_effects(plant, Path(folder))
        run = robot.simulate(reference, start, seed=seed)
    return run.position, run.torque


def _earlier(torque: FloatArray, samples: float) -> FloatArray:
    """Return torques as a measurement ahead of the action shows them: exact for what repeats."""
    spectrum = np.fft.rfft(torque, axis=1)
    turn = np.exp(2j * np.pi * np.arange(spectrum.shape[1]) * samples / torque.shape[1])
    result: FloatArray = np.fft.irfft(spectrum * turn[:, None], n=torque.shape[1], axis=1)
    return result


def _with_effects(plant: Plant, folder: Path) -> Robot:
    """Return the plant's robot with what it hides."""
    entries = []
    for a, axis in enumerate(plant.robot.axis_names):
        if plant.hidden.stribeck:
            numbers = {
                "coulomb": 0.0, "breakaway": plant.breakaway[a], "stribeck_speed": plant.stribeck_speed[a],
                "exponent": plant.exponent[a], "viscous": 0.0,
                "speed": plant.robot.parameter(f"friction.{axis}.speed"),
            }  # fmt: skip
            entries.append((f"stribeck_{a}", "friction.stribeck", axis, numbers))
        if plant.hidden.torque_ripple:
            numbers = {"amplitude": plant.torque_ripple[a], "order": plant.torque_order[a]}
            entries.append((f"ripple_{a}", "drive.cogging", axis, numbers))
        if plant.hidden.resolver_ripple:
            numbers = {"amplitude": plant.resolver_ripple[a], "order": plant.resolver_order[a]}
            entries.append((f"wave_{a}", "sensing.resolver_ripple", axis, numbers))
    if not entries:
        return plant.robot
    lines = ["robid_robot: 1", "name: plant", f"base: {plant.nominal.name}", "effects:"]
    for label, use, axis, numbers in entries:
        told = ", ".join(f"{key}: {float(value)!r}" for key, value in numbers.items())
        lines.append(f"  {label}: {{use: {use}, on: {axis}, with: {{{told}}}}}")
    path = folder / "plant.yaml"
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return Robot.load(str(path)).with_parameters(plant.robot.parameters())


def _foreign(
    plant: Plant, reference: FloatArray, start: FloatArray, seed: int
) -> tuple[FloatArray, FloatArray]:
    """Measured angle and torque of MuJoCo, torque noise as FOREIGN_NOISE says."""
    hidden = foreign.Hidden(
        plant.breakaway,
        plant.stribeck_speed,
        plant.exponent,
        -plant.torque_ripple,
        plant.torque_order,
        plant.resolver_ripple,
        plant.resolver_order,
        plant.hidden.late,
    )
    machine, generator = foreign.ForeignPlant(plant.robot, hidden), np.random.default_rng([seed, 1])
    noise = FOREIGN_NOISE * np.array(plant.robot.drives.torque_limit)
    runs = [
        machine.measure(one, angle, generator, noise) for one, angle in zip(reference, start, strict=True)
    ]
    position, torque = (np.stack(values) for values in zip(*runs, strict=True))
    return position, torque
