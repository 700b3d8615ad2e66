"""What is hidden, how it is measured and fitted, and what is asked: one entry a row of the table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from studies.fit_accuracy.experiments import Experiments
from studies.fit_accuracy.plants import Hidden

TORQUE_RESIDUAL = ("fit.torque_residual",)
RESPONSES = ("frf.lrm", "fit.log_response")
UR5 = Path(__file__).with_name("ur5")


@dataclass(frozen=True)
class Scenario:
    """A row: nothing of what is hidden is told to the fit."""

    title: str
    hidden: Hidden = Hidden()
    experiments: Experiments = Experiments()
    chain: tuple[str, ...] = TORQUE_RESIDUAL
    """Stages from the record to the fit, with their default settings."""
    told: str = "six_axis"
    """The nominal robot."""
    as_told: bool = False
    """Springs, dampers and friction are the nominal ones."""
    simulators: tuple[str, ...] = ("own", "foreign")
    asked_own: float | None = None
    """Largest rms error on robid's own simulator, percent."""
    asked_foreign: float | None = None
    """Largest rms error on the foreign one, percent."""
    asked_over_bound: float | None = None
    """Largest rms error over the bound on the foreign one."""


INERTIA = Hidden(inertia=0.01)
STRIBECK = Hidden(stribeck=True)
LATE = Hidden(late=0.3)
RIPPLES = Hidden(torque_ripple=0.005, resolver_ripple=2e-4)

# A plant's seed has the number of its scenario: new ones go last.
SCENARIOS = {
    "worked_example": Scenario("as in the worked example", asked_own=0.05, asked_over_bound=1.5),
    "inertia": Scenario("inertial numbers 1 % wrong (all 66)", INERTIA, asked_own=0.1, asked_over_bound=1.7),
    "stribeck": Scenario("Stribeck friction of random shape", STRIBECK, asked_own=0.05, asked_over_bound=1.5),
    "late": Scenario("torque lag of 0.3 samples", LATE, asked_own=0.05, asked_over_bound=1.5),
    "all": Scenario(
        "all that, torque ripple 0.5 % of the limit, resolver ripple 2e-4 rad",
        INERTIA | STRIBECK | LATE | RIPPLES,
        asked_own=0.3,
        asked_over_bound=3.0,
    ),
    "one_experiment": Scenario(
        "one experiment a pose, 8 poses",
        experiments=Experiments(poses=8, each=1),
        asked_own=0.1,
        asked_over_bound=1.5,
    ),
    "unaligned": Scenario(
        "unaligned cuts of 8 s, start state unknown",
        experiments=Experiments(cut_s=8.0),
        asked_own=0.1,
        asked_over_bound=1.5,
    ),
    "moves": Scenario(
        "moves of 0.3-0.6 rad with a multisine on top",
        experiments=Experiments(move_rad=(0.3, 0.6)),
        asked_own=0.5,
        asked_over_bound=2.0,
    ),
    "two_payloads": Scenario(
        "two poses bare and two with 8 kg at the tool, shared parameters",
        experiments=Experiments(payload_kg=8.0),
        asked_own=0.05,
        asked_over_bound=1.5,
    ),
    "log_response": Scenario(
        "from responses, 4 poses x 12 experiments",
        experiments=Experiments(each=12),
        chain=RESPONSES,
        asked_own=0.3,
        asked_foreign=0.6,
    ),
    "light_robot": Scenario(
        "UR5's public numbers and a tool of 2 kg, plant as told",
        told=str(UR5 / "with_tool.yaml"),
        as_told=True,
        simulators=("own",),
        asked_own=0.1,
    ),
    "light_robot_bare": Scenario(
        "the same without a tool: the last spring cannot be seen",
        told=str(UR5 / "robot.yaml"),
        as_told=True,
        simulators=("own",),
    ),
}
