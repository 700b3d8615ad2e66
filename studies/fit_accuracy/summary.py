"""What the tables say: errors against what is asked, deviations in stated errors, coverage, misfit."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studies.fit_accuracy.scenarios import SCENARIOS

FloatArray = npt.NDArray[np.float64]

QUANTILE = 1.96  # of a normal distribution, 95 %


def columns(rows: list[dict[str, str]], what: str) -> FloatArray:
    """Numbers of one kind, shape (n_plant, n_spring)."""
    names = [key for key in rows[0] if key.startswith(f"{what}.")]
    return np.array([[float(row[name]) for name in names] for row in rows])


def summary(rows: list[dict[str, str]], own: bool) -> list[str]:
    """One line a scenario."""
    if not rows:
        return []
    head = f"{'robid' if own else 'MuJoCo':18}{'plants':>7}{'rms %':>9}{'asked':>7}{'/bound':>8}{'asked':>7}"
    head += f"{'worst %':>9}{'rms z':>7}{'covered':>9}{'width %':>9}{'misfit':>16}{'fit s':>7}"
    lines, covered = [head], []
    for key, scenario in SCENARIOS.items():
        own_rows = [row for row in rows if row["scenario"] == key]
        if not own_rows:
            continue
        error, stated, bound = (columns(own_rows, what) for what in ("error", "stated", "bound"))
        rms = np.sqrt((error**2).mean())
        within = np.abs(error) <= QUANTILE * stated
        covered.append(within)
        misfit = np.array([float(row["misfit"]) for row in own_rows])
        lines.append(
            f"{key:18}{len(own_rows):7}{100 * rms:9.4f}{scenario.asked_own:7.2f}"
            f"{rms / np.sqrt((bound**2).mean()):8.2f}{scenario.asked_foreign:7.1f}{100 * np.abs(error).max():9.4f}"
            f"{np.sqrt(((error / stated) ** 2).mean()):7.2f}{100 * within.mean():8.1f}%"
            f"{100 * QUANTILE * np.median(stated):9.4f}{np.median(misfit):8.3f}-{misfit.max():<8.3g}"
            f"{np.median([float(row['fit_s']) for row in own_rows]):6.0f}"
        )
    whole = np.concatenate(covered)
    least = 100 * whole.mean(axis=0).min()
    lines.append(f"all scenarios: covered {100 * whole.mean():.1f} %, each spring {least:.0f} % at least")
    return lines
