"""Doubt of a prediction that goes beyond the motion that a fit was made from."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid_core import Doubt, ExcitedRange, FloatArray

FAR = 0.1  # of the range that was excited: less is no extrapolation worth telling
MOST = 6  # axes in a sentence


def extrapolation_doubt(trained: ExcitedRange, asked: ExcitedRange) -> Iterator[Doubt]:
    """Doubt, with axis and how far, what lies beyond the excited range by more than a tenth of it."""
    told = list[str]()
    for noun, before, here in (
        ("speed", trained.speed, asked.speed),
        ("acceleration", trained.acceleration, asked.acceleration),
        ("torque", trained.torque, asked.torque),
    ):
        ratio = here / np.where(before > 0, before, np.nan)
        told += [
            f"{axis} {noun} {ratio[a]:.2g} times"
            for a, axis in enumerate(trained.axis_names)
            if ratio[a] > 1 + FAR
        ]
    width = trained.highest_position - trained.lowest_position
    beyond: FloatArray = np.maximum(
        asked.highest_position - trained.highest_position, trained.lowest_position - asked.lowest_position
    ) / np.where(width > 0, width, np.nan)
    told += [
        f"{axis} position by {beyond[a]:.2g} of its range"
        for a, axis in enumerate(trained.axis_names)
        if beyond[a] > FAR
    ]
    if told:
        more = f" and {len(told) - MOST} more" if len(told) > MOST else ""
        yield Doubt(
            "extrapolation",
            f"the prediction extrapolates beyond the data of the fit: {', '.join(told[:MOST])}{more}",
            "errors there test the form of the model, not how well its parameters are known; fit to motions "
            "that reach as far, or predict what lies within",
        )
