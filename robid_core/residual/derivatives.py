"""Derivatives of all rows of a block, of one configuration after another."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.parameters import FreeParameters
from robid_core.residual.block import TorqueBlock
from robid_core.residual.columns import LinearSlopes, body_derivatives, parameter_columns

BINS_AT_ONCE = 32  # of derivatives: what the processor's cache holds


def derivatives(
    block: TorqueBlock[Any],
    free: FreeParameters,
    coordinates: FloatArray,
    predicted: ComplexArray,
    each_delay: bool,
    sensing: FloatArray | None = None,
) -> Iterator[Iterator[ComplexArray]]:
    """Derivatives of the predicted rows: of one configuration after another, a few bins at a time.

    Shape (n_bin, n_exp, n_row, n_unknown) each; unknowns are the free parameters, the size of each function of
    speed at each axis, gains, delays and mounting angles of sensors behind the gears, the delay (of each axis). Whole
    they would fill the memory.
    """
    robot, motion, n_free = block.robot_at(free, coordinates), block.motion, len(free.names)
    n_law, n_config, n_exp, n_bin, n_axis = block.friction.shape
    bodies = block.bodies = body_derivatives(free, block.robot, coordinates, block.angle, block.bodies)
    linear = LinearSlopes.of_robot(free, robot, block.angle, bodies)
    late = -motion.advancing(predicted[..., : robot.n_axis])
    n_sensor = 0 if block.arm is None else len(block.arm.sensors)
    shown = predicted[..., robot.n_axis :]
    sensing = np.zeros((3, n_sensor)) if sensing is None else sensing
    turned = [] if block.arm is None else block.arm.mounting_slopes(sensing[2])
    mounting = np.eye(n_sensor) if block.arm is None else block.arm.mounting(sensing[2])
    as_mounted = shown @ mounting.T if turned else shown
    earlier = as_mounted if block.arm is None else block.arm.advancing(as_mounted, motion.omega)
    gain = 1 + sensing[0]

    def of_configuration(c: int) -> Iterator[ComplexArray]:
        swing, here = motion.angle_spectrum[c].transpose(1, 0, 2), linear.at(c)
        for first in range(0, n_bin, BINS_AT_ONCE):
            bins = slice(first, first + BINS_AT_ONCE)
            omega = motion.omega[bins]
            n_delay = n_axis if each_delay else 1
            n_friction = n_free + n_law * n_axis
            shape = (len(omega), n_exp, n_axis + n_sensor, n_friction + 2 * n_sensor + len(turned) + n_delay)
            found = np.zeros(shape, dtype=np.complex128)
            parameter_columns(robot, motion, bins, swing[bins], here, found[:, :, :n_axis, :n_free])
            if block.arm is not None and len(here.index):
                above = slice(np.count_nonzero(omega <= 0), None)
                bent = block.arm.slopes(robot, block.angle[c], omega[above], swing[bins][above], here)
                found[above, :, n_axis:, here.index] = bent
            for column in block.simulated:
                slope = (column.remainder[c][:, bins] + column.linear[c][:, bins]).transpose(1, 0, 2)
                found[..., column.index] = slope
            for of_signal in block.signal_columns:
                found[:, :, :n_axis, of_signal.index] = of_signal.torque[c][:, bins].transpose(1, 0, 2)
            for a in range(n_axis):
                laws = block.friction[:, c, :, bins, a].transpose(2, 1, 0)
                found[:, :, a, n_free + a + n_axis * np.arange(n_law)] = laws
            if block.drive_gain is not None:
                found[:, :, :n_axis, :n_friction] /= block.drive_gain[bins, None, :, None]
            later = late[c][:, bins].transpose(1, 0, 2)
            if each_delay:
                for a in range(n_axis):
                    found[:, :, a, a - n_axis] = later[:, :, a]
            else:
                found[:, :, :n_axis, -1] = later
            if block.reported is not None:
                found[:, :, :n_axis] *= block.reported[bins, None, :, None]
            behind = found[:, :, n_axis:]
            if turned:
                behind[..., :n_friction] = np.einsum("ks,fxsp->fxkp", mounting, behind[..., :n_friction])
                here_shown = shown[c, :, bins].transpose(1, 0, 2)
                for j, slope in enumerate(turned, start=n_friction + 2 * n_sensor):
                    behind[..., j] = here_shown @ slope.T
            for k in range(n_sensor):
                row = behind[:, :, k]
                row *= gain[k]
                row[..., n_friction + k] = as_mounted[c, :, bins, k].T
                row[..., n_friction + n_sensor + k] = -gain[k] * earlier[c, :, bins, k].T
            yield found

    return (of_configuration(c) for c in range(n_config))
