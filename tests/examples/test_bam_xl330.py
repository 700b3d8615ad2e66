"""Servo and pendulum of examples/bam_xl330: fitted to seven logs, the angle of the eighth is predicted."""

from __future__ import annotations

import json
import logging
import os
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from robid_core import Channel, Context, DenseRun, FloatArray, Record, Robot, simulate_record
from robid_core.stage import map_in_process
from robid_fit.time_domain import TimeDomainFit

PROJECT = Path(__file__).parents[2]
EXAMPLE = PROJECT / "examples" / "bam_xl330"
LOGS = Path(os.environ.get("ROBID_DATA", PROJECT.parent / "shared" / "data")) / "bam_xl330"
HELD_OUT = "sin_time_square_kp100"
T = 2e-3

pytestmark = pytest.mark.skipif(
    not (LOGS / f"{HELD_OUT}.json").is_file(),
    reason=f"{LOGS} has no logs; get them from github.com/Rhoban/bam and set ROBID_DATA",
)


def record_of(path: Path) -> Record:
    """One log on an even clock: angles between samples, what was asked for held until it is told anew."""
    log = json.loads(path.read_text(encoding="utf-8"))
    columns = {name: np.array([float(one[name]) for one in log["entries"]]) for name in log["entries"][0]}
    time = columns["timestamp"] - columns["timestamp"][0]
    even = T * np.arange(round(5.98 / T))
    last = np.searchsorted(time, even + 1e-9, side="right") - 1

    def channel(unit: str, values: FloatArray) -> Channel:
        return Channel("motor", unit, values.reshape(1, 1, 1, 1, -1, 1))

    channels = {
        "motor_position": channel("rad", np.interp(even, time, columns["position"])),
        "position_reference": channel("rad", columns["goal_position"][last]),
        "drive_enabled": channel("1", columns["torque_enable"][last]),
    }
    run = DenseRun(T, channels, even, np.ones((1, 1, 1, 1, len(even)), dtype=bool))
    return Record(
        ("shoulder",), path.name, "continuous", (run,), np.zeros((1, 1)), variants=(path.stem.split("_")[-1],)
    )


def test_a_log_that_the_fit_did_not_see_is_predicted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLE)
    stages = YAML(typ="safe", pure=True).load(EXAMPLE / "pipeline.yaml")["stages"]
    settings = stages["fit"]["with"] | {"iterations": 6}  # a shorter fit
    fit = TimeDomainFit.model_validate_json(json.dumps(settings), strict=True)
    robot, held_out = Robot.load("robot.yaml", EXAMPLE), record_of(LOGS / f"{HELD_OUT}.json")
    others = tuple(record_of(path) for path in sorted(LOGS.glob("*.json")) if path.stem != HELD_OUT)
    assert len(others) == 7
    context = Context(
        np.random.default_rng(1), map_in_process, lambda *a, **k: None, logging.getLogger("test")
    )
    found = fit.run(others, robot, context)

    def error(one: Robot) -> float:
        left = simulate_record(one, held_out).run.values("motor_position") - held_out.run.values(
            "motor_position"
        )
        return float(np.sqrt((left**2).mean()))

    # 0.025 rad (of the whole fit), 0.074 with friction that knows no load (README.md): half of that.
    assert error(robot.with_parameters(found.parameters.as_mapping())) < 0.037
    table = found.parameters
    square = table.names.index("effect.gear.load_square")
    assert table.estimate[square] > 5 * table.standard_error[square]
