"""A plant's record fitted, and the fit compared with the truth and with the bound."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from robid_core import Fit, FloatArray, Record, Robot, load_plugin
from studies.fit_accuracy.bound import bound
from studies.fit_accuracy.experiments import STAGES, context
from studies.fit_accuracy.measurement import VARIANTS
from studies.fit_accuracy.plants import Plant
from studies.fit_accuracy.scenarios import TORQUE_RESIDUAL


def fitted(chain: Sequence[str], record: Record, nominal: Robot, seed: int, **settings: Any) -> Fit:
    """Run stages from a record to a fit, those before the last with their default settings."""
    made: Any = record
    for name in chain:
        stage = load_plugin(STAGES, name)(**(settings if name == chain[-1] else {}))
        made = stage.run((made,) if stage.inputs()[0].many else made, nominal, context(seed))
    assert isinstance(made, Fit)
    return made


def compared(
    plant: Plant,
    record: Record,
    torque_noise: FloatArray,
    seed: int,
    chain: Sequence[str] = TORQUE_RESIDUAL,
    payload_kg: float = 0.0,
    **settings: Any,
) -> dict[str, str]:
    """Part of a row: seconds, misfit, and errors, stated errors and bounds of the springs, all relative.

    Parameters
    ----------
    plant
        Its nominal robot is told.
    record
        What was measured.
    torque_noise
        Standard deviation, N m, shape (n_axis,); told, since what does not repeat cannot show it.
    seed
        Of the fit.
    chain
        Stages from the record to the fit. The bound is always that of the torque residual.
    payload_kg
        Of the record's second variant.
    **settings
        Of the last stage.
    """
    names = list(plant.nominal.stiffness_names)
    told = {
        f"sensors.{axis}.torque_noise": n
        for axis, n in zip(plant.nominal.axis_names, torque_noise, strict=True)
    }
    nominal = plant.nominal.with_parameters(told)
    with told_robots(plant, payload_kg) as robots:
        if robots:
            settings["robots"] = robots
        started = time.perf_counter()
        fit = fitted(chain, record, nominal, seed, **settings)
        seconds = time.perf_counter() - started
        same = settings if chain == TORQUE_RESIDUAL else {}
        problem = load_plugin(STAGES, TORQUE_RESIDUAL[0])(**same).problem((record,), nominal)
    index = [fit.parameters.names.index(name) for name in names]
    estimate = fit.parameters.estimate[index]
    row = {"fit_s": f"{seconds:.0f}", "converged": str(fit.converged), "misfit": f"{fit.misfit:.4f}"}
    compared_numbers = {
        "error": estimate / plant.true_stiffness - 1,
        "stated": fit.parameters.standard_error[index] / estimate,
        "bound": bound(problem, plant.robot, torque_noise, names),
    }
    for what, values in compared_numbers.items():
        row |= {f"{what}.{name}": f"{value:.4e}" for name, value in zip(names, values, strict=True)}
    return row


@contextmanager
def told_robots(plant: Plant, payload_kg: float) -> Iterator[dict[str, str]]:
    """Write the file of the robot with the payload; give its path by variant, nothing where there is no payload."""
    if not payload_kg:
        yield {}
        return
    robot = plant.loaded(payload_kg).nominal
    lines = ["robid_robot: 1", f"name: {VARIANTS[1]}", f"base: {robot.name}", "effects:"]
    for label, entry in robot.description.effects.items():
        told = ", ".join(f"{key}: {value!r}" for key, value in entry.with_.items())
        lines.append(f"  {label}: {{use: {entry.use}, on: {entry.on}, with: {{{told}}}}}")
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{VARIANTS[1]}.yaml"
        path.write_text("\n".join([*lines, ""]), encoding="utf-8")
        yield {VARIANTS[1]: str(path)}
