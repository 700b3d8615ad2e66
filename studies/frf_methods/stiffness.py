"""What the responses are for: the twelve stiffnesses, from all eight poses of a plant, by each method.

Beside the errors stand the Cramer-Rao bounds, with distortion taken for Gaussian noise and with noise alone, and the
floor that the linear model itself has: the error of a fit to responses from so many experiments that their scatter
hardly counts.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from robid_core import Frf, Record, Robot, load_plugin
from studies.frf_methods.accuracy import ratio, root_mean
from studies.frf_methods.measurement import BLOCKS, chance, first_experiments, measure, quiet, references
from studies.frf_methods.methods import FRICTION, METHODS, Method

from reference import metrics  # isort: skip
from reference.answer import SHIPPED_LABEL, answer  # isort: skip
from reference.bounds import parameter_bound  # isort: skip
from reference.excitation_class import shipped_class  # isort: skip
from reference.plants import ReferencePlant, reference_plant, without_effects, without_sensor_errors  # isort: skip
from robid_core import FloatArray

VARIANTS: tuple[tuple[str, int], ...] = (
    ("log", 24),
    ("friction_log", 24),
    ("lrm_mimo_chosen", 24),
    ("log", 6),
    ("lrm_mimo_chosen", 6),
    ("friction_lrm", 6),
    ("mechanics_lrm", 6),
    ("lrm_mimo_chosen", 1),
    ("friction_lrm", 1),
    ("mechanics_lrm", 1),
)
SEED = 100_001  # beside the seeds of the other parts
FLOOR_BLOCKS = 16
FLOOR = Method("model error", "frf.jio", before=FRICTION)
STARTS = 3  # the nominal robot and two others: enough where the response is good, and told where it is not


def joined(frfs: Sequence[Frf]) -> Frf:
    """One artifact of the configurations of several."""
    fields = {}
    for item in dataclasses.fields(frfs[0]):
        if item.metadata.get("axes", ("",))[0] == "n_config":
            values = [getattr(frf, item.name) for frf in frfs]
            fields[item.name] = None if any(v is None for v in values) else np.concatenate(values)
    return frfs[0].replace(**fields)


def fitted(frfs: Sequence[Frf], nominal: Robot) -> FloatArray:
    """Stiffnesses of the fit, in the order of `nominal.stiffness_names`."""
    stage = load_plugin("robid.stages", "fit.log_response")(starts=STARTS)
    fit = stage.run(joined(frfs), nominal, quiet())
    return np.array([fit.parameters.value(name) for name in nominal.stiffness_names])


def plant_errors(number: int) -> dict[str, FloatArray]:
    """Relative errors of the stiffnesses of one plant by each variant, the floor, and relative bounds."""
    plant = reference_plant(number)
    excitation, nominal = shipped_class(plant), plant.nominal
    found: dict[tuple[str, int], list[Frf]] = {variant: [] for variant in VARIANTS}
    floor = []
    for pose, angle in enumerate(plant.pose, start=1):
        generator = chance(number, pose, SEED)
        reference = references(excitation, BLOCKS, generator)
        record = measure(plant.robot, angle, excitation, reference, int(generator.integers(2**62)))
        for variant, frf in estimates(record, nominal).items():
            found[variant].append(frf)
        many = references(excitation, FLOOR_BLOCKS, generator)
        silent = measure(without_sensor_errors(plant.robot), angle, excitation, many, None, n_period=1)
        prepared = FLOOR.prepare(silent, nominal, quiet())
        floor.append(FLOOR.estimate(prepared, nominal, quiet()))
    truth = np.array([plant.robot.parameters()[name] for name in nominal.stiffness_names])
    errors = {f"{key}|{count}": fitted(frfs, nominal) / truth - 1 for (key, count), frfs in found.items()}
    errors["floor"] = fitted(floor, nominal) / truth - 1
    return errors


def kept(number: int, folder: Path) -> dict[str, FloatArray]:
    """`plant_errors`, computed once and kept."""
    path = folder / f"plant_{number:02d}.npz"
    if not path.exists():
        partial = path.with_suffix(".partial")
        with partial.open("wb") as file:
            np.savez(file, **plant_errors(number))
        partial.replace(path)
    with np.load(path) as stored:
        return {name: stored[name] for name in stored.files}


def estimates(record: Record, nominal: Robot) -> dict[tuple[str, int], Frf]:
    """Response of every variant in one pose."""
    result = {}
    known: dict[int, dict[tuple[str, ...], Record]] = {}
    for key, count in VARIANTS:
        method, part = METHODS[key], first_experiments(record, count)
        prepared = method.prepare(part, nominal, quiet(), known.setdefault(count, {}))
        result[key, count] = method.estimate(prepared, nominal, quiet())
    return result


def bounds(number: int, folder: Path, blocks: int = 16) -> dict[str, FloatArray]:
    """Smallest relative standard errors from 24 experiments a pose: distortion as noise, and noise alone."""
    plant: ReferencePlant = reference_plant(number)
    excitation = shipped_class(plant)
    known = [
        answer(plant, pose, excitation, folder / SHIPPED_LABEL, precision=1.0, most=blocks)
        for pose in range(1, len(plant.pose) + 1)
    ]
    result = {}
    for name, distortion in (("bound", True), ("bound_noise", False)):
        bound = parameter_bound(
            without_effects(plant.robot),
            plant.pose,
            known[0].frequency_hz,
            np.stack([BLOCKS * one.moments.input_gram for one in known]),
            np.stack([one.residual(distortion=distortion) for one in known]),
            np.stack([one.motor_damping for one in known]),
        )
        result[name] = bound.standard_error(*plant.nominal.stiffness_names)
    return result


def table(
    errors: Sequence[dict[str, FloatArray]],
    bounds: Sequence[dict[str, FloatArray]],
    generator: np.random.Generator,
) -> list[dict[str, str | float]]:
    """Root mean square relative errors over plants and stiffnesses, with bootstrap intervals over plants."""
    judge = np.array([np.mean(one["log|24"] ** 2) for one in errors])
    rows: list[dict[str, str | float]] = []
    for name in errors[0]:
        squares = np.array([np.mean(one[name] ** 2) for one in errors])
        low, high = metrics.bootstrap_interval(squares, root_mean, generator)
        pairs = np.stack([squares, judge], axis=1)
        ratio_low, ratio_high = metrics.bootstrap_interval(pairs, ratio, generator)
        key, _, count = name.partition("|")
        row: dict[str, str | float] = {
            "method": METHODS[key].title if key in METHODS else "floor: model error of the linear model",
            "experiments": int(count) if count else 6 * FLOOR_BLOCKS,
            "rms_error": root_mean(squares),
            "low": low,
            "high": high,
            "median_error": float(np.median(np.abs(np.concatenate([one[name] for one in errors])))),
            "worst_error": float(max(np.abs(one[name]).max() for one in errors)),
            "ratio_to_log_24": ratio(pairs),
            "ratio_low": ratio_low,
            "ratio_high": ratio_high,
        }
        rows.append(row)
    for count in (24, 6, 1):
        for key, words in (
            ("bound", "bound, distortion taken for noise"),
            ("bound_noise", "bound, noise alone"),
        ):
            squares = np.array([np.mean(one[key] ** 2) for one in bounds]) * 24 / count
            rows.append({"method": words, "experiments": count, "rms_error": root_mean(squares)})
    return rows
