"""Speed of `fit.rigid` on 25 000 samples of six axes against the plain way with pinocchio's regressor, as a table.

    python tests/bench/rigid.py [--rounds 5]

Contestants take turns in this process on one thread; times are medians over rounds. Both begin with recorded angles and
torques, filter, differentiate, and estimate bodies and friction with every sample. The plain way calls
`pinocchio.computeJointTorqueRegressor` sample by sample and solves least squares for base parameters (a column-pivoted
QR): no delay of a torque, no tolerance, no physical consistency, no standard error that counts colour.
"""

from __future__ import annotations

import argparse
import logging
import os
import sys
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported
for _folder in (Path(__file__).parent, Path(__file__).parents[1]):
    if str(_folder) not in sys.path:
        sys.path.append(str(_folder))

import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
import pinocchio as pin  # noqa: E402
import scipy  # noqa: E402
from oracles.rigid_arm import pinocchio_model, record_of  # noqa: E402
from stopwatch import Contestant, Race  # noqa: E402

from robid_core import Context, Robot  # noqa: E402
from robid_core.estimation.rigid.rigid_torque import motor_torque  # noqa: E402
from robid_core.residual import rigid_drives  # noqa: E402
from robid_core.stage import map_in_process  # noqa: E402
from robid_fit.rigid import RigidBodyFit  # noqa: E402

STEP, N_SAMPLE, CUTOFF_HZ = 1e-3, 25_000, 20.0
ASKED_S = 4.0
FIXED = ("friction.*.speed", "mass.*", "centre_of_mass.*")
FloatArray = npt.NDArray[np.float64]


def stiff_arm() -> Robot:
    """The packaged arm of six axes without its springs."""
    return Robot(Robot.load("six_axis").description.model_copy(update={"bearings": {}}))


def recording(robot: Robot, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Motor angles and torques of slow waves, with noise, (N_SAMPLE, n_axis) each."""
    draw, time = np.random.default_rng(seed), STEP * np.arange(N_SAMPLE)
    rate, phase = (
        draw.uniform(0.5, 6.0, (6, 1, robot.n_axis)),
        draw.uniform(0, 2 * np.pi, (6, 1, robot.n_axis)),
    )
    size = draw.uniform(0.05, 0.2, (6, 1, robot.n_axis))
    waves = rate * time[:, None] + phase
    joints = np.array([0.2, 0.4, -0.3, 0.5, 0.6, 0.1]) + (size * np.sin(waves)).sum(axis=0)
    speed, acceleration = (
        (size * rate * np.cos(waves)).sum(axis=0),
        -(size * rate**2 * np.sin(waves)).sum(axis=0),
    )
    motion = [robot.motor_angle(one) for one in (joints, speed, acceleration)]
    torque = motor_torque(rigid_drives(robot), *motion)
    noise = 0.01 * torque.std(axis=0) * draw.standard_normal(torque.shape)
    return motion[0], torque + noise


def plain(robot: Robot, angle: FloatArray, torque: FloatArray) -> FloatArray:
    """Base parameters by least squares, as one writes it down."""
    sos = scipy.signal.butter(4, CUTOFF_HZ, fs=1 / STEP, output="sos")
    smooth = scipy.signal.sosfiltfilt(sos, angle, axis=0)
    speed = np.gradient(smooth, STEP, axis=0)
    motor = (smooth, speed, np.gradient(speed, STEP, axis=0))
    joint = [one @ robot.drives.gear.T for one in motor]
    model = pinocchio_model(robot)
    data, n = model.createData(), robot.n_axis
    rows = np.empty((N_SAMPLE, n, 10 * n + 4 * n))
    for k, (q, v, a) in enumerate(zip(*joint, strict=True)):
        rows[k, :, : 10 * n] = robot.drives.gear.T @ pin.computeJointTorqueRegressor(model, data, q, v, a)
    rows[:, :, 10 * n :] = 0.0
    for kind, signal in enumerate((motor[2], motor[1], np.tanh(motor[1] / robot.drives.friction_speed))):
        rows[:, range(n), range((10 + kind) * n, (11 + kind) * n)] = signal
    rows[:, range(n), range(13 * n, 14 * n)] = 1.0
    driven = scipy.signal.sosfiltfilt(sos, torque, axis=0)
    weight = 1 / driven.std(axis=0)
    matrix = (rows * weight[:, None]).reshape(-1, rows.shape[2])
    _, r, pivot = scipy.linalg.qr(matrix, mode="economic", pivoting=True)
    rank = int((np.abs(np.diag(r)) > 1e-8 * abs(r[0, 0])).sum())
    found: FloatArray = np.linalg.lstsq(matrix[:, pivot[:rank]], (driven * weight).ravel(), rcond=None)[0]
    return found


def main() -> None:
    """Run the race and print its table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    robot = stiff_arm()
    angle, torque = recording(robot)
    record = record_of(robot, angle, torque)
    context = Context(
        np.random.default_rng(0), map_in_process, lambda *_, **__: None, logging.getLogger("bench")
    )
    every = RigidBodyFit(cutoff_hz=CUTOFF_HZ, fixed=FIXED, decimation=1)
    usual = RigidBodyFit(cutoff_hz=CUTOFF_HZ, fixed=FIXED)
    fit = every.run((record,), robot, context)
    race = Race(
        {
            "every sample": Contestant(lambda: every.run((record,), robot, context), 1.0),
            "as by default": Contestant(lambda: usual.run((record,), robot, context), 1.0),
            "plain": Contestant(lambda: plain(robot, angle, torque), 1.0),
        },
        given.rounds,
    )
    print(f"{N_SAMPLE} samples of {robot.n_axis} axes, {len(fit.parameters.names)} unknowns: {fit.status}")
    for name in race.rates:
        print(f"{name:14s} {1 / race.rate(name):6.2f} s")
    print(
        f"every sample: {1 / race.rate('every sample'):.2f} s (asked: at most {ASKED_S:g}), "
        f"{race.ratio('every sample', 'plain'):.2f} x the plain way"
    )


if __name__ == "__main__":
    main()
