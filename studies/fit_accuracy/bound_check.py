"""Is the bound right? The scatter of 50 fits of one motion, whose measurement noise is drawn anew, against the bound.

The plant is the foreign one: with robid's own simulator the noise is so small that errors of the numerics count, too.
It is simulated once without noise; each draw adds noise to angles and torques and rounds angles to the encoder's
counts, as the bound has it. The bound counts what priors leave of the inertial numbers, so these are told anew in each
draw, scattered about the truth as their priors promise; with one told set the scatter would be smaller than the bound.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.stats import chi2

from robid_core import Channel, FloatArray, FreeParameters, Record, Robot, chosen_names
from studies.fit_accuracy.accuracy import experiments_of, plant_of
from studies.fit_accuracy.comparison import compared
from studies.fit_accuracy.measurement import measured
from studies.fit_accuracy.plants import INERTIA, Plant
from studies.fit_accuracy.simulators import Foreign
from studies.fit_accuracy.springs import QUANTILE, columns, names
from studies.fit_accuracy.tables import Question, Row

SCENARIO = "one_experiment"  # eight poses: the fit takes five seconds
PLANT = 1


@lru_cache(maxsize=1)
def noiseless() -> tuple[Plant, Record]:
    """Plant and its record without any noise, simulated once in a process."""
    plant, measuring = plant_of("foreign", SCENARIO, PLANT)
    quiet = {
        f"sensors.{axis}.{what}": 0.0
        for axis in plant.robot.axis_names
        for what in ("position_noise", "encoder_counts")
    }
    silent = replace(plant, robot=plant.robot.with_parameters(quiet))
    return plant, measured(silent, experiments_of("foreign", SCENARIO), measuring, Foreign(noise=0.0))


def with_noise(record: Record, robot: Robot, torque_noise: FloatArray, seed: int) -> Record:
    """Add noise of the sensors to a record: white in angle and torque, angles rounded to counts.

    `torque_noise` in N m, shape (n_axis,).
    """
    generator = np.random.default_rng([seed, 3])
    drives = robot.description.axes.values()
    position, torque = (record.run.values(name) for name in ("motor_position", "motor_torque"))
    deviation = np.array([axis.sensors.position_noise for axis in drives])
    count = 2 * np.pi / np.array([axis.sensors.encoder_counts for axis in drives])
    angle = position + deviation * generator.standard_normal(position.shape)
    values = {
        "motor_position": np.rint(angle / count) * count,
        "motor_torque": torque + torque_noise * generator.standard_normal(torque.shape),
    }
    channels = {name: Channel("motor", record.run.channels[name].unit, new) for name, new in values.items()}
    return record.replace(runs=(record.run.replace(channels=channels),))


def told_anew(nominal: Robot, seed: int) -> Robot:
    """Draw the inertial numbers that are told, about the true ones, as their priors promise."""
    free = FreeParameters.of_robot(nominal, chosen_names(list(nominal.layout), INERTIA))
    return free.robot_at(free.prior * np.random.default_rng([seed, 4]).standard_normal(len(free.names)))


def row(draw: int) -> Row:
    """Fit one draw; the true inertial numbers are those of the nominal robot."""
    plant, clean = noiseless()
    noise = Foreign().torque_noise(plant.robot)
    record = with_noise(clean, plant.robot, noise, draw)
    told = replace(plant, nominal=told_anew(plant.nominal, draw))
    return compared(told, record, noise, draw)


def report(rows: list[Row]) -> list[str]:
    """Scatter and mean error of each spring over the bound, errors over what is stated, and coverage."""
    if len(rows) < 3:
        return [f"bound: {len(rows)} draws say nothing"]
    n, (error, stated, bound) = len(rows), (columns(rows, what) for what in ("error", "stated", "bound"))
    scatter = error.std(axis=0, ddof=1) / bound.mean(axis=0)
    mean = error.mean(axis=0) / bound.mean(axis=0) * np.sqrt(n)
    low, high = np.sqrt(chi2.ppf((0.025, 0.975), n - 1) / (n - 1))
    within = np.abs(error / stated) <= QUANTILE
    lines = [
        f"{n} draws of noise: scatter over bound, {low:.2f} to {high:.2f} in 95 % of cases if the bound is right",
        f"{'spring':28}{'scatter':>8}{'mean z':>8}{'rms z':>7}{'covered':>9}",
    ]
    lines += [
        f"{name:28}{s:7.2f}{' ' if low <= s <= high else '!'}{m:8.1f}{z:7.2f}{100 * share:8.1f}%"
        for name, s, m, z, share in zip(
            names(rows),
            scatter,
            mean,
            np.sqrt(((error / stated) ** 2).mean(axis=0)),
            within.mean(axis=0),
            strict=True,
        )
    ]
    outside = int(((scatter < low) | (scatter > high)).sum())
    whole, z = np.sqrt((scatter**2).mean()), np.sqrt(((error / stated) ** 2).mean())
    lines.append(f"{f'all, {outside} outside':28}{whole:7.2f} {'':8}{z:7.2f}{100 * within.mean():8.1f}%")
    return lines


QUESTION = Question({}, "draw", row, report)
