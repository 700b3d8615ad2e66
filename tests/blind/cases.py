"""Blind cases: a drawn robot, a drawn plant on MuJoCo that hides nothing, one thing or two, and what its sensors show.

One number draws all of a case: what is told, by how much springs, friction and inertia are off, poses, phases,
controller, noise, the fraction of a sample by which torques act late, and what is hidden, as strong as was asked for.
"""

from __future__ import annotations

import functools
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from oracles.drives import of_axes

from blind import laws
from blind.experiments import Experiments, record_of
from blind.foreign_plant import STEPS, ForeignPlant, Unbounded
from blind.kinds import OF_ONE, Hidden, Plant, hidden
from blind.plan import SIX, Wanted
from blind.robots import base_robot, told_robot, true_robot, without_bearing
from blind.strength import Ruler, Strength, noise_floor
from robid_core import Record, Robot

LATEST = 2  # of MuJoCo's steps, a quarter of a sample, by which torques are late at most
ROUNDS = 8  # of the search for a size
FIRST = 2.0  # power by which strength grows with size, until two sizes tell
FURTHER = (0.1, 10.0)  # factors of a size at once, until both sides are known
INSIDE = (0.15, 0.85)  # shares of the way between two sizes
LEAST = 1e-3  # of a strength
LARGEST = 10.0  # size: a gap beyond is never crossed, and only moves the arm
NARROW = 8  # likewise, of the record where a gap is hidden, which may be passed in a quarter of a sample
FINEST = 64  # of MuJoCo's steps a sample: a plant that leaves all bounds with these is unstable
DRAWS = 4  # of poses and places, until a law is as strong as was asked for
VALUE_SIZES = (0.8, 3.0)  # of wrong values: these are not sized by strength


@dataclass(frozen=True, eq=False)
class BlindCase:
    """What a diagnosis is given, and what it should find."""

    wanted: Wanted
    told: Robot
    truth: Robot
    """Without laws."""
    record: Record
    hidden: tuple[Hidden, ...]
    sizes: tuple[float, ...]
    strengths: tuple[float, ...]
    """Of each, alone."""
    classes: tuple[tuple[str, ...], ...]
    """Laws that no such data tell from each hidden one; written before the diagnosis runs."""
    late: float
    """Samples."""
    floor: np.ndarray
    """What noise leaves of the torque, relative to it, (n_axis,); NaN where nothing with a strength is hidden.

    Of noise drawn anew, in the first experiment of each pose: off by some percent from that of the record."""
    own_floor: np.ndarray
    """Likewise, of the noise that is in the record."""


def blind_case(wanted: Wanted) -> BlindCase:
    """Draw, size and measure a case.

    What is too stiff for the steps of the simulation is simulated with twice as many, up to `FINEST`; a plant that
    leaves all bounds then, too, counts as stronger than asked for: it is made weaker, and places and poses drawn again
    where that does not help. Raises Unbounded where the last draw is unstable.
    """
    generator = np.random.default_rng([wanted.seed, zlib.crc32(repr(wanted).encode())])
    told = told_robot(base_robot(wanted.n_axis), generator)
    truth = true_robot(told, generator, exact_inertia=wanted.exact_inertia)
    late = float(generator.integers(LATEST + 1)) / STEPS
    low, high = wanted.strength
    for _ in range(DRAWS):
        experiments = Experiments.drawn(truth, wanted.motion, generator)
        things = [hidden(kind, truth, generator) for kind in wanted.kinds]
        if len(things) == 2:
            while things[1].on == things[0].on and wanted.n_axis > 1:
                things[1] = hidden(wanted.kinds[1], truth, generator)
        if wanted.single:
            experiments = experiments.quiet_but(_loudest(truth, experiments, late, things[0].on))
        found = [_sized(thing, wanted, truth, experiments, late, generator) for thing in things]
        if all(not low > strength and not strength > high for _, strength, *_ in found):
            break
    plant = Plant(truth)
    for thing, (size, *_) in zip(things, found, strict=True):
        plant = thing.added(plant, size)
    for thing in things:
        told = without_bearing(told, thing.bearing) if thing.bearing else told
    record, clean = _with_noise(plant, truth, experiments, late, generator)
    return BlindCase(
        wanted,
        told,
        plant.robot,
        record,
        tuple(things),
        tuple(size for size, *_ in found),
        tuple(strength for _, strength, *_ in found),
        tuple(alike for _, _, alike, _ in found),
        late,
        found[0][3] if found else np.full(wanted.n_axis, np.nan),
        noise_floor(plant.robot, record, clean, late),
    )


def _loudest(truth: Robot, experiments: Experiments, late: float, on: str) -> int:
    """Pose in which large motions take most torque of an axis beyond what small ones take in any other."""
    axis = truth.axis_names.index(on)
    peaks = []
    for few in (experiments.first(), experiments.quiet_but(-1).first()):
        torque = _clean(Plant(truth), truth, few, late).run.values("motor_torque")
        peaks.append(np.abs(torque[..., axis]).reshape(len(torque), -1).max(axis=1))
    large, small = peaks
    return int(np.argmax([top - np.delete(small, pose).max(initial=0.0) for pose, top in enumerate(large)]))


def _sized(
    thing: Hidden,
    wanted: Wanted,
    truth: Robot,
    experiments: Experiments,
    late: float,
    generator: np.random.Generator,
) -> tuple[float, float, tuple[str, ...], np.ndarray]:
    """Size as strong as a number drawn between the bounds, its strength, what is like it, and what noise leaves."""
    if thing.kind.startswith("value."):
        return float(generator.uniform(*VALUE_SIZES)), float("nan"), (), np.full(truth.n_axis, np.nan)
    few = experiments.first()
    share = len(few.references) / len(experiments.references)
    without = without_bearing(truth, thing.bearing) if thing.bearing else truth
    nothing = _clean(Plant(without), without, few, late)
    ruler = Ruler.of_records(without, nothing, few.with_noise(nothing, truth, generator), late)

    @functools.cache
    def strength_at(size: float) -> Strength:
        plant = thing.added(Plant(truth), size)
        return ruler.strength(_clean(plant, truth, few, late))

    def total(size: float) -> float:
        try:
            return strength_at(size).total(share)
        except Unbounded:
            return np.inf

    low, high = wanted.strength
    target = float(np.exp(generator.uniform(*np.log((low, high)))))
    first = (target / OF_ONE[thing.kind]) ** (1 / FIRST)
    size, strength = _search(total, target, (low, high), first)
    if np.isinf(strength):
        return size, strength, (), ruler.floor
    alike = strength_at(size).alike(thing.kind, thing.on, generator, elsewhere=wanted.n_axis < SIX)
    return size, strength, alike, ruler.floor


def _search(
    strength_at: Callable[[float], float], target: float, within: tuple[float, float], size: float
) -> tuple[float, float]:
    """Size of a strength, from a size on by secants of their logarithms, halving between two that hold it."""
    tried = list[tuple[float, float]]()
    for _ in range(ROUNDS):
        strength = max(strength_at(size), LEAST)
        tried.append((size, strength))
        if within[0] <= strength <= within[1]:
            break
        below = max((pair for pair in tried if pair[1] < target), default=None)
        above = min((pair for pair in tried if pair[1] > target), default=None)
        if below and above:
            power = np.log(above[1] / below[1]) / np.log(above[0] / below[0])
            way = np.clip(
                np.log(target / below[1]) / power, *(np.log(above[0] / below[0]) * np.array(INSIDE))
            )
            size = float(below[0] * np.exp(way))
        else:
            if strength < target and size >= LARGEST:
                break
            size = min(size * float(np.clip((target / strength) ** (1 / FIRST), *FURTHER)), LARGEST)
    return min(tried, key=lambda pair: abs(np.log(pair[1] / target)))


def _clean(plant: Plant, truth: Robot, experiments: Experiments, late: float) -> Record:
    """Measure all experiments with exact sensors."""
    position, torque, _ = _shown(plant, experiments, late, None)
    return record_of(truth, experiments, position, torque)


def _with_noise(
    plant: Plant, truth: Robot, experiments: Experiments, late: float, generator: np.random.Generator
) -> tuple[Record, Record]:
    """Measure all experiments; and what exact sensors would have shown of the same motion."""
    shape = experiments.references.shape
    of_angle = generator.standard_normal(shape) * of_axes(truth, "sensors", "position_noise")
    gap = any(law.law == laws.BACKLASH for law in plant.laws)
    position, torque, exact = _shown(plant, experiments, late, of_angle, NARROW if gap else STEPS)
    of_torque = generator.standard_normal(shape) * experiments.torque_noise
    noisy = record_of(truth, experiments, position, torque + of_torque)
    return noisy, record_of(truth, experiments, exact, torque)


def _shown(
    plant: Plant, experiments: Experiments, late: float, noise: np.ndarray | None, steps: int = STEPS
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles, torques, exact angles of all experiments, (n_experiment, n_sample, n_axis), in so many steps or more."""
    whole = ForeignPlant(plant.robot, plant.laws, late, plant.base, steps)
    try:
        shown = [
            whole.measure(
                reference, experiments.poses[k // experiments.each], None if noise is None else noise[k]
            )
            for k, reference in enumerate(experiments.references)
        ]
    except Unbounded:
        if steps == FINEST:
            raise
        return _shown(plant, experiments, late, noise, 2 * steps)
    position, torque, exact = (np.stack(parts) for parts in zip(*shown, strict=True))
    return position, torque, exact
