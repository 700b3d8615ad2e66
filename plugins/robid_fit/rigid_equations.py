"""Equations of a rigid fit: torque and its columns at the samples that are kept, experiments one after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from robid_core import DataRejected, FloatArray, Record, Robot
from robid_core.estimation.rigid.friction_direction import direction, direction_slope
from robid_core.estimation.rigid.regression import decimate, decimated_index
from robid_core.estimation.standstill import at_rest, may_stick
from robid_fit.rigid_effects import acting_laws, effect_torque
from robid_fit.rigid_model import Columns, RigidMotion, experiments, motion_of, torque_columns
from robid_fit.rigid_timing import moved_back, rate

BODIES = ("inertia", "rotor_inertia")
REACH = 3  # equations to either side that a low-pass mixes with a rest
SETTLED = 2.0  # periods of the cutoff, after which the low-pass of an angle has forgotten a stick but for a hundredth
MOST = 0.5  # of an equation's samples at rest, above which it does not count
HELD = 0.5  # samples by which a held torque is recorded before it acts, on average


@dataclass(frozen=True, eq=False)
class Experiment:
    """One experiment at all samples, its start and end left out."""

    motion: RigidMotion
    sample_time: float
    recorded: FloatArray
    """Torque, start and end among it, (n_recorded, n_axis)."""
    window: slice
    """Samples of it that are kept."""
    first: int
    """Sample at which it begins, counted through all records."""
    regressor: FloatArray
    """Torque per unit of every column, (n_sample, n_axis, n_column)."""
    weight: FloatArray | None = None
    """Zero where an axis may stick, else one, (n_sample, n_axis); None: one everywhere."""

    @property
    def torque(self) -> FloatArray:
        """As recorded, (n_sample, n_axis)."""
        return self.recorded[self.window]

    def weighted(self, values: FloatArray) -> FloatArray:
        """Return what holds at every sample, (n_sample, n_axis, ...), without samples at which an axis may stick."""
        if self.weight is None:
            return values
        return values * self.weight.reshape(*self.weight.shape, *(1,) * (values.ndim - 2))


@dataclass(frozen=True)
class Sampling:
    """How records become equations."""

    cutoff_hz: float
    filter_order: int
    decimation: int
    drop_first: int
    drop_last: int
    discard: int
    leave_rest: bool = False
    """Whether samples at which an axis stands still are left out for that axis."""

    def window(self, n_sample: int) -> slice:
        """Samples of an experiment that are kept."""
        if n_sample <= self.drop_first + self.drop_last + self.decimation:
            raise DataRejected(
                f"fit.rigid: an experiment has {n_sample} samples only; lower drop_first and drop_last"
            )
        return slice(self.drop_first, n_sample - self.drop_last)


@dataclass(frozen=True, eq=False)
class RigidEquations:
    """Torque of records and what it is linear in, decimated."""

    each: tuple[Experiment, ...]
    sampling: Sampling
    columns: Columns
    """Names, units and values of the robot; the regressor in it is that of the last experiment alone."""
    friction_speed: FloatArray
    """v_s of tanh(v / v_s), (n_axis,)."""
    regressor: FloatArray
    """Torque per unit of every column at the equations, (n_equation, n_axis, n_column)."""
    counted: FloatArray
    """One where an axis counts, zero where it stands still and that is left out, (n_equation, n_axis)."""
    whole: FloatArray
    """One where decimation mixes no sample at rest, (n_equation, n_axis)."""

    @classmethod
    def of_records(
        cls,
        records: Sequence[Record],
        robot: Robot,
        speed: FloatArray,
        sampling: Sampling,
        position: str = "motor_position",
        *,
        timed: bool = True,
    ) -> RigidEquations:
        """Smooth, differentiate and cut every experiment.

        Parameters
        ----------
        records, robot
            Of training experiments; rigid.
        speed
            v_s of tanh(v / v_s), (n_axis,).
        sampling
            Filters and cuts.
        position
            Channel that the motion is taken from: the measured one, or a reference.
        timed
            Whether a held torque counts half a sample later than it was recorded, where it acts.
        """
        found, measured, elapsed = list[Experiment](), list[FloatArray](), 0
        for record, run in ((one, run) for one in records for run in one.runs):
            early = HELD if timed and record.torque_hold == "zero_order_hold" else 0.0
            for angle, torque in experiments(run, robot, sampling.discard, position):
                smooth = motion_of(angle, run.sample_time_s, sampling.cutoff_hz, sampling.filter_order)
                kept = sampling.window(len(torque))
                motion = RigidMotion(smooth.position[kept], smooth.velocity[kept], smooth.acceleration[kept])
                columns = torque_columns(robot, motion, speed, run.sample_time_s)
                found.append(
                    Experiment(
                        motion,
                        run.sample_time_s,
                        moved_back(torque, np.full(torque.shape[1], -early)),
                        kept,
                        elapsed + sampling.drop_first,
                        columns.regressor,
                    )
                )
                measured.append(angle[kept])
                elapsed += len(angle)
        if sampling.leave_rest:
            found = _moving(found, measured, sampling)
        return cls._of(found, sampling, columns, speed)

    @classmethod
    def _of(
        cls, each: Sequence[Experiment], sampling: Sampling, columns: Columns, speed: FloatArray
    ) -> RigidEquations:
        empty = np.empty((0, len(speed)))
        found = cls(tuple(each), sampling, columns, speed, empty[..., None], empty, empty)
        share = found.kept(lambda one: np.ones_like(one.torque))
        regressor = found.kept(lambda one: one.regressor)
        whole = np.concatenate([_whole(one, sampling.decimation) for one in each])
        return replace(found, regressor=regressor, counted=np.where(share < MOST, 0.0, 1.0), whole=whole)

    @cached_property
    def unweighted(self) -> RigidEquations:
        """Return the same with samples at rest, too."""
        if all(one.weight is None for one in self.each):
            return self
        each = [replace(one, weight=None) for one in self.each]
        return self._of(each, self.sampling, self.columns, self.friction_speed)

    def at_friction_speed(self, speed: FloatArray) -> RigidEquations:
        """Return the same with Coulomb friction that turns within another speed, (n_axis,)."""
        if (speed == self.friction_speed).all():
            return self
        regressor = self.regressor.copy()
        turned = self.kept(lambda one: direction(one.motion.velocity, speed))
        axes = range(len(speed))
        regressor[:, axes, self.coulomb] = turned[:, axes]
        return replace(self, friction_speed=speed, regressor=regressor)

    def directions(self, axis: int, speeds: Sequence[float]) -> FloatArray:
        """What Coulomb friction of an axis multiplies, for some speeds that it turns within, (n_equation, n_speed)."""
        turn = np.array(speeds)

        def turned(one: Experiment) -> FloatArray:
            own = direction(one.motion.velocity[:, [axis] * len(turn)], turn)
            return own if one.weight is None else own * one.weight[:, [axis]]

        return np.concatenate([decimate(turned(one), self.sampling.decimation) for one in self.each])

    def friction_slope(self) -> FloatArray:
        """Return the derivative of the torque by v_s, per unit of Coulomb friction, (n_equation, n_axis)."""
        return self.kept(lambda one: direction_slope(one.motion.velocity, self.friction_speed))

    @property
    def coulomb(self) -> list[int]:
        """Columns of the Coulomb friction of each axis."""
        return [column for column, kind in enumerate(self.columns.kinds) if kind == "coulomb"]

    def kept(self, of: Callable[[Experiment], FloatArray]) -> FloatArray:
        """What each experiment gives at all its samples, (n_sample, n_axis, ...), one after the other.

        Samples at which an axis may stick are taken out of both sides of an equation before a low-pass mixes them with
        others.
        """
        return np.concatenate(
            [decimate(one.weighted(of(one)), self.sampling.decimation) for one in self.each]
        )

    @cached_property
    def torque(self) -> FloatArray:
        """Shape (n_equation, n_axis)."""
        return self.kept(lambda one: one.torque)

    def torque_earlier(self, delay: FloatArray) -> FloatArray:
        """Torque moved back by a delay in s, (n_axis,); shape (n_equation, n_axis)."""
        return self.kept(lambda one: moved_back(one.recorded, delay / one.sample_time)[one.window])

    def rate(self, torque: FloatArray) -> FloatArray:
        """Return the derivative in time of a torque at the equations, per s, (n_equation, n_axis).

        Zero where samples at rest are mixed in: what they leave of a torque changes with its weight.
        """
        found = np.concatenate(
            [
                rate(torque[part]) / (self.sampling.decimation * one.sample_time)
                for one, part in zip(self.each, self.parts, strict=True)
            ]
        )
        result: FloatArray = self.whole * found
        return result

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """Equations of each experiment."""
        ends = np.cumsum(
            [0, *(len(decimated_index(len(o.torque), self.sampling.decimation)) for o in self.each)]
        )
        return tuple(slice(a, b) for a, b in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))

    @property
    def time_s(self) -> FloatArray:
        """Of each equation, experiments one after the other, (n_equation,)."""
        return np.concatenate(
            [
                (one.first + decimated_index(len(one.torque), self.sampling.decimation)) * one.sample_time
                for one in self.each
            ]
        )

    def of_effects(
        self, robot: Robot, names: Sequence[str], linear: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Torque of effects, (n_equation, n_axis), and its derivatives, (n_equation, n_axis, n_name).

        Parameters
        ----------
        robot
            Rigid, with the effects as they are supposed.
        names
            Of their parameters.
        linear
            Values of all columns of the torque, (n_column,): loads are predicted.
        """
        if not acting_laws(robot):
            return np.zeros_like(self.torque), np.zeros((*self.torque.shape, 0))
        carried = np.isin(self.columns.kinds, BODIES) * linear
        both = []
        for one in self.each:
            torque, columns = effect_torque(
                robot, names, one.motion, one.sample_time, one.regressor @ carried
            )
            acting = one.weighted(np.concatenate((torque[..., None], columns), axis=2))
            both.append(decimate(acting, self.sampling.decimation))
        found = np.concatenate(both)
        return found[..., 0], found[..., 1:]


def _moving(
    each: Sequence[Experiment], measured: Sequence[FloatArray], sampling: Sampling
) -> list[Experiment]:
    """Return experiments in which no sample counts at which an axis may stick, nor what a low-pass mixes with it."""
    given = (
        measured,
        [one.motion.velocity for one in each],
        [one.motion.position for one in each],
        [one.sample_time for one in each],
        sampling.cutoff_hz,
    )
    found = list[Experiment]()
    for one, rests, sticks in zip(each, at_rest(*given), may_stick(*given), strict=True):
        reach = 2 * round(SETTLED / (sampling.cutoff_hz * one.sample_time)) + 1
        still = scipy.ndimage.maximum_filter1d(rests | sticks, reach, axis=0)
        found.append(replace(one, weight=np.where(still, 0.0, 1.0)) if still.any() else one)
    return found


def _whole(one: Experiment, decimation: int) -> FloatArray:
    """One where decimation mixes no sample at rest, (n_equation, n_axis)."""
    index = decimated_index(len(one.torque), decimation)
    if one.weight is None:
        return np.ones((len(index), one.recorded.shape[1]))
    reach = 2 * REACH * decimation + 1 if decimation > 1 else 1
    result: FloatArray = scipy.ndimage.minimum_filter1d(one.weight, reach, axis=0)[index]
    return result
