"""A robot as a fit found it: a base robot, the effects that act in it besides, and numbers with their covariance."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.errors import DataRejected


@dataclass(frozen=True, eq=False)
class Model(Artifact):
    """What `Robot.of_model` makes a robot of, wherever the base robot's file has gone; `Robot.model` gives one.

    `base` is the name of the base robot, `base_text` all of it as `Robot.to_yaml` writes it and `base_sha256` the hash
    of that text: a base of another hash is another robot. `effects` is JSON: by label an entry of a robot file's
    `effects` that the base lacks, or null for one of the base's that is taken off. `names` are the numbers that are
    set, `start` what they were in the robot that the fit began with, `value` what they are; `free_names` those that
    were estimated, `covariance` theirs in their own units (NaN where it is not known). `left_out` names what was
    estimated and no number of a robot file can hold.

    A stage whose model has an effect that the robot it took lacks names that plugin in `uses()`: then whatever takes
    this robot is made again when the effect's code changes.
    """

    base: str
    base_sha256: str
    base_text: str
    effects: str
    names: tuple[str, ...]
    start: FloatArray = array("n_parameter")
    value: FloatArray = array("n_parameter")
    covariance: FloatArray = array("n_free n_free", finite=False, covariance=True)
    free_names: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that names, numbers and the base belong together."""
        super().__post_init__()
        if len(self.names) != len(self.value) or len(self.free_names) != len(self.covariance):
            raise DataRejected(
                f"Model: {len(self.names)} names have {len(self.value)} values, {len(self.free_names)} free ones a "
                f"covariance of {len(self.covariance)} rows"
            )
        unset = [name for name in self.free_names if name not in self.names]
        if unset:
            raise DataRejected(
                f"Model: {', '.join(unset)} was estimated and has no value; set every free parameter"
            )
        if not _is_mapping(self.effects):
            raise DataRejected(
                "Model: effects is no JSON mapping of labels to entries of a robot file, or null"
            )
        if hashlib.sha256(self.base_text.encode("utf-8")).hexdigest() != self.base_sha256:
            raise DataRejected(
                f"Model: the text of its base {self.base} is not the one that base_sha256 belongs to"
            )

    def standard_errors(self) -> dict[str, float]:
        """Return the standard errors of the free parameters by name, in their own units.

        >>> import numpy as np, robid_core as robid
        >>> name = "gear_stiffness.axis_1"
        >>> robid.Robot.load("one_axis").model({name: 9e4}, [name], np.array([[250000.0]])).standard_errors()
        {'gear_stiffness.axis_1': 500.0}
        """
        return dict(zip(self.free_names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))


def _is_mapping(text: str) -> bool:
    """Tell whether a text is a JSON object of objects and nulls."""
    try:
        found = json.loads(text)
    except ValueError:
        return False
    return isinstance(found, dict) and all(
        entry is None or isinstance(entry, dict) for entry in found.values()
    )
