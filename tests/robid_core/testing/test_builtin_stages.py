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
    "design.candidates": {"count": 3},
    "design.optimal": {"candidates": 20, "experiments": 3},
    "diagnosis.closed_loop": {},
    "excitation.multisine": {"band_hz": (10, 80), "lines": 12, "period_s": 1.0, "slow_sine_rad_s": 9},
    "fit.log_response": {"starts": 1},
    "fit.rigid": {},
    "frf.h1": {},
    "frf.log": {},
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
