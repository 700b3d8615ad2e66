"""The study as one command, from the repository's root: `python -m studies.model_ladder.run`.

Writes the tables beside this file and a page with pictures to `--out`; a minute or two on one core.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np

from robid_core import Robot
from studies.model_ladder import frequency, tracking
from studies.model_ladder.models import LADDER, PLANT, ladder, off_by, without_effects
from studies.model_ladder.page import write_page

HERE = Path(__file__).parent
COMMAND = "python -m studies.model_ladder.run"
DURATIONS_S = (0.8, 1.0, 1.4)
SHARE_OFF = 0.15
WHOLE, OFF, LINEAR = "with effects", "with effects, springs 15 % off", "linear"
BANDS_HZ = ((1, 8), (8, 40), (40, 120))
N_RESONANCE = 8
SEED = 20261121

Row = dict[str, str | float]


def track_all(plant: Robot) -> tuple[list[Row], dict[str, tracking.Tracking]]:
    """Every model on the plant and its variants; the runs of the fastest motion on the plant itself."""
    rows: list[Row] = []
    shown = {}
    models, dwell = ladder(plant), round(tracking.DWELL_S / plant.sample_time_s)
    plants = {WHOLE: plant, OFF: off_by(plant, SHARE_OFF), LINEAR: without_effects(plant)}
    for name, machine in plants.items():
        for duration in DURATIONS_S:
            for rung, model in models.items():
                run = tracking.track(machine, model, duration)
                rows.append(_tracked(name, duration, rung, run, dwell))
                if machine is plant and duration == DURATIONS_S[0]:
                    shown[rung] = run
            late = tracking.track(machine, models[LADDER[-1]], duration, aligned=False)
            rows.append(_tracked(name, duration, f"{LADDER[-1]}, half a sample late", late, dwell))
    return rows, shown


def _tracked(plant: str, duration: float, model: str, run: tracking.Tracking, dwell: int) -> Row:
    return {"plant": plant, "duration_s": duration, "model": model, **tracking.summary(run, dwell)}


def respond_all(
    plant: Robot,
) -> tuple[list[Row], list[Row], dict[str, dict[str, frequency.Responses]]]:
    """Errors of the models' responses, resonances, and the responses themselves, by pose and model."""
    errors: list[Row] = []
    resonances: list[Row] = []
    shown: dict[str, dict[str, frequency.Responses]] = {}
    models, inertia = ladder(plant), plant.drives.rotor_inertia
    for number, (pose, angle) in enumerate(frequency.POSES.items()):
        measured = frequency.measure(plant, angle, SEED + number)
        shown[pose] = {"measured": measured.responses}
        line = measured.responses.frequency_hz
        for rung, model in models.items():
            shown[pose][rung] = found = frequency.modelled(model, angle, measured)
            for output in ("motor", "tool"):
                error = frequency.relative_error(
                    getattr(found, output), getattr(measured.responses, output), inertia
                )
                medians = {
                    f"error_{low}_{high}_hz": float(np.median(error[(line >= low) & (line < high)]))
                    for low, high in BANDS_HZ
                }
                errors.append({"pose": pose, "output": output, "model": rung, **medians})
            resonances.append(_resonances(pose, rung, frequency.resonances_hz(model, angle)))
        small = frequency.resonances_hz(plant, angle)
        resonances.append(_resonances(pose, "plant, small motion", small))
        peaks = frequency.peaks_hz(measured.responses, inertia)
        resonances.append(_resonances(pose, "plant, measured peaks", peaks))
    return errors, resonances, shown


def _resonances(pose: str, model: str, found: frequency.FloatArray) -> Row:
    values = {f"f{k + 1}_hz": float(f) for k, f in enumerate(found[:N_RESONANCE])}
    return {"pose": pose, "model": model, **values}


def write_table(path: Path, rows: list[Row]) -> None:
    """Write rows as CSV, four significant digits, with the command that makes it again."""
    keys = list(dict.fromkeys(key for row in rows for key in row))
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"# {COMMAND}\n")
        writer = csv.DictWriter(file, keys, lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})


def main() -> None:
    """Run both parts, write tables and page, say what came out."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/model_ladder"), help="folder of the page")
    arguments = parser.parse_args()
    plant = Robot.load(PLANT)
    tracked, runs = track_all(plant)
    errors, resonances, responses = respond_all(plant)
    for name, rows in (("tracking", tracked), ("responses", errors), ("resonances", resonances)):
        write_table(HERE / f"{name}.csv", rows)
    arguments.out.mkdir(parents=True, exist_ok=True)
    page = write_page(arguments.out / "page.html", tracked, errors, resonances, runs, responses)
    for row in tracked:
        if row["plant"] == WHOLE:
            print(
                f"{row['duration_s']} s  {row['model']:30} tool {row['tool_rms_mm']:7.3f} mm rms, "
                f"{row['tool_max_mm']:7.3f} max; path {row['path_rms_mm']:7.3f} rms; motors "
                f"{row['motor_rms_mrad']:6.3f} mrad rms"
            )
    print(f"{len(LADDER)} models, page: {page}")


if __name__ == "__main__":
    main()
