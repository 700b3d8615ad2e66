"""A payload that nobody stated, on the wrist of a SCARA: the last body is wrong, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

import robid_core as robid
from robid_core import Robot

KG = 1.5


def test_a_payload_on_the_wrist_is_a_wrong_body_and_no_torque_constant() -> None:
    """Passes ended before bodies had moved: a torque constant 20 % off was named beside another body."""
    told = Robot.load("scara")
    loaded = told.with_effect("gripped", "load.payload", "axis_4", values={"mass": KG})
    poses = robid.use("design.candidates", count=4)(told, seed=1)
    motion = {
        "band_hz": (3.0, 60.0),
        "lines": 40,
        "period_s": 2.0,
        "blocks": 1,
        "slow_sine_rad_s": 8.0,
        "torque_share": 0.2,
    }
    excitation = robid.use("excitation.multisine", **motion)(poses, told, seed=1)
    record = robid.use("acquisition.simulated")(poses, excitation, loaded, seed=1)
    only = ["drive.torque_constant", "sensing.gain_error"]
    found = robid.use("diagnosis.effects", only=only, response_check=[], separate=False)(record, robot=told)
    (finding,) = found.findings
    assert (finding.kind, finding.effect, finding.on) == ("value", "body", "axis_4")
    mass = finding.names.index("mass.axis_4")
    error = finding.standard_error[mass]
    assert finding.value[mass] == pytest.approx(2.7 + KG, abs=4 * np.hypot(error, 0.02 * KG))
