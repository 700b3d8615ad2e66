"""Real recordings of one joint at one speed each: what constant speed tells, and that no ripple is made up."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from oracles.friction_bench import context, machine, record_of

from robid_compensation.ripple import RippleCompensation
from robid_core import Record
from robid_fit.friction import FrictionFromPlateaus

DATA = Path(os.environ.get("ROBID_DATA", Path(__file__).parents[3] / "shared" / "data")) / "kinova_gen3"
GEAR = 50.0  # of the bench's arm: the recordings are of the joint

pytestmark = pytest.mark.skipif(
    not (DATA / "joint_4_trapez.csv").is_file(),
    reason=f"{DATA} is absent; get it from github wissem01chiha/dynamic-identification and set ROBID_DATA",
)


def recorded(joint: int) -> Record:
    path = DATA / f"joint_{joint}_trapez.csv"
    names = path.read_text(encoding="utf-8").partition("\n")[0].strip().split(",")
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    angle, torque = (table[:, [names.index(f"{kind}{joint}")]] for kind in ("Position", "Torque"))
    return record_of(machine(), [(GEAR * angle, torque / GEAR)]).replace(torque_hold="continuous")


@pytest.mark.parametrize(("joint", "least_s"), [(2, 1.0), (4, 4.0)])
def test_a_trapezoid_has_its_speed_as_a_plateau(joint: int, least_s: float) -> None:
    (table,) = FrictionFromPlateaus().plateaus(recorded(joint), machine())
    longest = int(np.argmax(table.duration_s))
    assert table.duration_s[longest] > least_s
    # Both were commanded at 0.418 rad/s (24 degrees a second).
    assert table.speed[longest] / GEAR == pytest.approx(np.radians(24.0), rel=0.01)


def test_no_ripple_is_made_up() -> None:
    record = recorded(4)
    stage = RippleCompensation(max_order=20.0, kinds=("cogging",))
    assert stage.run(record, machine(), context()) is record
