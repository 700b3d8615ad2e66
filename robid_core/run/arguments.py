"""What the artifacts of other stages become as arguments of `run`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robid_core.artifacts import Artifact
from robid_core.stage import Stage

Argument = Artifact | tuple[Artifact, ...]


def arguments_of(stage: Stage, artifacts: Mapping[str, Sequence[Artifact]]) -> dict[str, Argument]:
    """Return a tuple for each input that takes many and the one artifact for any other.

    `artifacts` holds what was made for each parameter of `run`; an optional one may be absent.
    """
    many = {entry.name for entry in stage.inputs() if entry.many}
    return {
        parameter: tuple(found) if parameter in many else found[0] for parameter, found in artifacts.items()
    }
