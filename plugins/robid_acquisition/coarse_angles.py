"""Angles that were rounded when they were saved: steps far above what an encoder makes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid_core import FloatArray, Record, Robot

POSITION = "motor_position"
COARSE_RAD = 0.1  # of the motor; an encoder of 64 counts
LEVELS = 10  # steps, at least
WHOLE = 1e-3  # of a step, by which differences may miss whole numbers of it


def rounded_angles(record: Record, robot: Robot) -> Iterator[str]:
    """Say which angles come in steps that a sensor at the motor has not."""
    for a, step in coarse_steps(record, robot).items():
        name = robot.axis_names[a]
        ratio = abs(robot.description.axes[name].gear_ratio)
        yield (
            f"motor_position of {name} comes in steps of {step:.3g} rad at the motor, {np.degrees(step / ratio):.3g} "
            "degrees at the joint: was it rounded when it was saved? Export it with all digits; are it counts, write "
            "unit: counts, unit_to: rad, and in scale 2 pi over the counts of a turn; where the encoder is so coarse, "
            f"state it (sensors: {{encoder_counts: {2 * np.pi / step:.4g}}})"
        )


def coarse_steps(record: Record, robot: Robot) -> dict[int, float]:
    """Return the steps of angles that no sensor at the motor has, rad at the motor, by axis."""
    found = dict[int, float]()
    if any(POSITION not in run.channels for run in record.runs):
        return found
    kinds = {body.joint: body.type for body in robot.description.bodies}
    for a, (name, axis) in enumerate(robot.description.axes.items()):
        if kinds[axis.joint or name] != "revolute":
            continue
        lanes = [lane[:, a] for run in record.runs for lane in run.lanes(POSITION)]
        step = _step(lanes)
        counts = axis.sensors.encoder_counts
        if step <= COARSE_RAD or (counts and step < 3 * np.pi / counts):
            continue
        found[a] = step
    return found


def _step(lanes: list[FloatArray]) -> float:
    """Step of which all differences between samples are whole multiples; 0 where there is none."""
    steps = np.concatenate([np.abs(np.diff(lane[np.isfinite(lane)])) for lane in lanes])
    largest = steps.max(initial=0.0)
    steps = steps[steps > 1e-9 * largest]
    if len(steps) < LEVELS:
        return 0.0
    least = float(steps.min())
    small = steps[steps < 100 * least]  # of many steps rounding says nothing
    missed = np.abs(small / least - np.round(small / least))
    return least if len(small) >= LEVELS and missed.max() < WHOLE * 100 else 0.0
