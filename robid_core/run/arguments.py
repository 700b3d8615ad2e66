"""What the artifacts of other stages become as arguments of `run`.

Of a record a stage sees what it says it can use: no fit and no estimator gets the experiments that are held out for
tests, and only a stage that handles variants gets several of them.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence

from robid_core.artifacts import Artifact, Record
from robid_core.errors import DataRejected
from robid_core.stage import Stage

Argument = Artifact | tuple[Artifact, ...]


def arguments_of(
    stage: Stage, artifacts: Mapping[str, Sequence[Artifact]], log: logging.Logger
) -> dict[str, Argument]:
    """Return a tuple for each input that takes many and the one artifact for any other, as the stage may see them.

    Parameters
    ----------
    stage
        The stage that is going to run.
    artifacts
        What was made for each parameter of `run`; an optional one may be absent.
    log
        Takes note of what is left out.

    Raises
    ------
    DataRejected
        If a record holds several variants and the stage does not handle them.
    """
    many = {entry.name for entry in stage.inputs() if entry.many}
    arguments: dict[str, Argument] = {}
    for parameter, found in artifacts.items():
        seen = tuple(_seen_by(stage, one, log) if isinstance(one, Record) else one for one in found)
        arguments[parameter] = seen if parameter in many else seen[0]
    return arguments


def _seen_by(stage: Stage, record: Record, log: logging.Logger) -> Record:
    """Return what a stage may see of a record."""
    names = tuple(dict.fromkeys(record.variants))
    if len(names) > 1 and not stage.handles_variants:
        raise DataRejected(
            f"the record holds several variants ({', '.join(names)}), which {type(stage).__name__} does not "
            f"handle; import each by a stage of its own (acquisition.recorded, `variant: {names[0]}`) and name the one "
            "to use under `inputs:`"
        )
    if stage.sees_test:
        return record
    training = record.training()
    if training is not record:
        n_all, n_left = (one.run.valid[..., 0, 0].size for one in (record, training))
        log.info("%d of %d experiments are held out for tests and left out", n_all - n_left, n_all)
    return training
