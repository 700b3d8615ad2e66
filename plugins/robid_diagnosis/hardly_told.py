"""Numbers of causes that the data do not determine, though a fit states small errors: each effect knows its own."""

from __future__ import annotations

import numpy as np

from robid_core import ForceEffect
from robid_diagnosis.columns import Motion
from robid_diagnosis.hypothesis import Addition
from robid_diagnosis.wording import place_text


def hardly_told(motion: Motion, additions: tuple[Addition, ...]) -> dict[str, str]:
    """Return the numbers of the effects that were found which the motion does not determine, each with a sentence."""
    found = {one.label: one for one in additions}
    told = dict[str, str]()
    for bound in motion.robot.effects:
        if bound.label not in found or not issubclass(bound.effect, ForceEffect):
            continue
        positions = list[np.ndarray]()
        for one in motion.along:
            lanes, used = one.seen(bound.place.direction)[0], one.block.used
            positions += list(lanes if used is None else lanes[used.ravel()])
        own = found[bound.label]
        where = place_text(own.use, own.on, own.side)
        for name, said in bound.effect.hardly_told(bound.parameters, bound.place, positions).items():
            told[f"effect.{bound.label}.{name}"] = f"{where}: {said}."
    return told
