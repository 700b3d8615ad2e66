"""The linear model of a robot as a file for control software: MATLAB and python-control read it without robid.

    s = load('arm.mat'); sys = ss(s.A, s.B, s.C, s.D);                          % MATLAB
    s = scipy.io.loadmat('arm.mat'); control.ss(s['A'], s['B'], s['C'], s['D'])  # python-control

x = [z; z'] with the generalised coordinates z = [motor angles; joints behind springs], u the motor torques: (2.5) to
(2.7) of the thesis. In continuous time: `sample_time` is zero, which both programs take for that.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.io

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

OUTPUTS = ("motor_angle", "motor_speed", "motor_acceleration", "arm_angle")
SUFFIXES = (".mat", ".npz")


def state_space_file(robot: Robot, angle: FloatArray, suffix: str, outputs: Sequence[str] = OUTPUTS) -> bytes:
    """Return what a file of the linear model at one configuration holds.

    Variables: A, B, C, D; state_names, input_names, output_names; angle (joint-side motor angles, rad or m, of the rest
    about which x and u count); torque (of the motors at rest, N m); sample_time (0: continuous); robot, sha256.

    Parameters
    ----------
    robot
        Viscous friction is in its model, Coulomb friction is not; signal effects (lags, delays) are not.
    angle
        Shape (n_axis,).
    suffix
        .mat or .npz.
    outputs
        As in `Robot.linearize`.

    Raises
    ------
    ConfigurationError
        For another suffix, an unknown output, or a configuration of another size.
    """
    if np.shape(angle) != (robot.n_axis,):
        raise ConfigurationError(
            f"{robot.name} has {robot.n_axis} axes ({', '.join(robot.axis_names)}), the configuration has "
            f"{np.size(angle)} numbers"
        )
    model = robot.linearize(angle, tuple(outputs))
    values: dict[str, Any] = {
        "A": model.a,
        "B": model.b,
        "C": model.c,
        "D": model.d,
        "angle": np.asarray(angle, dtype=float),
        "torque": robot.gravity_torque(np.asarray(angle, dtype=float)[None])[0],
        "sample_time": 0.0,
        "robot": robot.name,
        "sha256": robot.sha256,
    }
    names = {
        "state_names": model.state_names,
        "input_names": model.input_names,
        "output_names": model.output_names,
    }
    stream = io.BytesIO()
    if suffix == ".mat":
        cells = {key: np.array(list(entries), dtype=object) for key, entries in names.items()}
        scipy.io.savemat(stream, values | cells, oned_as="column")
    elif suffix == ".npz":
        arrays: dict[str, Any] = {key: np.array(entries) for key, entries in names.items()}
        np.savez(stream, **values, **arrays)
    else:
        raise ConfigurationError(f"a state space goes into {' or '.join(SUFFIXES)}, not into '{suffix}'")
    return stream.getvalue()
