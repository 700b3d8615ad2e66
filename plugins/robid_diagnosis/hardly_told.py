"""Numbers of causes that the data hardly tell, though a fit states small errors: each effect knows its own."""

from __future__ import annotations

import numpy as np

from robid_core import ForceEffect
from robid_diagnosis.columns import Motion
from robid_diagnosis.hypothesis import Addition
from robid_diagnosis.wording import place_text


def hardly_told_lines(motion: Motion, additions: tuple[Addition, ...]) -> list[str]:
    """Return a sentence for each of the effects that were found whose numbers the motion hardly tells."""
    labels, lines = [one.label for one in additions], list[str]()
    for bound in motion.robot.effects:
        if bound.label not in labels or not issubclass(bound.effect, ForceEffect):
            continue
        positions = list[np.ndarray]()
        for one in motion.along:
            lanes, used = one.seen(bound.place.direction)[0], one.block.used
            positions += list(lanes if used is None else lanes[used.ravel()])
        said = bound.effect.hardly_told(bound.parameters, bound.place, positions)
        if said:
            found = additions[labels.index(bound.label)]
            lines.append(f"{place_text(found.use, found.on, found.side)}: {said}.")
    return lines
