"""What a measurement owes: channels with units and sides, known samples that are numbers, and motors that obeyed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid_core.artifacts import Artifact, Configurations, Excitation, Record
from robid_core.artifacts.dense_run import DenseRun
from robid_core.artifacts.from_arrays import HOLDS
from robid_core.artifacts.record import MEASURED, MOTOR_POSITION
from robid_core.artifacts.units import symbols_of
from robid_core.robot import Robot
from robid_core.testing.broken import ContractBroken

FOLLOWED = (0.4, 2.5)  # motion of a motor over that of the robot: no factor of a gear, a degree or a sign
PERIODS = 4  # that the robot takes to settle
NEAR = 0.2  # rad, joint side, beside the travel: from the configuration that was asked for
EVEN = 1e-6  # of a sampling time


def check_record(name: str, record: Record, inputs: Sequence[Artifact], robot: Robot) -> None:
    """Check one record, and where the stage took an excitation, that the motors followed it where they should."""
    if record.torque_hold not in HOLDS:
        raise ContractBroken(
            f"{name}: torque_hold is '{record.torque_hold}', and must be one of {', '.join(HOLDS)}"
        )
    for run in record.runs:
        _check_run(name, run)
    excitation = next((one for one in inputs if isinstance(one, Excitation)), None)
    asked = next((one for one in inputs if isinstance(one, Configurations)), None)
    if excitation is not None and len(record.runs) == 1 and MOTOR_POSITION in record.run.channels:
        _check_followed(name, record.run, excitation, robot)
        if asked is not None:
            _check_stood(name, record.run, asked, robot)


def _check_run(name: str, run: DenseRun) -> None:
    step = np.diff(run.time_s)
    if run.sample_time_s <= 0 or (np.abs(step / run.sample_time_s - 1) > EVEN).any():
        raise ContractBroken(
            f"{name}: sampling instants (time_s) are not one sample_time_s ({run.sample_time_s:g} s) apart"
        )
    for label, channel in run.channels.items():
        if channel.side not in ("motor", "joint"):
            raise ContractBroken(f"{name}: the side of {label} is '{channel.side}'; it is motor or joint")
        allowed = symbols_of(label)
        if allowed and channel.unit_symbol not in allowed:
            raise ContractBroken(
                f"{name}: {label} is in {channel.unit_symbol or 'no unit'}; by its name it is in {' or '.join(allowed)}"
            )
        if label in MEASURED and not np.isfinite(channel.values[run.valid]).any():
            raise ContractBroken(f"{name}: {label} has no number in any sample that is marked as valid")


def _check_followed(name: str, run: DenseRun, excitation: Excitation, robot: Robot) -> None:
    """Check sign and size of the motion of each motor against what the robot itself does under the first reference."""
    position = run.values(MOTOR_POSITION)
    if position.shape[4] != excitation.n_sample:
        raise ContractBroken(
            f"{name}: periods have {position.shape[4]} samples, those of the excitation {excitation.n_sample}"
        )
    reference = excitation.reference[0, 0, 0]
    stood = robot.joint_angle(np.nanmean(position[0, 0, 0], axis=(0, 1)))
    own = robot.simulate(np.tile(reference, (PERIODS, 1))[None], stood[None]).position[0, -len(reference) :]
    own = own - own.mean(axis=0)
    moved = np.where(run.valid[0, 0, 0, -1][:, None], position[0, 0, 0, -1], np.nan)
    moved = moved - np.nanmean(moved, axis=0)
    gains = np.nansum(moved * own, axis=0) / (own**2).sum(axis=0)
    for axis, gain in enumerate(gains.tolist()):
        if not FOLLOWED[0] <= gain <= FOLLOWED[1]:
            hint = "is its sign turned?" if gain < 0 else "is it in radians, on the motor's side of the gear?"
            raise ContractBroken(
                f"{name}: motor {axis + 1} moved {gain:.3g} times what the robot does under that reference; {hint}"
            )


def _check_stood(name: str, run: DenseRun, asked: Configurations, robot: Robot) -> None:
    """Check that the motors moved about the configurations that were asked for."""
    position = np.where(run.valid[..., None], run.values(MOTOR_POSITION), np.nan)
    stood = robot.joint_angle(np.nanmean(position, axis=(1, 2, 3, 4)))
    off = np.abs(stood - asked.angle)
    if off.max() > NEAR:
        c, a = np.unravel_index(int(off.argmax()), off.shape)
        raise ContractBroken(
            f"{name}: configuration {c} asks for {asked.angle[c, a]:.4g} rad of {robot.axis_names[a]}, joint "
            f"side, and the "
            f"motor was at {stood[c, a]:.4g}"
        )
