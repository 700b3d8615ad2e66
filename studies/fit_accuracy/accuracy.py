"""The table of scenarios: how large are errors against what is asked and what noise allows, and do intervals cover?"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from studies.fit_accuracy.comparison import compared
from studies.fit_accuracy.experiments import Experiments
from studies.fit_accuracy.measurement import measured
from studies.fit_accuracy.plants import Plant, drawn
from studies.fit_accuracy.scenarios import SCENARIOS
from studies.fit_accuracy.simulators import SIMULATORS
from studies.fit_accuracy.springs import QUANTILE, columns
from studies.fit_accuracy.tables import Question, Row

FOREIGN_PERIOD_S = 4.0


def plant_of(simulator: str, scenario: str, seed: int) -> tuple[Plant, int]:
    """Draw the plant of a row, and the seed of its poses, phases and noise."""
    chosen = SCENARIOS[scenario]
    number = (list(SCENARIOS).index(scenario), seed, 20261122, int(simulator == "own"))
    plant = drawn(number, chosen.hidden, chosen.told, chosen.as_told)
    return plant, int(np.random.default_rng(number).integers(2**31))


def experiments_of(simulator: str, scenario: str) -> Experiments:
    """Experiments of a scenario; periods are shorter on the foreign simulator."""
    experiments = SCENARIOS[scenario].experiments
    return replace(experiments, period_s=FOREIGN_PERIOD_S) if simulator == "foreign" else experiments


def row(scenario: str, seed: int, simulator: str) -> Row:
    """Measure a plant, fit it, compare."""
    machine, experiments = SIMULATORS[simulator], experiments_of(simulator, scenario)
    plant, measuring = plant_of(simulator, scenario, seed)
    started = time.perf_counter()
    record = measured(plant, experiments, measuring, machine)
    seconds = time.perf_counter() - started
    noise = machine.torque_noise(plant.robot)
    return {"simulation_s": f"{seconds:.0f}"} | compared(
        plant, record, noise, seed, SCENARIOS[scenario].chain, experiments.payload_kg
    )


def report(rows: list[Row], simulator: str) -> list[str]:
    """One line a scenario, and the coverage of all that the torque residual fitted on the packaged robot."""
    head = (
        f"{'robid' if simulator == 'own' else 'MuJoCo':16}{'plants':>7}{'rms %':>9}{'asked':>7}{'/bound':>8}"
    )
    head += f"{'asked':>7}{'worst %':>9}{'rms z':>7}{'max z':>7}{'covered':>9}{'width %':>9}{'misfit':>16}{'fit s':>7}"
    lines, covered = [head], []
    for key, scenario in SCENARIOS.items():
        own_rows = [row for row in rows if row["scenario"] == key]
        if not own_rows:
            continue
        error, stated, bound = (columns(own_rows, what) for what in ("error", "stated", "bound"))
        rms, z = np.sqrt((error**2).mean()), np.abs(error / stated)
        if scenario.told == "six_axis" and scenario.chain == SCENARIOS["worked_example"].chain:
            covered.append(z <= QUANTILE)
        misfit = np.array([float(row["misfit"]) for row in own_rows])
        asked = scenario.asked_own if simulator == "own" else scenario.asked_foreign
        over_bound = None if simulator == "own" else scenario.asked_over_bound
        lines.append(
            f"{key:16}{len(own_rows):7}{100 * rms:9.4f}{_told(asked):>7}{rms / np.sqrt((bound**2).mean()):8.2f}"
            f"{_told(over_bound):>7}{100 * np.abs(error).max():9.4f}{np.sqrt((z**2).mean()):7.2f}{z.max():7.2f}"
            f"{100 * (z <= QUANTILE).mean():8.1f}%{100 * QUANTILE * np.median(stated):9.4f}"
            f"{np.median(misfit):8.3f}-{misfit.max():<8.3g}"
            f"{np.median([float(row['fit_s']) for row in own_rows]):6.0f}"
        )
    if covered:
        whole = np.concatenate(covered)
        least = 100 * whole.mean(axis=0).min()
        lines.append(
            f"torque residual, six_axis: covered {100 * whole.mean():.1f} %, each spring {least:.0f} % at least"
        )
    return lines


def _told(number: float | None) -> str:
    return "-" if number is None else f"{number:g}"


def question(simulator: str) -> Question:
    """The table of a simulator, own or foreign."""
    chosen = [key for key, scenario in SCENARIOS.items() if simulator in scenario.simulators]
    make: Callable[..., Row] = partial(row, simulator=simulator)
    return Question({"scenario": chosen}, "seed", make, partial(report, simulator=simulator))
