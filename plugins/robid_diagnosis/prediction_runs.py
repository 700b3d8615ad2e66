"""Training and held-out runs of the records that are predicted, their variants, and the error of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robid_core import FloatArray, Record, RunErrors
from robid_core.estimation.standstill import rests_of
from robid_core.residual import parts_by_variant
from robid_diagnosis.comparison import Signals
from robid_diagnosis.prediction_curves import PredictedRun

MANY = 0.1  # of the samples at rest


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a record of one role and one variant."""

    record: Record
    variant: str
    tested: bool
    """Whether it is judged: held out for that, or all that there is."""
    name: str


def pieces_of(
    records: Sequence[Record], whole: Callable[[Sequence[Record]], Sequence[Record]]
) -> tuple[list[Piece], bool]:
    """Return the parts of all records, and whether any experiment is of the role test.

    `whole` gives what of a record is without gaps, as records; a part that has some is several pieces of one name.
    """
    marked = any(run.test is not None and run.test.any() for one in records for run in one.runs)
    found = list[Piece]()
    for number, record in enumerate(records, start=1):
        head = f"record {number}, " if len(records) > 1 else ""
        for tested, part in _by_role(record) if marked else [(True, record)]:
            for variant, own in parts_by_variant(part):
                name = f"{head}{variant}, " if variant else head
                found += [Piece(one, variant, tested, name) for one in whole([own])]
    return found, marked


def _by_role(record: Record) -> Iterator[tuple[bool, Record]]:
    held = [run.test is not None and run.test.any() for run in record.runs]
    if not any(held):
        yield False, record
        return
    test = record.run.test
    assert test is not None
    if not test.all():
        yield False, record.part(~test)
    yield True, record.part(test)


def predicted_runs(
    pieces: Sequence[Piece], measured: Signals, predicted: Signals, skip_s: float
) -> list[PredictedRun]:
    """Every experiment with what was compared, the ends cut off, in the order of the pieces."""
    found, place, numbers = list[PredictedRun](), 0, Counter[tuple[str, bool]]()
    for piece in pieces:
        own = piece.name, piece.tested
        for run in piece.record.runs:
            cut, angles = round(skip_s / run.sample_time_s), run.lanes("motor_position")
            for angle, theirs, ours in zip(angles, measured[place], predicted[place], strict=True):
                numbers[own] += 1
                name = f"{piece.name}{'test' if piece.tested else 'training'} {numbers[own]}"
                kept = angle[cut : len(angle) - cut]
                found.append(PredictedRun(name, piece.tested, run.sample_time_s, kept, theirs, ours))
            place += 1
    return found


def run_errors(
    model: str, quantity: str, unit: str, axis_names: tuple[str, ...], runs: Sequence[PredictedRun]
) -> RunErrors:
    """How far a model is from each run, those that it was fitted to first."""
    ordered = sorted(runs, key=lambda run: run.tested)
    rms = np.stack([_rms(run.left) for run in ordered])
    size = np.stack([_rms(run.measured) for run in ordered])
    return RunErrors(
        model=model,
        quantity=quantity,
        unit_symbol=unit,
        axis_names=axis_names,
        runs=tuple(run.name for run in ordered),
        tested=np.array([run.tested for run in ordered]),
        rms=rms,
        relative=np.divide(rms, size, out=np.full_like(rms, np.nan), where=size > 0),
    )


def _rms(values: FloatArray) -> FloatArray:
    found: FloatArray = np.sqrt((values**2).mean(axis=0))
    return found


def rests_lines(runs: Sequence[PredictedRun], axis_names: Sequence[str], model: str) -> list[str]:
    """Say what a model leaves of the torque without the samples at which axes stand still, where these are many."""
    judged = [run for run in runs if run.tested]
    still = rests_of([run.position for run in judged], [run.sample_time_s for run in judged])
    shares = np.concatenate(still).mean(axis=0)
    if not (shares > MANY).any():
        return []
    moving = 1.0 - np.concatenate(still)
    left, whole = (np.concatenate([getattr(run, name) for run in judged]) for name in ("left", "measured"))
    size = np.maximum(_rms(moving * whole), np.finfo(np.float64).tiny)
    told = zip(axis_names, shares.tolist(), (_rms(moving * left) / size).tolist(), strict=True)
    each = ", ".join(f"{name} {100 * own:.3g} % ({100 * share:.0f} % at rest)" for name, share, own in told)
    return [
        "Friction holds an axis at rest by any torque up to its level, which no model predicts; without these samples "
        f"the {model} leaves {each}."
    ]
