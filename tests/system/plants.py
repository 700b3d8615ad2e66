"""Accuracy and honesty of the main job over plants: `python tests/system/plants.py --seeds 1-20`.

Every seed has another plant: each stiffness, damping and friction of the nominal robot drawn within +-30 %, the
pipeline's own seed another too. The job is pipeline.yaml with the drives simulated in memory (the bus adds
quantisation only, a test holds that) and without what comes after the fits. One line for each of both fits and
each seed goes into the table; a seed that stands there is not run again.
"""

from __future__ import annotations

import argparse
import csv
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from robid_core import Fit, Robot

ROOT = Path(__file__).parents[2]
SPREAD = 0.3
FITS = ("fit", "log_fit")  # of pipeline.yaml: from the torque of the measured motion, from responses


def drawn_plant(seed: int) -> tuple[str, dict[str, float]]:
    """Robot file of a plant and its true stiffnesses."""
    nominal = Robot.load("six_axis")
    generator = np.random.default_rng([seed, 20261121])
    drawn = {
        name: value * (1 + generator.uniform(-SPREAD, SPREAD))
        for name, value in nominal.parameters().items()
        if nominal.parameter_kind(name) in ("stiffness", "damping", "friction")
    }
    lines = [f"  {name}: {value!r}" for name, value in drawn.items()]
    text = "\n".join(["robid_robot: 1", "name: drawn", "base: six_axis", "parameters:", *lines, ""])
    return text, {name: drawn[name] for name in nominal.stiffness_names}


def fitted(seed: int, starts: int) -> tuple[dict[str, Fit], dict[str, float]]:
    """Run the job as a user would and read the fits."""
    plant, truth = drawn_plant(seed)
    with tempfile.TemporaryDirectory() as folder:
        text = (ROOT / "pipeline.yaml").read_text(encoding="utf-8")
        text = re.sub(r"(?m)^seed: \d+", f"seed: {seed}", text)
        text = re.sub(r"(?m)^drives: .*$", "drives: {use: simulated, with: {plant: plant.yaml}}", text)
        text = re.sub(r"starts: \d+", f"starts: {starts}", text)
        Path(folder, "plant.yaml").write_text(plant, encoding="utf-8")
        Path(folder, "pipeline.yaml").write_text(text, encoding="utf-8")
        robid = str(Path(sys.executable).with_name("robid"))
        for name in FITS:
            subprocess.run([robid, "run", "-q", "--until", name, "pipeline.yaml"], cwd=folder, check=True)
        found = {name: next(Path(folder, "runs").rglob(f"{name}.h5")) for name in FITS}
        return {name: Fit.read(path) for name, path in found.items()}, truth


def row_of(seed: int, name: str, fit: Fit, truth: dict[str, float]) -> dict[str, str]:
    """Relative error and stated relative standard error of each stiffness."""
    row = {"seed": str(seed), "fit": name, "converged": str(fit.converged)}
    table = fit.parameters
    for name, value in truth.items():
        index = table.names.index(name)
        row[f"error.{name}"] = f"{table.estimate[index] / value - 1:.4e}"
        row[f"stated.{name}"] = f"{table.standard_error[index] / table.estimate[index]:.4e}"
    return row


def summary(rows: list[dict[str, str]]) -> list[str]:
    """What the table says."""
    names = [key.removeprefix("error.") for key in rows[0] if key.startswith("error.")]
    error = np.array([[float(row[f"error.{n}"]) for n in names] for row in rows])
    stated = np.array([[float(row[f"stated.{n}"]) for n in names] for row in rows])
    limit = np.array([0.10 if n.startswith("gear") else 0.25 for n in names])
    within = (np.abs(error) <= limit).all(axis=1)
    ratio = np.sqrt((stated**2).mean(axis=0)) / np.sqrt((error**2).mean(axis=0))
    common = error.mean(axis=0) ** 2 / (error**2).mean(axis=0)
    head = f"{'parameter':32} {'rms error %':>12} {'worst %':>9} {'stated %':>9} {'stated/rms':>10} {'of it mean':>10}"
    lines = [head]
    for i, name in enumerate(names):
        rms, worst = 100 * np.sqrt((error[:, i] ** 2).mean()), 100 * np.abs(error[:, i]).max()
        numbers = (
            f"{rms:12.4f} {worst:9.4f} {100 * stated[:, i].mean():9.4f} {ratio[i]:10.2f} {common[i]:10.2f}"
        )
        lines.append(f"{name:32} {numbers}")
    covered = np.abs(error) <= 1.96 * stated
    lines.append(f"every gear within 10 % and bearing within 25 %: {within.sum()} of {len(rows)} plants")
    lines.append(
        f"stated over real error, geometric mean over parameters: {np.exp(np.log(ratio).mean()):.2f}"
    )
    lines.append(f"95 % intervals that hold the truth: {100 * covered.mean():.1f} %")
    return lines


def main() -> None:
    """Fill the table and print its summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="1-20", help="first and last seed")
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--table", type=Path, default=Path("plants.csv"))
    arguments = parser.parse_args()
    first, last = (int(part) for part in arguments.seeds.split("-"))
    rows = []
    if arguments.table.exists():
        with arguments.table.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    for seed in range(first, last + 1):
        if any(row["seed"] == str(seed) for row in rows):
            continue
        fits, truth = fitted(seed, arguments.starts)
        rows += [row_of(seed, name, fit, truth) for name, fit in fits.items()]
        with arguments.table.open("w", encoding="utf-8", newline="") as file:
            file.write(
                f"# python tests/system/plants.py --seeds {arguments.seeds} --starts {arguments.starts}\n"
            )
            writer = csv.DictWriter(file, rows[0].keys())
            writer.writeheader()
            writer.writerows(rows)
        print(f"seed {seed} done", flush=True)
    for name in FITS:
        print("\n".join([name, *summary([row for row in rows if row["fit"] == name])]))


if __name__ == "__main__":
    main()
