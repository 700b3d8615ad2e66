"""Whether the torque of an axis says more without the samples at which it turns back.

Where friction turns with the sign of the speed within what the measured angles resolve, their noise makes noise of the
torque that friction takes, by the slope of friction: only about the turns, but a spectrum spreads it over all bins, and
what all other samples say is lost in it. Without the turns fewer samples count, in less noise. What counts for more is
decided by the noise alone, whatever a model leaves unexplained. Of motions that do not repeat, whose noise is that of
the robot file, only what samples do not resolve of friction is known so.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from robid_core.arrays import BoolArray, FloatArray
from robid_core.estimation.sticks import MOVES, STAYS
from robid_core.residual.block import TorqueBlock
from robid_core.residual.moving_samples import FADES, FAINT, MovingSamples, moving_samples, turning_seldom
from robid_core.residual.problem import TorqueProblem
from robid_core.robot import Robot


def clearer_without_turns(problem: TorqueProblem, point: FloatArray) -> tuple[str, ...]:
    """Return the axes whose torques say more without the samples at which they turn back.

    Information of a bin is the share of the samples that count over the variance of the noise; its logarithm is
    averaged over the lower half of the band, in which all that counts does so whole, as determinants of information
    matrices are compared (D-optimality). Not of axes that turn back all the time.

    Parameters
    ----------
    problem, point
        A fit; axes whose turns do not count in it already are not among those returned.
    """
    names = problem.free.robot.axis_names
    motions = [block.motion for block in problem.blocks]
    seldom, gain = turning_seldom(motions), np.zeros(len(names))
    if not seldom.any():
        return ()
    size, robots = problem.friction_size(point), problem.robots(point)
    for block, robot, moving in zip(problem.blocks, robots, moving_samples(motions, seldom), strict=True):
        if moving is not None:
            without, counted = (
                _information(one, robot, size) for one in (_counting(block, moving, robot, size), block)
            )
            before = 1.0 if block.moving is None else block.moving.weight[..., : len(gain)]
            fewer = _moves(block) & (moving.weight < before).any(axis=(0, 1, 2))
            ratio = np.divide(without, counted, out=np.ones_like(counted), where=counted > 0)
            gain += fewer * np.log(np.maximum(ratio, FAINT)).sum(axis=0) * np.prod(block.measured.shape[:2])
    return tuple(names[axis] for axis in np.flatnonzero(seldom & (gain > 0)))


def _moves(block: TorqueBlock[Any]) -> BoolArray:
    """Whether each axis moves in some experiment, (n_axis,): a record in which it stands still shows no turns."""
    far = MOVES * STAYS * np.sqrt(block.motion.angle_noise)
    moves: BoolArray = (np.ptp(block.motion.angle, axis=2) > far).any(axis=(0, 1))
    return moves


def _counting(
    block: TorqueBlock[Any], moving: MovingSamples, robot: Robot, coefficient: FloatArray
) -> TorqueBlock[Any]:
    """Return a copy of a block in which other samples count, its friction evaluated with them."""
    other = copy.copy(block)
    other.moving = moving if block.arm is None else moving.with_sensors(len(block.arm.sensors))
    other.unresolved = np.zeros_like(block.unresolved)
    other.renew_friction(robot, coefficient)
    return other


def _information(block: TorqueBlock[Any], robot: Robot, coefficient: FloatArray) -> FloatArray:
    """Share of the samples that count over the variance of the noise, (n_bin, n_axis) of the lower half of the band."""
    lower, motors = slice(1, max(int(FADES * len(block.motion.bin)), 2)), slice(robot.n_axis)
    noise = np.einsum("faa->fa", block.noise(robot, coefficient)).real
    share, noise = block.share.mean(axis=(0, 1))[lower, motors], noise[lower, motors]
    information: FloatArray = np.divide(share, noise, out=np.zeros_like(share), where=noise > 0)
    return information
