"""Every mutant that there is, by the room that it breaks: those named here, and those that tests of faults name."""

from __future__ import annotations

from faults.fault import faults_in
from mutants.mutant import ROOT, Mutant
from mutants.readers import OF_READERS
from mutants.rooms import OF_GATE, OF_LOCK, OF_STOP, OF_STORE
from mutants.stop_path import STOP_PATH

NAMED = {
    "gate": OF_GATE,
    "lock": OF_LOCK,
    "stop path": [*STOP_PATH, *OF_STOP],
    "store": OF_STORE,
    "readers": OF_READERS,
}


def every_mutant() -> dict[str, list[Mutant]]:
    """Return the mutants by room, those of the tested faults last."""
    of_faults = [one.mutant for one in faults_in(ROOT / "tests", ROOT) if one.mutant is not None]
    return {**NAMED, "tested faults": of_faults}
