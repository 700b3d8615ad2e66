"""Whether recorded torque and motion fit a robot, and if not, which slip in the recording would make them fit.

The rigid robot's inverse dynamics at the told values, with friction free, are held against the torque in a band below
its springs. Where they fail, one slip after another is tried: a sign, a unit, the other side of the gear, two axes
exchanged; where none helps alone, two axes exchanged and a sign of one of them. Each is a linear map of the positions
or of the torques and has no number that could be fitted, so that a slip that takes most of the error away is hardly
chance. A torque's scale is such a number: it is asked for apart (`torque_scales.py`).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from robid_core.arrays import FloatArray
from robid_core.estimation.rigid.regression import differentiate, smooth
from robid_core.estimation.rigid.reversals import Reversals
from robid_core.estimation.rigid.rigid_torque import RigidDrives, motor_torque

MOST = 1000  # samples that are looked at, evenly over all experiments
FEW = 150  # of them, by which pairs of slips are chosen
LARGEST = 30.0  # times the friction of the robot file: gears and temperatures reach 3, thousandths 1000
TRIM = 0.5  # of a cutoff's period, left out at both ends of an experiment
FITS = 0.1  # of a torque's variance: an axis that leaves less is as it should be
GAIN = 4.0  # by which a slip must lower what is left of the axes that it concerns, their median
LEFT = 0.2  # of the variance that may be left of them then, their median
NOTICED = 0.05  # of a torque's variance, above which its scale is looked at
TIE = float(np.log(2.0))  # of the logarithm of what is left, over all axes: nearer, two slips are as likely
SPOILS = 1.2  # by which it may raise what is left of any other axis


@dataclass(frozen=True, eq=False)
class Slip:
    """A mistake in a recording (sign, unit, exchanged axes), and the linear maps that undo it."""

    what: str
    """What the recording looks like."""
    remedy: str
    """What to write in the channel map."""
    position: FloatArray
    """Of motor angles, (n_axis, n_axis)."""
    torque: FloatArray
    """Of motor torques, (n_axis, n_axis)."""
    before: float = np.nan
    """Share of the torque that the robot leaves, rms, at the axis that it leaves most of; as recorded."""
    after: float = np.nan
    """Likewise, once it is undone."""
    ties: tuple[str, ...] = ()
    """What else it may be: slips that explain the recording about as well."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """Motion and torque of all experiments below a cutoff, each (n_sample, n_axis) at the motors."""

    drives: RigidDrives
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    torque: FloatArray
    direction: FloatArray
    """Coulomb friction over its size, with the reversals above the cutoff."""
    reversals: Reversals

    @classmethod
    def of_experiments(
        cls,
        drives: RigidDrives,
        experiments: Sequence[tuple[FloatArray, FloatArray]],
        sample_time: float,
        cutoff_hz: float,
    ) -> Recorded:
        """Smooth and differentiate each experiment: motor angle and torque, (n_sample, n_axis) each.

        Raises
        ------
        DataRejected
            If the cutoff is not below the Nyquist frequency, or an experiment is too short for it.
        """
        trim = round(TRIM / (cutoff_hz * sample_time)) + 2
        step = max(1, sum(len(position) - 2 * trim for position, _ in experiments) // MOST)
        parts, kept = [], list[slice]()
        for position, torque in experiments:
            smoothed = smooth(position, sample_time, cutoff_hz)
            velocity = differentiate(smoothed, sample_time)
            signals = (smoothed, velocity, differentiate(velocity, sample_time))
            kept.append(slice(trim, len(position) - trim, step))
            parts.append([one[kept[-1]] for one in (*signals, smooth(torque, sample_time, cutoff_hz))])
        angles = [position for position, _ in experiments]
        reversals = Reversals.of_angles(angles, sample_time, cutoff_hz, kept)
        moved, speed, faster, driven = (np.concatenate(one) for one in zip(*parts, strict=True))
        direction = reversals.direction(drives.friction_speed)
        return cls(drives, moved, speed, faster, driven, direction, reversals)

    def thinned(self, most: int) -> Recorded:
        """Return at most that many of the samples, evenly."""
        every = max(1, -(-len(self.position) // most))
        names = ("position", "velocity", "acceleration", "torque", "direction")
        few = {name: getattr(self, name)[::every] for name in names}
        return replace(self, **few, reversals=replace(self.reversals, every=every * self.reversals.every))

    def undone(self, slip: Slip) -> Recorded:
        """Return what would have been recorded without a slip."""
        moved = {
            name: getattr(self, name) @ slip.position.T for name in ("position", "velocity", "acceleration")
        }
        reversals, steep = self.reversals.through(slip.position), self.drives.friction_speed
        size = np.abs(slip.position)
        if np.array_equal(size, size.astype(bool)) and np.array_equal(size @ steep, steep):
            direction = self.direction @ slip.position.T  # turned round or exchanged: nothing to smooth anew
        else:
            direction = reversals.direction(steep)
        moved |= {"torque": self.torque @ slip.torque.T, "direction": direction}
        return replace(self, **moved, reversals=reversals)

    def expected(self, slip: Slip, undone: Recorded) -> Recorded:
        """Return what the robot of the file, with its friction, would have recorded with a slip in this motion."""
        drives = undone.drives
        friction = undone.direction * drives.coulomb + undone.velocity * drives.viscous
        torque = (undone.rigid + friction) @ np.linalg.inv(slip.torque).T
        recorded = replace(self, torque=torque)
        recorded.__dict__["rigid"] = self.rigid  # the motion is the same
        return recorded

    @cached_property
    def left(self) -> FloatArray:
        """Share of each torque's variance that the robot leaves with the friction that suits it best, (n_axis,)."""
        rest = self.torque - self.rigid
        return np.array([self._friction(a, rest[:, a])[1] for a in range(self.drives.n_axis)])

    @cached_property
    def rigid(self) -> FloatArray:
        """Torque of the rigid robot without friction, (n_sample, n_axis)."""
        none = np.zeros(self.drives.n_axis)
        frictionless = replace(self.drives, viscous=none, coulomb=none, offset=none)
        return motor_torque(frictionless, self.position, self.velocity, self.acceleration)

    def scaled(self, axis: int) -> tuple[float, float]:
        """Return the factor on the rigid robot's torque that suits an axis best, and the share that is then left."""
        factor, left = self._friction(axis, self.torque[:, axis], self.rigid[:, axis])
        return factor, left

    def beside_friction(self, axis: int, rest: FloatArray, *more: FloatArray) -> tuple[FloatArray, float]:
        """Fit friction, and further columns, to the rest of a torque, (n_sample,), none of them negative.

        Returns the sizes of the further columns, and the share of the torque's power that is left.
        """
        columns = np.stack([self.direction[:, axis], self.velocity[:, axis], *more], axis=1)
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        found, left = scipy.optimize.nnls(columns / size, rest)
        share = left**2 / max(float((self.torque[:, axis] ** 2).sum()), 1e-300)
        return found[2:] / size[2:], float(share)

    def _friction(self, axis: int, target: FloatArray, *more: FloatArray) -> tuple[float, float]:
        """Fit friction, and a further column, to a target: the further column's number, and the share that is left."""
        one, torque = np.ones(len(target)), self.torque[:, axis]
        friction = self.direction[:, axis], self.velocity[:, axis]
        columns = np.stack([*friction, one, -one, *more], axis=1)
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        found, norm = scipy.optimize.nnls(columns / size, target)
        most = LARGEST * np.array([self.drives.coulomb[axis], self.drives.viscous[axis]])
        if most.all() and (over := found[:2] / size[:2] > most).any():
            most = np.where(over, most, 0.0)
            kept = columns / size * np.append(~over, np.ones(columns.shape[1] - 2, dtype=bool))
            found, norm = scipy.optimize.nnls(kept, target - columns[:, :2] @ most)
        share = norm**2 / max(float(((torque - torque.mean()) ** 2).sum()), 1e-300)
        return float(found[-1] / size[-1]), share


def slips_in(recorded: Recorded, axis_names: Sequence[str]) -> list[Slip]:
    """Return slips which, undone one after the other, make a recording fit the robot.

    None where it fits already, or where none of them explains most of what is left.

    Parameters
    ----------
    recorded
        What was recorded, below the robot's first resonance.
    axis_names
        For the words.
    """
    found = list[Slip]()
    while len(found) <= len(axis_names):
        tried = [*_slips(recorded.drives, axis_names), *_likely_units(recorded, axis_names)]
        helping = list(_helping(recorded, axis_names, tried))
        if not helping and not found:
            likely = [slip for _, slip, _ in _helping(recorded.thinned(FEW), axis_names, _pairs(axis_names))]
            pairs = [(slip, range(len(axis_names))) for slip in likely]
            helping = list(_helping(recorded, axis_names, pairs))
        if not helping:
            break
        most = max(explained for explained, *_ in helping)
        (slip, recorded), *ties = [(one, rest) for explained, one, rest in helping if explained > most - TIE]
        found.append(replace(slip, ties=tuple(one.what for one, _ in ties)))
    return found


def _helping(
    recorded: Recorded, names: Sequence[str], slips: Iterable[tuple[Slip, Sequence[int]]]
) -> Iterator[tuple[float, Slip, Recorded]]:
    """Slips that would explain most of what is left, by how much, and what is then recorded."""
    before = recorded.left
    if (before < FITS).all():
        return
    torques = {np.eye(len(names)).tobytes(): recorded.rigid}
    for slip, axes in slips:
        wrong = [a for a in axes if before[a] >= FITS]
        if not wrong:
            continue
        undone = recorded.undone(slip)
        moved = slip.position.tobytes()
        if moved in torques:  # the motion is the same as with another slip
            undone.__dict__["rigid"] = torques[moved]
        torques[moved] = undone.rigid
        after = np.maximum(undone.left, 1e-9)
        others = [a for a in range(len(names)) if a not in wrong]
        # Medians: another slip may spoil a single axis yet.
        gain = float(np.median(np.log(before[wrong] / after[wrong])))
        spoiled = (after[others] > np.maximum(SPOILS * before[others], FITS)).any()
        if gain < np.log(GAIN) or np.median(after[wrong]) > LEFT or spoiled:
            continue
        if np.median(recorded.expected(slip, undone).left[wrong]) < FITS:
            continue  # with this slip the robot's own torque would fit: something else is wrong
        worst = max(wrong, key=lambda a: before[a])
        told = replace(slip, before=float(np.sqrt(before[worst])), after=float(np.sqrt(after[worst])))
        yield float(np.log(before / after).sum()), told, undone


def _slips(drives: RigidDrives, names: Sequence[str]) -> Iterator[tuple[Slip, Sequence[int]]]:
    """All slips that are tried, and the axes whose torque each concerns."""
    whole, every = np.eye(drives.n_axis), range(drives.n_axis)
    yield from _signs(names)
    yield from _signs_at_joints(drives, names)
    yield from _exchanges(names)
    degree = np.pi / 180
    for factor, what, remedy in (
        (degree, "the angles look like degrees", "motor_position: unit: deg"),
        (1 / degree, "the angles look like radians that were taken for degrees", "motor_position: unit: rad"),
        (2 * np.pi, "the angles look like turns", "motor_position: unit: turn"),
    ):
        yield Slip(what, remedy, factor * whole, whole), every
    gear, motor = drives.gear, np.asarray(np.linalg.inv(drives.gear), dtype=np.float64)
    at_joint, at_motor = "side: joint", "side: motor"
    yield Slip("the angles look like those of the joints", f"motor_position: {at_joint}", motor, whole), every
    yield Slip("the angles look like those of the motors", f"motor_position: {at_motor}", gear, whole), every
    yield Slip("the torques look like those at the joints", f"motor_torque: {at_joint}", whole, gear.T), every
    yield (
        Slip("the torques look like those at the motors", f"motor_torque: {at_motor}", whole, motor.T),
        every,
    )
    yield (
        Slip(
            "the torques look like thousandths, as of mA", "motor_torque: scale: 0.001", whole, 1e-3 * whole
        ),
        every,
    )


def _likely_units(recorded: Recorded, names: Sequence[str]) -> Iterator[tuple[Slip, Sequence[int]]]:
    """Units of one axis that few of the samples speak for; of one axis they are those of all."""
    if len(names) > 1:
        for _, slip, _ in _helping(recorded.thinned(FEW), names, _units(recorded.drives, names)):
            yield slip, range(len(names))


def _units(drives: RigidDrives, names: Sequence[str]) -> Iterator[tuple[Slip, Sequence[int]]]:
    """Another unit, or the other side of the gear, of one axis."""
    whole, every, degree = np.eye(drives.n_axis), range(drives.n_axis), np.pi / 180
    for a, name in enumerate(names):
        ratio = 1 / (abs(float(drives.gear[a, a])) or 1.0)  # nothing to ask where other motors move it
        for factor, seen, remedy in (
            (degree, "degrees", "motor_position: unit: deg"),
            (1 / degree, "radians that were taken for degrees", "motor_position: unit: rad"),
            (2 * np.pi, "turns", "motor_position: unit: turn"),
            (ratio, "that of the joint", "motor_position: side: joint"),
            (1 / ratio, "that of the motor", "motor_position: side: motor"),
        ):
            what, told = f"the angle of {name} looks like {seen}", f"{remedy} for {name}"
            yield Slip(what, told, _times(factor, a, whole), whole), every
        for factor, seen, remedy in (
            (1 / ratio, "that at the joint", "motor_torque: side: joint"),
            (ratio, "that at the motor", "motor_torque: side: motor"),
            (1e-3, "thousandths, as of mA", "motor_torque: scale: 0.001"),
        ):
            what, told = f"the torque of {name} looks like {seen}", f"{remedy} for {name}"
            yield Slip(what, told, whole, _times(factor, a, whole)), (a,)


def _times(factor: float, axis: int, whole: FloatArray) -> FloatArray:
    scaled = whole.copy()
    scaled[axis, axis] = factor
    return scaled


def _signs(names: Sequence[str]) -> Iterator[tuple[Slip, Sequence[int]]]:
    """Signs of the torque, of the angle, and of both of each axis."""
    whole, every = np.eye(len(names)), range(len(names))
    for a, name in enumerate(names):
        turned = whole.copy()
        turned[a, a] = -1
        sign = f"sign: -1 for {name}"
        yield (
            Slip(f"the torque of {name} has the opposite sign", f"motor_torque: {sign}", whole, turned),
            (a,),
        )
        yield (
            Slip(f"the angle of {name} has the opposite sign", f"motor_position: {sign}", turned, whole),
            every,
        )
        both = f"motor_position and motor_torque: {sign}"
        yield Slip(f"{name} counts the other way round than in the robot file", both, turned, turned), every


def _signs_at_joints(drives: RigidDrives, names: Sequence[str]) -> Iterator[tuple[Slip, Sequence[int]]]:
    """Signs of angles and torques that were recorded at joints which several motors move; else they are a motor's."""
    gear = drives.gear
    beside = (gear - np.diag(np.diag(gear))) != 0
    whole, every, motor = np.eye(len(names)), range(len(names)), np.linalg.inv(gear)
    for a, name in enumerate(names):
        if not (beside[a] | beside[:, a]).any():
            continue
        sign = f"sign: -1 for {name} (side: joint)"
        turned = _times(-1.0, a, whole)
        what = f"of {name} at the joint has the opposite sign"
        yield Slip(f"the angle {what}", f"motor_position: {sign}", motor @ turned @ gear, whole), every
        yield Slip(f"the torque {what}", f"motor_torque: {sign}", whole, gear.T @ turned @ motor.T), every


def _exchanges(names: Sequence[str]) -> Iterator[tuple[Slip, Sequence[int]]]:
    """Exchanges of the torques, of the angles, and of both of two axes."""
    whole, every = np.eye(len(names)), range(len(names))
    for a, b in itertools.combinations(every, 2):
        swapped = whole[[b if k == a else a if k == b else k for k in every]]
        pair = f"{names[a]} and {names[b]}"
        yield Slip(f"the torques of {pair} are exchanged", "the order of its columns", whole, swapped), (a, b)
        yield Slip(f"the angles of {pair} are exchanged", "the order of its columns", swapped, whole), every
        yield Slip(f"{pair} are exchanged", "the order of all columns", swapped, swapped), every


def _pairs(names: Sequence[str]) -> Iterator[tuple[Slip, Sequence[int]]]:
    """Two axes exchanged and a sign of one of them: neither helps alone."""
    signs = list(_signs(names))
    for exchange, _ in _exchanges(names):
        moved = np.flatnonzero((np.diag(exchange.position) == 0) | (np.diag(exchange.torque) == 0))
        for sign, _ in signs:
            own = np.flatnonzero((np.diag(sign.position) < 0) | (np.diag(sign.torque) < 0))
            if own[0] in moved:
                yield (
                    Slip(
                        f"{exchange.what}, and {sign.what}",
                        f"{exchange.remedy}, and {sign.remedy}",
                        sign.position @ exchange.position,
                        sign.torque @ exchange.torque,
                    ),
                    range(len(names)),
                )
