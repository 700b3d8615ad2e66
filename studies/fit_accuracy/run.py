"""The study as one command, from the repository's root: `python -m studies.fit_accuracy.run SIMULATOR --seeds 1-20`.

SIMULATOR is `own` or `foreign`. A row of the table is a plant in a scenario; rows that stand there are not made again.
`python -m studies.fit_accuracy.run summary` prints what both tables say.
"""

from __future__ import annotations

import argparse
import csv
import multiprocessing
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported: plants are dealt to processes here

import numpy as np  # noqa: E402

from studies.fit_accuracy.scenarios import SCENARIOS  # noqa: E402
from studies.fit_accuracy.summary import summary  # noqa: E402

HERE = Path(__file__).parent
FOREIGN_PERIOD_S = 4.0


def row_of(key: str, own: bool, seed: int) -> dict[str, str]:
    """Measure a plant, fit it, compare."""
    from robid_fit.torque_residual import TorqueResidualFit
    from studies.fit_accuracy.bound import bound
    from studies.fit_accuracy.measurement import FOREIGN_NOISE, context, measured
    from studies.fit_accuracy.plants import drawn

    scenario = SCENARIOS[key]
    number = (list(SCENARIOS).index(key), seed, 20261122, int(own))
    plant = drawn(number, scenario.hidden)
    experiments = scenario.experiments
    if not own:
        experiments = replace(experiments, period_s=FOREIGN_PERIOD_S)
    started = time.perf_counter()
    record = measured(plant, experiments, int(np.random.default_rng(number).integers(2**31)), own)
    simulated = time.perf_counter()
    drives = plant.robot.description.axes.values()
    noise = np.array([axis.sensors.torque_noise for axis in drives])
    if not own:
        noise = FOREIGN_NOISE * np.array(plant.robot.drives.torque_limit)
    stage = TorqueResidualFit()
    told = {
        f"sensors.{axis}.torque_noise": n for axis, n in zip(plant.nominal.axis_names, noise, strict=True)
    }
    nominal = plant.nominal.with_parameters(told)  # what does not repeat cannot show its noise
    fit = stage.run(record, nominal, context(seed))
    seconds = time.perf_counter() - simulated
    names, table = list(plant.nominal.stiffness_names), fit.parameters
    index = [table.names.index(name) for name in names]
    error = table.estimate[index] / plant.true_stiffness - 1
    stated = table.standard_error[index] / table.estimate[index]
    least = bound(stage.problem(record, nominal), plant.robot, noise, names)
    row = {
        "scenario": key, "seed": str(seed), "simulation_s": f"{simulated - started:.0f}", "fit_s": f"{seconds:.0f}",
        "converged": str(fit.converged), "misfit": f"{fit.misfit:.4f}",
    }  # fmt: skip
    for what, values in (("error", error), ("stated", stated), ("bound", least)):
        row |= {f"{what}.{name}": f"{value:.4e}" for name, value in zip(names, values, strict=True)}
    return row


def read(path: Path) -> list[dict[str, str]]:
    """Rows of a table; none where there is no file."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def write(path: Path, rows: list[dict[str, str]], command: str) -> None:
    """Write a table, by scenario and seed."""
    rows = sorted(rows, key=lambda row: (list(SCENARIOS).index(row["scenario"]), int(row["seed"])))
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"# {command}\n")
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


def main() -> None:
    """Fill a table, or print what the tables say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("simulator", choices=("own", "foreign", "summary"))
    parser.add_argument("--seeds", default="1-20", help="first and last seed")
    parser.add_argument("--scenarios", default=",".join(SCENARIOS))
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=HERE, help="of the tables")
    arguments = parser.parse_args()
    if arguments.simulator == "summary":
        for simulator in ("own", "foreign"):
            print("\n".join(summary(read(arguments.folder / f"{simulator}.csv"), simulator == "own")))
        return
    arguments.folder.mkdir(parents=True, exist_ok=True)
    path, own = arguments.folder / f"{arguments.simulator}.csv", arguments.simulator == "own"
    first, last = (int(part) for part in arguments.seeds.split("-"))
    rows = read(path)
    there = {(row["scenario"], int(row["seed"])) for row in rows}
    wanted = [
        (key, seed)
        for seed in range(first, last + 1)
        for key in arguments.scenarios.split(",")
        if (key, seed) not in there
    ]
    command = f"python -m studies.fit_accuracy.run {arguments.simulator} --seeds {arguments.seeds}"
    workers = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(arguments.jobs, mp_context=workers) as pool:
        jobs = {pool.submit(row_of, key, own, seed): (key, seed) for key, seed in wanted}
        for done, job in enumerate(as_completed(jobs)):
            rows.append(job.result())
            write(path, rows, command)
            print(f"\r{done + 1} of {len(jobs)}: {jobs[job]}   ", end="", file=sys.stderr, flush=True)
    print("\n".join(summary(rows, own)))


if __name__ == "__main__":
    main()
