"""The torque residual as a least-squares problem: blocks of records that share parameters, and priors.

Unknowns, in this order: coordinates of the free parameters (natural scales, zero at the start); sizes of the friction
functions, of each axis; errors of the gains of sensors behind the gears, their delays, and angles by which inertial
units are turned; delays of the measured torques, one in common or one of each axis.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.parameters import FreeParameters
from robid_core.residual.arm_sensors import ArmSensor
from robid_core.residual.block import TorqueBlock
from robid_core.residual.derivatives import derivatives
from robid_core.residual.weighting import Weighting
from robid_core.robot import Robot

FRICTION_PRIOR = (
    0.3  # of the torque limit, or of the largest recorded torque where the robot file tells none: no told
)
# level, which would freeze what is told as zero


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Weighted derivatives of the residual at one point, and the weights; both hold for many steps about it."""

    weights: tuple[Weighting, ...]
    """Of each block."""
    rows: tuple[FloatArray, ...]
    """Weighted derivatives of each group, (n_row, n_unknown)."""
    matrices: FloatArray
    """``J^T J`` of each group, a configuration of a block, (n_group, n_unknown, n_unknown)."""
    whole: FloatArray
    """Their sum and what the priors add, (n_unknown, n_unknown)."""


@dataclass(frozen=True, eq=False)
class TorqueProblem:
    """Residuals, normal equations and priors of all blocks together."""

    free: FreeParameters
    blocks: tuple[TorqueBlock[Any], ...]
    friction_names: tuple[str, ...]
    """Of the functions of speed."""
    mean_counts: bool = True
    """Whether the mean torque is among the data."""
    each_delay: bool = False
    """Whether each axis has a delay of its own."""
    gain_prior: float = 0.01
    """Standard deviation of the gains of sensors behind the gears, relative."""
    mounting_prior: float = 0.02
    """Standard deviation of the angles by which inertial units are turned on their links, rad."""
    doubt: float = 1.0
    """Misfit by which weights are too large, where that is known: functions of speed are believed as much less."""

    # Unknowns

    @property
    def n_free(self) -> int:
        """Number of free parameters of the robot."""
        return len(self.free.names)

    @property
    def n_unknown(self) -> int:
        """Number of all unknowns."""
        return self._n_robot + 2 * len(self.sensors) + len(self.mounted) + self.n_delay

    @property
    def _n_robot(self) -> int:
        """Number of free parameters and of sizes of friction functions."""
        return self.n_free + len(self.friction_names) * self.free.robot.n_axis

    @property
    def sensors(self) -> tuple[ArmSensor, ...]:
        """Sensors behind the gears, the same in all blocks."""
        arm = self.blocks[0].arm
        return () if arm is None else arm.sensors

    @property
    def mounted(self) -> tuple[int, ...]:
        """Numbers of the sensors that are components of inertial units: about each of them its unit may be turned."""
        return tuple(k for k, one in enumerate(self.sensors) if one.is_inertial)

    @property
    def n_delay(self) -> int:
        """Number of delays."""
        return self.free.robot.n_axis if self.each_delay else 1

    @property
    def prior(self) -> FloatArray:
        """Standard deviation of each unknown about zero, shape (n_unknown,)."""
        limit = self.free.robot.drives.torque_limit_or(self.largest_torque)
        limit = FRICTION_PRIOR * limit / np.sqrt(self.doubt)
        n_sensor = len(self.sensors)
        gain = np.full(n_sensor, self.gain_prior)
        late = np.full(n_sensor + self.n_delay, self.blocks[0].motion.sample_time_s)
        turned = np.full(len(self.mounted), self.mounting_prior)
        sensed = gain, late[:n_sensor], turned, late[n_sensor:]
        return np.concatenate((self.free.prior, np.tile(limit, len(self.friction_names)), *sensed))

    @functools.cached_property
    def largest_torque(self) -> FloatArray:
        """Largest recorded torque of each motor, N m, shape (n_axis,): what its limit cannot be below."""
        recorded = [np.abs(block.recorded.torque).max(axis=(0, 1, 2)) for block in self.blocks]
        largest: FloatArray = np.max(recorded, axis=0)
        return largest

    def nuisance_names(self) -> tuple[str, ...]:
        """Names of the unknowns that are no parameters of the robot, in their order."""
        axes = self.free.robot.axis_names
        return (
            *(f"friction_function.{a}.{law}" for law in self.friction_names for a in axes),
            *(
                f"{kind}.{one.channel}.{axes[one.axis]}"
                for kind in ("gain_error", "delay")
                for one in self.sensors
            ),
            *(f"mounting.{one.channel}.{axes[one.axis]}" for one in self.sensors if one.is_inertial),
            *((f"torque_delay.{a}" for a in axes) if self.each_delay else ("torque_delay",)),
        )

    def without_inertia(self) -> TorqueProblem:
        """Return the problem of a first pass: inertia held, fewer bins and experiments, the mean torque left out.

        What the linear model leaves out is a percent of the torque and smooth: bodies would bend to it.
        """
        free = self.free.without(lambda name: self.free.robot.parameter_kind(name) == "inertia")
        blocks = tuple(block.thinned(block.motion.representative()) for block in self.blocks)
        return replace(self, free=free, blocks=blocks, mean_counts=False)

    def go_on_from(self, other: TorqueProblem) -> None:
        """Begin prescribed motions where those of another problem ended, in records that both have."""
        for block in self.blocks:
            for before in other.blocks:
                if np.array_equal(block.recorded.angle, before.recorded.angle):
                    block.go_on_from(before)

    def robots(self, point: FloatArray) -> list[Robot]:
        """Return the robot of each block at a point."""
        return [block.robot_at(self.free, point[: self.n_free]) for block in self.blocks]

    def friction_size(self, point: FloatArray) -> FloatArray:
        """Sizes of the functions of speed, N m, shape (n_law, n_axis)."""
        return point[self.n_free : self._n_robot].reshape(len(self.friction_names), -1)

    @property
    def friction_curves(self) -> list[list[int]]:
        """Numbers of the unknowns that are friction of one motor: functions of speed, a constant, viscous if free."""
        return friction_columns(self.free, len(self.friction_names))

    def sensing(self, point: FloatArray) -> FloatArray:
        """Errors of gains, delays, s, and mounting angles, rad, of sensors behind the gears, shape (3, n_sensor)."""
        found, told = np.zeros((3, len(self.sensors))), point[self._n_robot : -self.n_delay]
        found[:2] = told[: found[:2].size].reshape(2, -1)
        found[2, list(self.mounted)] = told[found[:2].size :]
        return found

    def delay(self, point: FloatArray) -> FloatArray:
        """Delays of the measured torques, s, shape (1,) or (n_axis,)."""
        return point[-self.n_delay :]

    @property
    def left_out(self) -> tuple[int, ...]:
        """Experiments of each configuration that do not count, since the last robot rattles in them."""
        out = list[int]()
        for block in self.blocks:
            used = block.used
            n_config = block.measured.shape[0]
            out += [0] * n_config if used is None else np.count_nonzero(~used, axis=1).tolist()
        return tuple(out)

    def speeds(self, every: int = 1) -> list[FloatArray]:
        """Speeds of each motor, all blocks one after another, rad/s, (n_sample,) each: of every so many samples.

        Only those that count: of rest data say nothing that is a function of the speed.
        """
        found = []
        for axis in range(self.free.robot.n_axis):
            parts = []
            for block in self.blocks:
                own = block.motion.rate(1)[:, :, ::every, axis]
                if block.moving is not None:
                    own = own[block.moving.at_samples(axis, block.motion.n_sample)[:, :, ::every]]
                parts.append(own.ravel())
            counted = np.concatenate(parts)
            found.append(counted if len(counted) else np.zeros(1))
        return found

    @property
    def at_rest(self) -> FloatArray:
        """Share of the samples that do not count in each motor's torque, since friction holds it, (n_axis,)."""
        n_axis = self.free.robot.n_axis
        shares = [
            np.zeros(n_axis)
            if block.moving is None
            else 1 - block.moving.weight[..., :n_axis].mean(axis=(0, 1, 2))
            for block in self.blocks
        ]
        sizes = [np.prod(block.motion.angle.shape[:3]) for block in self.blocks]
        found: FloatArray = np.average(shares, axis=0, weights=sizes)
        return found

    # Residuals

    def residuals(self, point: FloatArray) -> list[ComplexArray]:
        """Measured less predicted rows of each block, shape (n_config, n_exp, n_bin, n_row)."""
        predicted = self.predicted(point)
        sensed = self.delay(point), self.sensing(point)
        return [block.residual(p, *sensed) for block, p in zip(self.blocks, predicted, strict=True)]

    def counted_residuals(self, point: FloatArray) -> list[ComplexArray]:
        """Likewise, without what axes at rest leave."""
        pairs = zip(self.blocks, self.residuals(point), strict=True)
        return [block.counted(residual) for block, residual in pairs]

    def predicted(self, point: FloatArray) -> list[ComplexArray]:
        """Spectra of each block without delays."""
        size = self.friction_size(point)
        return [
            block.predicted(robot, point[: self.n_free], size)
            for block, robot in zip(self.blocks, self.robots(point), strict=True)
        ]

    def weighted(self, point: FloatArray, weights: tuple[Weighting, ...]) -> list[FloatArray]:
        """Residuals of each block in standard deviations, (n_config, n_exp, n_row) each."""
        residuals = self.residuals(point)
        return [weight.residual(residual) for weight, residual in zip(weights, residuals, strict=True)]

    def cost(self, point: FloatArray, weighted: Sequence[FloatArray]) -> float:
        """Half the sum of squared residuals in standard deviations, and of the priors."""
        return float(0.5 * (((point / self.prior) ** 2).sum() + sum((own**2).sum() for own in weighted)))

    def weightings(self, point: FloatArray, whiteners: Sequence[ComplexArray]) -> tuple[Weighting, ...]:
        """Weights by how often a bin counts: twice, for its mirror image; the mean once or not at all."""
        found = []
        for block, robot, matrix in zip(self.blocks, self.robots(point), whiteners, strict=True):
            count = np.full(len(matrix), np.sqrt(2.0))
            count[0] = 1.0 if self.mean_counts else 0.0
            found.append(
                Weighting.of_block(
                    count[:, None, None] * matrix, block.free_vibration(robot), block.used, block.moving
                )
            )
        return tuple(found)

    # Normal equations

    def linearise(self, point: FloatArray, weights: tuple[Weighting, ...]) -> Linearisation:
        """Weighted derivatives at a point."""
        coordinates, rows, matrices = point[: self.n_free], [], []
        for block, weight, predicted in zip(self.blocks, weights, self.predicted(point), strict=True):
            at = coordinates, predicted, self.each_delay, self.sensing(point)
            for config, runs in enumerate(derivatives(block, self.free, *at)):
                rows.append(weight.columns(config, runs))
                matrices.append(rows[-1].T @ rows[-1])
        whole = np.sum(matrices, axis=0) + np.diag(1 / self.prior**2)
        return Linearisation(weights, tuple(rows), np.stack(matrices), whole)

    def gradients(self, weighted: Sequence[FloatArray], about: Linearisation) -> FloatArray:
        """``J^T r`` of each group for weighted residuals of a point, shape (n_group, n_unknown)."""
        groups = (own.ravel() for block in weighted for own in block)
        return np.stack([rows.T @ own for rows, own in zip(about.rows, groups, strict=True)])


def friction_columns(free: FreeParameters, n_law: int) -> list[list[int]]:
    """Numbers of the unknowns that are friction, motor by motor: functions of speed, a constant, viscous if it is free.

    `n_law`: how many functions there are, the constant among them; they stand behind the free parameters.
    """
    n_free, n_axis = len(free.names), free.robot.n_axis
    columns = [[n_free + number * n_axis + a for number in range(n_law)] for a in range(n_axis)]
    for own, axis in zip(columns, free.robot.axis_names, strict=True):
        name = f"friction.{axis}.viscous"
        own += [free.names.index(name)] if name in free.names else []
    return columns
