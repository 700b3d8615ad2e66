"""Every built-in stage keeps the contract; a new one that is tried neither here nor by its own test fails the first."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robid_core.registry import STAGES, registry
from robid_core.testing import check_stage

SETTINGS: dict[str, dict[str, Any]] = {
    "acquisition.drives": {"periods": 2, "settle_periods": 1},
    "design.optimal": {"candidates": 20, "experiments": 3},
    "excitation.binary_sequence": {
        "band_hz": (6, 60),
        "register_bits": 10,
        "clock_hz": 250,
        "torque_share": 0.3,
    },
    "excitation.chirp": {"band_hz": (6, 60), "period_s": 4.0, "torque_share": 0.3},
    "excitation.constant_velocity": {},
    "excitation.filtered_noise": {"band_hz": (6, 60), "duration_s": 4.0, "torque_share": 0.3},
    "excitation.multisine": {"band_hz": (10, 80), "lines": 12, "period_s": 1.0, "slow_sine_rad_s": 9},
    "fit.log_response": {"starts": 1},
    "fit.time_domain": {
        "free": ("friction.*.viscous",),
        "iterations": 1,
        "recovery": False,
    },  # under way at its start
    "fit.state_space": {"iterations": 1, "recovery": False},  # an iteration of six axes takes long
    "fit.torque_residual": {"passes": 4},
}
# Tried with these settings and more sizes by the tests of the plugin, or only there, with a recording or a plant.
PLUGINS = Path(__file__).parents[2] / "plugins"
ELSEWHERE = {
    "acquisition.recorded": "robid_acquisition/test_recorded.py",
    "acquisition.simulated": "robid_acquisition/test_acquisition_in_batches.py",
    "compensate.friction": "robid_compensation/test_friction_compensation.py",
    "compensate.ripple": "robid_compensation/test_ripple_compensation.py",
    "compensate.simulation": "robid_compensation/test_simulation_compensation.py",
    "design.candidates": "robid_design/test_candidates.py",
    "design.separating": "robid_diagnosis/test_next_experiment.py",
    "diagnosis.closed_loop": "robid_diagnosis/test_closed_loop.py",
    "diagnosis.cross_validation": "robid_diagnosis/test_cross_validation.py",
    "diagnosis.deflection": "robid_diagnosis/test_deflection.py",
    "diagnosis.effects": "robid_diagnosis/test_effects.py",
    "diagnosis.prediction": "robid_diagnosis/test_prediction.py",
    "excitation.fourier": "robid_excitation/test_fourier_stage.py",
    "excitation.separating": "robid_diagnosis/test_next_experiment.py",
    "frf.ari": "robid_frf/test_closed_loop_estimators.py",
    "frf.h1": "robid_frf/test_averaging_estimators.py",
    "frf.harmonic": "robid_frf/test_closed_loop_estimators.py",
    "frf.indirect": "robid_frf/test_closed_loop_estimators.py",
    "frf.jio": "robid_frf/test_closed_loop_estimators.py",
    "frf.log": "robid_frf/test_averaging_estimators.py",
    "frf.lpm": "robid_frf/test_local_methods.py",
    "frf.lrm": "robid_frf/test_local_methods.py",
    "frf.spectral": "robid_frf/test_spectral.py",
    "frf.two_stage": "robid_frf/test_closed_loop_estimators.py",
    "fit.friction": "robid_fit/test_friction.py",
    "fit.presliding": "robid_fit/test_presliding.py",
    "fit.rigid": "robid_fit/test_rigid.py",
    "report.comparison": "robid_report/test_comparison_page.py",
    "report.html": "robid_report/test_html_report.py",
}


def test_every_built_in_stage_is_tried() -> None:
    built_in = {plugin.name for plugin in registry().plugins(STAGES) if plugin.distribution == "robid"}
    assert built_in == set(SETTINGS) | set(ELSEWHERE)
    for name, file in ELSEWHERE.items():
        text = (PLUGINS / file).read_text(encoding="utf-8")
        assert "check_stage(" in text
        assert registry().load(STAGES, name).__name__ in text, f"{file} tries {name} no more"


@pytest.mark.parametrize("name", sorted(SETTINGS))
def test_a_built_in_stage_keeps_the_contract(name: str) -> None:
    check_stage(registry().load(STAGES, name), for_axes=(2,), **SETTINGS[name])
