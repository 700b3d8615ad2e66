"""Each log predicted by the fit of the seven others: `python examples/bam_xl330/leave_one_out.py`.

Stages and settings are those of `pipeline.yaml`; `--set horizon_s=1.0` changes one of the fit's. Logs that stand in the
table (`leave_one_out.csv` beside this file) are not fitted again.
"""

from __future__ import annotations

import argparse
import csv
import json
import logging
import os
import time
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported

import numpy as np  # noqa: E402
from ruamel.yaml import YAML  # noqa: E402

from robid_core import Context, FloatArray, Record, Robot, load_plugin, simulate_record  # noqa: E402
from robid_core.mechanics import SimulationDiverged  # noqa: E402
from robid_core.stage import map_in_process  # noqa: E402

EXAMPLE = Path(__file__).parent
ALL = "none"  # is left out


def stage_of(node: dict[str, Any], **changed: Any) -> Any:
    """Return a stage as the pipeline sets it, with some settings changed."""
    settings = json.dumps(node.get("with", {}) | changed)
    return load_plugin("robid.stages", node["use"]).model_validate_json(settings, strict=True)


def logs_of(stages: dict[str, Any], names: list[str], robot: Robot, context: Context) -> dict[str, Record]:
    """One record for each log, by its name."""
    found = {}
    for name in names:
        record = stage_of(stages[name]).run(robot, context)
        for i, variant in enumerate(record.variants):
            kept = np.zeros(record.run.valid.shape[:3], dtype=bool)
            kept[i] = True
            found[f"{name}_{variant}"] = record.part(kept)
    return found


def error(record: Record, robot: Robot) -> FloatArray:
    """Simulated less recorded angle of a whole log from rest, rad, shape (n_sample,); infinite where it diverges."""
    try:
        made = simulate_record(robot, record).run.values("motor_position")
    except SimulationDiverged:
        return np.full(record.run.values("motor_position").size, np.inf)
    left: FloatArray = (made - record.run.values("motor_position")).ravel()
    return left


def main() -> None:
    """Fill the table, and print what it says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", type=Path, default=EXAMPLE / "leave_one_out.csv")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=JSON", help="a setting of the fit"
    )
    told = parser.parse_args()
    table = told.table.resolve()
    changed = {name: json.loads(value) for name, _, value in (one.partition("=") for one in told.set)}
    data = Path(os.environ.get("ROBID_DATA", EXAMPLE.parents[2] / "shared" / "data")).resolve()
    os.chdir(EXAMPLE)  # robots of variants are told by their files
    pipeline = YAML(typ="safe", pure=True).load(Path("pipeline.yaml"))
    stages, robot = pipeline["stages"], Robot.load(pipeline["robot"], EXAMPLE)
    quiet = logging.getLogger("leave_one_out")
    quiet.setLevel(logging.ERROR)
    context = Context(np.random.default_rng(1), map_in_process, lambda *_: None, quiet, data_root=data)
    logs = logs_of(stages, stages["fit"]["inputs"]["record"], robot, context)
    fit = stage_of(stages["fit"], **changed)
    variants = {name: Robot.load(path, EXAMPLE) for name, path in fit.robots.items()}
    rows: list[dict[str, str]] = []
    if table.is_file():
        rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    for held in (*logs, ALL):
        if held in {row["left_out"] for row in rows}:
            continue
        started = time.process_time()
        found = fit.run(tuple(one for name, one in logs.items() if name != held), robot, context)
        numbers = found.parameters.as_mapping()
        left = {
            name: error(one, variants.get(one.variants[0], robot).with_parameters(numbers))
            for name, one in logs.items()
            if held in (ALL, name)
        }
        every = np.concatenate(list(left.values()))
        rows.append(
            {
                "left_out": held,
                "rms_rad": f"{np.sqrt(np.mean(every**2)):.4f}",
                "mean_absolute_rad": f"{np.abs(every).mean():.4f}",
                "converged": str(found.converged),
                "cpu_s": f"{time.process_time() - started:.0f}",
            }
            | {name: f"{value:.5g}" for name, value in numbers.items()}
        )
        with table.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
        print(f"{held:22} {rows[-1]['rms_rad']} rad  converged {found.converged}", flush=True)
    rms, absolute = (
        np.array([float(row[column]) for row in rows if row["left_out"] != ALL])
        for column in ("rms_rad", "mean_absolute_rad")
    )
    print(
        f"left out one at a time: rms {np.sqrt((rms**2).mean()):.4f} rad, median of the logs {np.median(rms):.4f} rad; "
        f"mean absolute {absolute.mean():.4f} rad"
    )


if __name__ == "__main__":
    main()
