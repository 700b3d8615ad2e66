"""Ripple of torques in a rigid fit: waves that are written out here are found beside bodies, friction and timing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.rigid_arm import ARM, STEP, loaded, record_of, recording

from robid_core import Fit, Robot
from robid_fit.rigid import RigidBodyFit
from robid_fit.rigid_ripple import amplitude_and_phase, polar

SETTINGS = RigidBodyFit(
    unknowns=("inertia", "rotor_inertia", "viscous", "coulomb", "offset", "effects"),
    cutoff_hz=100.0,
    decimation=4,
    drop_first=200,
    drop_last=200,
)
WAVES = {"j1": (4.0, 0.15, 0.7), "j2": (3.0, 0.2, -2.0)}  # order, amplitude in N m, phase


def told(folder: Path, amplitude: float = 0.01) -> Robot:
    effects = {
        f"cog_{axis}": {
            "use": "drive.torque_ripple",
            "on": axis,
            "with": {"order": order, "amplitude": amplitude},
        }
        for axis, (order, _, _) in WAVES.items()
    }
    return loaded(folder, {**ARM, "name": "told", "effects": effects})


def waved(folder: Path, seed: int) -> Any:
    """The recorded torque lacks what the ripple adds of itself."""
    truth = loaded(folder, ARM)
    record = recording(truth, seed, seconds=12.0, noise=0.05)
    position, torque = (record.run.values(f"motor_{n}")[0, 0, 0, 0].copy() for n in ("position", "torque"))
    for axis, (order, amplitude, phase) in WAVES.items():
        k = int(axis[1]) - 1
        torque[:, k] -= amplitude * np.sin(order * position[:, k] + phase)
    return record_of(truth, position, torque)


def row(fit: Fit, name: str) -> tuple[float, float]:
    table = fit.parameters
    i = table.names.index(name)
    return float(table.estimate[i]), float(table.standard_error[i])


def test_waves_are_found_with_size_and_phase_and_go_into_the_model(tmp_path: Path) -> None:
    off = []
    for seed in (1, 2, 3):
        fit = SETTINGS.run((waved(tmp_path, seed),), told(tmp_path))
        assert fit.converged
        for axis, (_, amplitude, phase) in WAVES.items():
            size, error = row(fit, f"effect.cog_{axis}.amplitude")
            turn, spread = row(fit, f"effect.cog_{axis}.phase")
            assert error < 0.05 * amplitude
            off += [(size - amplitude) / error, (turn - phase) / spread]
    # Twelve numbers; central differences and the sinc of a sample cost less than a tenth of an error each.
    assert np.mean(np.square(off)) < 2.5
    assert fit.model is not None
    model = Robot.of_model(fit.model)
    assert model.parameter("effect.cog_j2.amplitude") == pytest.approx(0.2, rel=0.05)
    assert model.parameter("effect.cog_j2.order") == 3.0


def test_a_wave_that_is_not_told_is_left_and_a_held_one_counts(tmp_path: Path) -> None:
    record = waved(tmp_path, 1)
    free = SETTINGS.run((record,), told(tmp_path))
    bare = SETTINGS.run((record,), loaded(tmp_path, ARM))
    right = told(tmp_path).with_parameters(
        {f"effect.cog_{axis}.{name}": value for axis, (_, a, p) in WAVES.items()
         for name, value in (("amplitude", a), ("phase", p))}
    )  # fmt: skip
    held = SETTINGS.model_copy(
        update={"unknowns": ("inertia", "rotor_inertia", "viscous", "coulomb", "offset")}
    )
    assert bare.time[0].relative_error > 2 * free.time[0].relative_error
    known = held.run((record,), right)
    assert known.time[0].relative_error == pytest.approx(free.time[0].relative_error, rel=0.02)
    assert not any("cog" in name for name in known.parameters.names)


@pytest.mark.parametrize("parts", [(0.3, -0.2), (-0.1, 1e-3)])
def test_the_derivative_of_size_and_phase_is_that_of_differences(parts: tuple[float, float]) -> None:
    point, step = np.array(parts), 1e-6
    values, slopes = amplitude_and_phase(point)
    assert polar(*values.tolist()) == pytest.approx(parts)
    for i in range(2):
        moved = point + step * np.eye(2)[i]
        difference = (amplitude_and_phase(moved)[0] - values) / step
        np.testing.assert_allclose(slopes[:, i], difference, rtol=1e-4, atol=1e-5)


def test_a_fast_turn_weakens_a_wave_by_the_mean_over_a_sample(tmp_path: Path) -> None:
    """Mean of the cosine over a sample against a sum of a thousand parts of it."""
    from robid_fit.rigid_ripple import ripples

    (wave, _) = ripples(told(tmp_path))
    speed, angle = 400.0, 0.3
    column = wave.torque(np.full((1, 3), angle), np.full((1, 3), speed), STEP)[0, 0]
    times = (np.arange(1000) - 499.5) / 1000 * STEP
    swept = wave.order * (angle + speed * times)
    np.testing.assert_allclose(column, [-np.cos(swept).mean(), -np.sin(swept).mean()], rtol=1e-5)
