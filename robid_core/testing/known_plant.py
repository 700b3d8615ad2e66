"""Runs of a stage on data of a plant that is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from robid_core.artifacts import Artifact
from robid_core.errors import RobidError
from robid_core.robot import Robot
from robid_core.run.arguments import arguments_of
from robid_core.stage import Context, Stage
from robid_core.testing.broken import ContractBroken
from robid_core.testing.lending import example_context

Made = TypeVar("Made", bound=Artifact)


def made_of(stage: Stage, robot: Robot, needed: Mapping[str, Sequence[Artifact]], kind: type[Made]) -> Made:
    """Run a stage with the robot that it is told on data by input; ContractBroken where it refuses them."""
    arguments: dict[str, Any] = {**arguments_of(stage, needed, example_context().log)}
    for name, lent in stage.lends().items():
        arguments[name] = example_context() if lent is Context else robot
    try:
        found = stage.run(**arguments)
    except RobidError as error:
        raise ContractBroken(
            f"{type(stage).__name__}: it refuses the measurement of a known plant ({error}); give `artifacts` that it "
            "can use, or leave known plants out by `recovery=False`"
        ) from error
    if not isinstance(found, kind):
        raise ContractBroken(
            f"{type(stage).__name__}: run gives a {type(found).__name__}, not a {kind.__name__}"
        )
    return found
