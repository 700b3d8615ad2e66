"""How much motion does a spring's stiffness take? Errors and intervals over amplitude and seconds of motion.

Wear shows as a change of stiffness, and a robot at work gives little time for a test. Plants are those of the scenario
`inertia` on robid's simulator: springs 25 to 40 % off, all inertial numbers 1 % wrong. Amplitude is that of all motor
speeds over the worked example's, the slow sine's included; at low amplitude motors stand still for longer at each
reversal, and Coulomb friction takes a larger share of the torque (`standstill`: share of the samples in which a motor
is slower than its friction's zero speed, mean over motors).
"""

from __future__ import annotations

import numpy as np

from robid_core import Record
from studies.fit_accuracy.accuracy import plant_of
from studies.fit_accuracy.comparison import compared
from studies.fit_accuracy.experiments import Experiments
from studies.fit_accuracy.measurement import measured
from studies.fit_accuracy.plants import Plant
from studies.fit_accuracy.simulators import SIMULATORS
from studies.fit_accuracy.springs import QUANTILE, columns
from studies.fit_accuracy.tables import Question, Row

SCENARIO = "inertia"
AMPLITUDES = ("0.1", "0.2", "0.5", "1")
PERIOD_S = 4.0
PLANS = {
    "8": (1, 1),
    "16": (2, 1),
    "32": (4, 1),
    "96": (4, 3),
    "384": (8, 6),
}  # seconds: poses, experiments each
ASKED = (0.01, 0.003)


def experiments_of(seconds: str, amplitude: float) -> Experiments:
    """So many seconds of motion, two periods of four seconds each; more poses first."""
    poses, each = PLANS[seconds]
    found = Experiments(poses=poses, each=each, period_s=PERIOD_S, amplitude=amplitude)
    assert found.motion_s == float(seconds)
    return found


def row(amplitude: str, seconds: str, seed: int) -> Row:
    """Measure a plant for so long, fit it, compare."""
    own = SIMULATORS["own"]
    plant, measuring = plant_of("own", SCENARIO, seed)
    record = measured(plant, experiments_of(seconds, float(amplitude)), measuring, own)
    found = compared(plant, record, own.torque_noise(plant.robot), seed)
    return {"standstill": f"{standstill(plant, record):.3f}"} | found


def standstill(plant: Plant, record: Record) -> float:
    """Share of the samples in which a motor is slower than its friction's zero speed, mean over motors."""
    slow = np.array([axis.friction.speed for axis in plant.robot.description.axes.values()])
    speed = np.gradient(record.run.values("motor_position"), plant.robot.sample_time_s, axis=-2)
    return float((np.abs(speed) < slow).mean())


def report(rows: list[Row]) -> list[str]:
    """Rms error and half the 95 % interval for each amplitude and time; the least of them that are enough."""
    lines = [
        f"{'amplitude':>10}{'seconds':>9}{'plants':>8}{'rms %':>9}{'worst %':>9}{'width %':>9}{'covered':>9}"
        f"{'misfit':>8}{'still':>7}"
    ]
    error_of: dict[tuple[str, str], float] = {}
    for amplitude in AMPLITUDES:
        for seconds in PLANS:
            own_rows = [row for row in rows if (row["amplitude"], row["seconds"]) == (amplitude, seconds)]
            if not own_rows:
                continue
            error, stated = columns(own_rows, "error"), columns(own_rows, "stated")
            rms = error_of[amplitude, seconds] = float(np.sqrt((error**2).mean()))
            misfit, still = (
                np.median([float(row[what]) for row in own_rows]) for what in ("misfit", "standstill")
            )
            lines.append(
                f"{amplitude:>10}{seconds:>9}{len(own_rows):8}{100 * rms:9.4f}{100 * np.abs(error).max():9.4f}"
                f"{100 * QUANTILE * np.median(stated):9.4f}{100 * (np.abs(error) <= QUANTILE * stated).mean():8.1f}%"
                f"{misfit:8.3f}{still:7.2f}"
            )
    return lines + [line for asked in ASKED for line in least(error_of, asked)]


def least(error_of: dict[tuple[str, str], float], asked: float) -> list[str]:
    """Least amplitude at all, and least time at each amplitude, with which the rms error is what is asked."""
    times = {
        amplitude: next((s for s in PLANS if error_of.get((amplitude, s), np.inf) <= asked), None)
        for amplitude in AMPLITUDES
    }
    enough = [f"{seconds} s at {amplitude}" for amplitude, seconds in times.items() if seconds]
    lowest = next((amplitude for amplitude, seconds in times.items() if seconds), "none of these")
    return [f"{100 * asked:g} %: least amplitude {lowest}; least time {', '.join(enough) or 'none'}"]


QUESTION = Question({"amplitude": AMPLITUDES, "seconds": tuple(PLANS)}, "seed", row, report)
