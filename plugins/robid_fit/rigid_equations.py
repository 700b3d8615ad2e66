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
from robid_core.estimation.standstill import at_rest
from robid_fit.rigid_effects import acting_laws, effect_torque
from robid_fit.rigid_model import Columns, RigidMotion, experiments, motion_of, torque_columns
from robid_fit.rigid_timing import moved_back, rate

BODIES = ("inertia", "rotor_inertia")
REACH = 3  # equations to either side that a low-pass mixes with a rest
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

    @property
    def torque(self) -> FloatArray:
        """As recorded, (n_sample, n_axis)."""
        return self.recorded[self.window]


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
        regressor = np.concatenate([decimate(one.regressor, sampling.decimation) for one in found])
        counted = np.ones(regressor.shape[:2])
        if sampling.leave_rest:
            counted = np.concatenate(_moving(found, measured, sampling))
        return cls(tuple(found), sampling, columns, speed, regressor, counted)

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
        return self.kept(
            lambda one: direction(one.motion.velocity[:, [axis] * len(speeds)], np.array(speeds))
        )

    def friction_slope(self) -> FloatArray:
        """Return the derivative of the torque by v_s, per unit of Coulomb friction, (n_equation, n_axis)."""
        return self.kept(lambda one: direction_slope(one.motion.velocity, self.friction_speed))

    @property
    def coulomb(self) -> list[int]:
        """Columns of the Coulomb friction of each axis."""
        return [column for column, kind in enumerate(self.columns.kinds) if kind == "coulomb"]

    def kept(self, of: Callable[[Experiment], FloatArray]) -> FloatArray:
        """What each experiment gives at all its samples, (n_sample, ...), decimated, one after the other."""
        return np.concatenate([decimate(of(one), self.sampling.decimation) for one in self.each])

    @cached_property
    def torque(self) -> FloatArray:
        """Shape (n_equation, n_axis)."""
        return self.kept(lambda one: one.torque)

    def torque_earlier(self, delay: FloatArray) -> FloatArray:
        """Torque moved back by a delay in s, (n_axis,); shape (n_equation, n_axis)."""
        return self.kept(lambda one: moved_back(one.recorded, delay / one.sample_time)[one.window])

    def rate(self, torque: FloatArray) -> FloatArray:
        """Return the derivative in time of a torque at the equations, per s, (n_equation, n_axis)."""
        return np.concatenate(
            [
                rate(torque[part]) / (self.sampling.decimation * one.sample_time)
                for one, part in zip(self.each, self.parts, strict=True)
            ]
        )

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
            both.append(
                decimate(np.concatenate((torque[..., None], columns), axis=2), self.sampling.decimation)
            )
        found = np.concatenate(both)
        return found[..., 0], found[..., 1:]


def _moving(
    each: Sequence[Experiment], measured: Sequence[FloatArray], sampling: Sampling
) -> list[FloatArray]:
    """One where an axis moves, (n_equation, n_axis) of each experiment; what a low-pass mixes rests together."""
    still = at_rest(
        measured,
        [one.motion.velocity for one in each],
        [one.motion.position for one in each],
        [one.sample_time for one in each],
        sampling.cutoff_hz,
    )
    if sampling.decimation > 1:
        reach = 2 * REACH * sampling.decimation + 1
        near = [scipy.ndimage.maximum_filter1d(one, reach, axis=0) for one in still]
        still = [one[decimated_index(len(one), sampling.decimation)] for one in near]
    return [np.where(one, 0.0, 1.0) for one in still]
