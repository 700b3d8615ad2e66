"""A model as a robot file that people can read: the base by name, and below it what the fit found.

robid_robot: 1
base: six_axis
base_sha256: 5f0c...                        # of the base that the numbers were found with
parameters:
  gear_stiffness.axis_1: 61234.5            # N m/rad, standard error 120, before 80000
"""

from __future__ import annotations

import json
import re

from robid_core.artifacts import Model, is_determined
from robid_core.robot.file.changes import described
from robid_core.robot.file.named_parameters import layout_of

_PLAIN = re.compile(
    r"(\.{0,2}/)*[A-Za-z_][A-Za-z0-9_./-]*"
)  # a text that YAML takes for itself without quotes
_WORDS = ("null", "true", "false")
COLUMN = 60  # of the comments, at least


def derived_yaml(model: Model, base: str, heading: str) -> str:
    """Return the text of a robot file that says only how a model differs from its base.

    Parameters
    ----------
    model
        The model.
    base
        What `base:` says: a packaged robot, or a path relative to where the file will stand.
    heading
        Where the numbers come from, one line or more.
    """
    lines = [f"# {line}" for line in heading.splitlines()]
    if model.left_out:
        lines.append(f"# Estimated, and no number of a robot file: {', '.join(model.left_out)}.")
    lines += ["robid_robot: 1", f"base: {key_text(base)}", f"base_sha256: {model.base_sha256}"]
    effects = json.loads(model.effects)
    if effects:
        lines.append("effects:")
        lines += [f"  {key_text(label)}: {json.dumps(entry)}" for label, entry in effects.items()]
    if model.names:
        lines.append("parameters:")
        known = known_of(model)
        for name, value in zip(model.names, model.value.tolist(), strict=True):
            lines.append(f"{f'  {key_text(name)}: {value!r}':{COLUMN}}  # {known[name]}")
    return "\n".join(lines) + "\n"


def known_of(model: Model) -> dict[str, str]:
    """Return what is known of each number of a model in words: unit, standard error, what it was before."""
    errors, found, layout = model.standard_errors(), {}, layout_of(described(model))
    for name, before, value in zip(model.names, model.start.tolist(), model.value.tolist(), strict=True):
        told = [layout[name].unit]
        if name in errors:
            error = errors[name]
            told.append(f"standard error {error:.3g}" if error == error else "standard error unknown")
            told += [] if is_determined(error, value) else ["not determined"]
        elif before != value:
            told.append("no standard error")
        told.append(f"before {before:.6g}" if before != value else "as before")
        found[name] = ", ".join(told)
    return found


def key_text(text: str) -> str:
    """Return a text as YAML takes it: as it is, or in quotes where it could mean something else."""
    return text if _PLAIN.fullmatch(text) and text.lower() not in _WORDS else json.dumps(text)
