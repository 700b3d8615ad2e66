"""The same sensors in simulated measurements, as robid fits them: `python -m studies.arm_side_sensors.simulated`.

The whole robot this time: friction, gravity, a control loop, a slow sine that keeps motors from sticking. One record
holds all channels; the fit takes motors alone, and encoders, torque sensors, both, or an inertial unit on the last link
beside them. `simulated.csv` has a line for each spring and set; a set that stands there is not fitted again.
"""

from __future__ import annotations

import csv
import logging
import os
from dataclasses import replace

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported

import numpy as np  # noqa: E402

import robid_core as robid  # noqa: E402
from robid_acquisition.arm_side import UNITS  # noqa: E402
from robid_core.robot.file.axis import InertialSensorEntry  # noqa: E402
from studies.arm_side_sensors.run import HERE, ROBOT  # noqa: E402
from studies.arm_side_sensors.sensors import ADDED, MOTOR  # noqa: E402

TABLE = HERE / "simulated.csv"
TORQUE_NOISE = 1e-3  # of a motor's limit
TORQUE_SHARE = 0.1  # of the limits, for the multisine
OFF = 0.25  # of each spring, at the start of a fit, upwards and downwards in turn
SETS: dict[str, tuple[str, ...]] = {
    "motor side only": (),
    "link encoders": ("joint_position",),
    "joint torque sensors": ("joint_torque",),
    "link encoders and joint torque sensors": ("joint_position", "joint_torque"),
    "accelerometer on the link of axis_6": ("link_acceleration",),
    "accelerometer and gyroscope on the link of axis_6": ("link_acceleration", "link_turn_rate"),
}
TURN_RATE_NOISE = 1e-3  # rad/s, micromechanical
HEAD = ["sensors", "spring", "relative_error", "error_to_motor_side", "deviation_in_stated_errors", "misfit"]


def with_noise(robot: robid.Robot) -> robid.Robot:
    """Return a robot whose sensors have the study's noise."""
    sizes = {
        "position_noise": np.full(robot.n_axis, MOTOR.noise),
        "torque_noise": TORQUE_NOISE * robot.drives.torque_limit,
        "joint_position_noise": np.full(robot.n_axis, ADDED["link encoders"].noise),
        "joint_torque_noise": np.full(robot.n_axis, ADDED["joint torque sensors"].noise),
    }
    unit = InertialSensorEntry(
        acceleration_noise=ADDED["accelerometer at axis_6"].noise, turn_rate_noise=TURN_RATE_NOISE
    )
    axes, last = robot.description.axes, robot.axis_names[-1]
    sensors = axes[last].sensors.model_copy(update={"inertial": unit})
    axes = {**axes, last: axes[last].model_copy(update={"sensors": sensors})}
    robot = replace(robot, description=robot.description.model_copy(update={"axes": axes}))
    return robot.with_parameters(
        {
            f"sensors.{axis}.{name}": float(size)
            for name, values in sizes.items()
            for axis, size in zip(robot.axis_names, values, strict=True)
        }
    )


def record_of(plant: robid.Robot) -> robid.Record:
    """Four poses, six experiments each, two periods of eight seconds, every channel."""
    where = robid.use("design.candidates", count=4)(plant)
    excite = robid.use(
        "excitation.multisine",
        band_hz=(4, 80), lines=40, period_s=8, blocks=1, slow_sine_rad_s=9, torque_share=TORQUE_SHARE,
    )  # fmt: skip
    acquire = robid.use("acquisition.simulated", periods=2, arm_side=list(UNITS))
    record: robid.Record = acquire(where, excite(where, plant), plant)
    return record


def main() -> None:
    """Fit what is not in the table yet."""
    logging.getLogger("robid").setLevel(logging.ERROR)
    rows: list[dict[str, str]] = []
    if TABLE.is_file():
        rows = list(csv.DictReader(TABLE.read_text(encoding="utf-8").splitlines()))
    plant = with_noise(robid.Robot.load(ROBOT))
    record = record_of(plant)
    springs = plant.stiffness_names
    factors = np.where(np.arange(len(springs)) % 2, 1 + OFF, 1 - OFF)
    start = plant.with_parameters(
        {name: plant.parameter(name) * factor for name, factor in zip(springs, factors, strict=True)}
    )
    for label, channels in SETS.items():
        if label in {row["sensors"] for row in rows}:
            continue
        fit = robid.use("fit.torque_residual", arm_side=list(channels))(record, start)
        for name in springs:
            row = fit.parameters.names.index(name)
            true, error = plant.parameter(name), float(fit.parameters.standard_error[row])
            alone = next((r for r in rows if r["sensors"] == "motor side only" and r["spring"] == name), None)
            share = error / true / float(alone["relative_error"]) if alone else 1.0
            values = error / true, share, (fit.parameters.estimate[row] - true) / error, fit.misfit
            rows.append(dict(zip(HEAD, (label, name, *(f"{value:.3g}" for value in values)), strict=True)))
        with TABLE.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, HEAD, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
        shares = [float(r["error_to_motor_side"]) for r in rows if r["sensors"] == label]
        z = np.array([float(r["deviation_in_stated_errors"]) for r in rows if r["sensors"] == label])
        print(
            f"{label:40} error {np.median(shares):.2f} of that of the motor side ({min(shares):.2f} to "
            f"{max(shares):.2f}); deviations {np.sqrt((z**2).mean()):.2f} stated errors rms; misfit {fit.misfit:.3f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
