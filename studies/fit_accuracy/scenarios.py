"""What is hidden, how it is measured, and what is asked: one entry a row of the table."""

from __future__ import annotations

from dataclasses import dataclass

from studies.fit_accuracy.measurement import Experiments
from studies.fit_accuracy.plants import Hidden


@dataclass(frozen=True)
class Scenario:
    """A row: nothing of what is hidden is told to the fit."""

    title: str
    hidden: Hidden = Hidden()
    experiments: Experiments = Experiments()
    asked_own: float = float("nan")
    """Largest rms error on robid's own simulator, percent."""
    asked_foreign: float = float("nan")
    """Largest rms error over the bound on the foreign one."""


INERTIA = Hidden(inertia=0.01)
STRIBECK = Hidden(stribeck=True)
LATE = Hidden(late=0.3)
RIPPLES = Hidden(torque_ripple=0.005, resolver_ripple=2e-4)

SCENARIOS = {
    "worked_example": Scenario("as in the worked example", asked_own=0.05, asked_foreign=1.5),
    "inertia": Scenario("inertial numbers 1 % wrong (all 66)", INERTIA, asked_own=0.1, asked_foreign=1.7),
    "stribeck": Scenario("Stribeck friction of random shape", STRIBECK, asked_own=0.05, asked_foreign=1.5),
    "late": Scenario("torque lag of 0.3 samples", LATE, asked_own=0.05, asked_foreign=1.5),
    "all": Scenario(
        "all that, torque ripple 0.5 % of the limit, resolver ripple 2e-4 rad",
        INERTIA | STRIBECK | LATE | RIPPLES,
        asked_own=0.3,
        asked_foreign=3.0,
    ),
    "one_experiment": Scenario(
        "one experiment a pose, 8 poses",
        experiments=Experiments(poses=8, each=1),
        asked_own=0.1,
        asked_foreign=1.5,
    ),
    "unaligned": Scenario(
        "unaligned cuts of 8 s, start state unknown",
        experiments=Experiments(cut_s=8.0),
        asked_own=0.1,
        asked_foreign=1.5,
    ),
    "moves": Scenario(
        "moves of 0.3-0.6 rad with a multisine on top",
        experiments=Experiments(move_rad=(0.3, 0.6)),
        asked_own=0.5,
        asked_foreign=2.0,
    ),
}
