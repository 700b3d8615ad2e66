"""Every built-in stage keeps the contract; a new one that is not tried here fails the first test.

Sizes 1 and 6 are tried by the plugins' own tests where their settings make that quick.
"""

from __future__ import annotations

from typing import Any

import pytest

from robid_core.registry import STAGES, registry
from robid_core.testing import check_stage

SETTINGS: dict[str, dict[str, Any]] = {
    "acquisition.drives": {"periods": 2, "settle_periods": 1},
    "compensate.friction": {},
    "compensate.ripple": {},
    "compensate.simulation": {},
    "design.candidates": {"count": 3},
    "design.optimal": {"candidates": 20, "experiments": 3},
    "diagnosis.closed_loop": {},
    "excitation.binary_sequence": {
        "band_hz": (6, 60),
        "register_bits": 10,
        "clock_hz": 250,
        "torque_share": 0.3,
    },
    "excitation.chirp": {"band_hz": (6, 60), "period_s": 4.0, "torque_share": 0.3},
    "excitation.constant_velocity": {},
    "excitation.filtered_noise": {"band_hz": (6, 60), "duration_s": 4.0, "torque_share": 0.3},
    "excitation.fourier": {"period_s": 4.0, "harmonics": 3, "draws": 2, "starts": 1, "evaluations": 12},
    "excitation.multisine": {"band_hz": (10, 80), "lines": 12, "period_s": 1.0, "slow_sine_rad_s": 9},
    "fit.log_response": {"starts": 1},
    "fit.rigid": {},
    "fit.torque_residual": {"passes": 2},
    "frf.ari": {},
    "frf.h1": {},
    "frf.harmonic": {},
    "frf.indirect": {},
    "frf.jio": {},
    "frf.log": {},
    "frf.lpm": {"window_lines": 1, "numerator_order": 0},
    "frf.lrm": {},
    "frf.spectral": {},
    "frf.two_stage": {},
    "report.html": {},
}
# One needs a recording, the other a plant with as many motors: tests/plugins/robid_acquisition.
ELSEWHERE = {"acquisition.recorded", "acquisition.simulated"}


def test_every_built_in_stage_is_tried() -> None:
    built_in = {plugin.name for plugin in registry().plugins(STAGES) if plugin.distribution == "robid"}
    assert built_in == set(SETTINGS) | ELSEWHERE


@pytest.mark.parametrize("name", sorted(SETTINGS))
def test_a_built_in_stage_keeps_the_contract(name: str) -> None:
    check_stage(registry().load(STAGES, name), for_axes=(2,), **SETTINGS[name])
