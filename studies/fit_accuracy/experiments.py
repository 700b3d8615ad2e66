"""How a plant is excited: poses, multisines and moves, as the worked example's stages draw them."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from robid_core import Configurations, Context, Excitation, FloatArray, MotionRefused, Robot, load_plugin
from robid_core.stage import map_in_process

STAGES = "robid.stages"
TRIES = 20
SIGNALS: dict[str, tuple[str, dict[str, Any]]] = {
    "multisine": ("excitation.multisine", {"band_hz": (4, 80), "lines": 100, "slow_sine_rad_s": 9}),
    "slow_sweep": ("excitation.chirp", {"band_hz": (1, 8), "sweep": "logarithmic", "torque_share": 0.25}),
    "fast_sweep": ("excitation.chirp", {"band_hz": (8, 80), "sweep": "logarithmic", "torque_share": 0.25}),
}
"""Stages of excitations and their settings, the first as in the worked example."""


@dataclass(frozen=True)
class Experiments:
    """How a plant is excited."""

    signal: str = "multisine"
    """Of `SIGNALS`."""
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
    payload_kg: float = 0.0
    """Above zero: so much at the tool in the second half of the poses, told as a variant of the robot."""

    @property
    def motion_s(self) -> float:
        """Seconds of motion that are measured, without settling."""
        return self.poses * self.each * self.periods * self.period_s


def context(seed: int) -> Context:
    """Return what a stage is handed, without display."""
    quiet = logging.getLogger("study")
    quiet.setLevel(logging.ERROR)
    return Context(np.random.default_rng(seed), map_in_process, lambda *_, **__: None, quiet)


def excitation_of(nominal: Robot, experiments: Experiments, seed: int) -> tuple[Configurations, Excitation]:
    """Draw poses as `design.candidates` does, and signals as their stage does."""
    candidates = load_plugin(STAGES, "design.candidates")(count=experiments.poses)
    name, settings = SIGNALS[experiments.signal]
    blocks = math.ceil(experiments.each / nominal.n_axis)
    stage = load_plugin(STAGES, name)(period_s=experiments.period_s, blocks=blocks, **settings)
    for other in range(TRIES):  # in some poses gravity leaves too little torque: others are drawn
        where = candidates.run(nominal, context(seed + 1000 * other))
        try:
            return where, stage.run(where, nominal, context(seed + 1))
        except MotionRefused:
            continue
    raise RuntimeError(f"seed {seed}: no poses that the motors can be excited in")


def references(
    nominal: Robot,
    where: Configurations,
    excitation: Excitation,
    experiments: Experiments,
    generator: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Motor speeds asked for, rad/s, (n_exp, n_sample, n_axis), and motor angles at the start, rad, (n_exp, n_axis).

    Experiments of one pose stand together; of a multisine the first period settles.
    """
    periods, starts = [], []
    middle = nominal.motor_angle(where.angle)
    for c, angle in enumerate(middle):
        kept = excitation.realization(c).reshape(-1, *excitation.reference.shape[3:])[: experiments.each]
        periods.append(experiments.amplitude * kept)
        offset = np.asarray(excitation.start_offset(c)).reshape(-1, nominal.n_axis)[: experiments.each]
        starts.append(angle - experiments.amplitude * offset)
    reference, start = np.concatenate(periods), np.concatenate(starts)
    if experiments.move_rad[1]:
        moving = with_moves(nominal, where.angle, reference, experiments, generator)
        return moving, np.repeat(middle, experiments.each, axis=0)
    repeats = max(experiments.periods + 1, math.ceil(experiments.cut_s / experiments.period_s) + 2)
    return np.tile(reference, (1, repeats, 1)), start


def with_moves(
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
