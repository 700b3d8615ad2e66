"""How a robot is excited, and what is known of the motion once everything that is told was fitted to it."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np

from robid_core import Robot
from robid_core.residual import place_in
from robid_diagnosis.candidates import LABEL, Candidate
from robid_diagnosis.columns import Motion
from robid_diagnosis.fitted_projection import projection_of
from robid_diagnosis.hypothesis import Case, Hypothesis
from robid_diagnosis.projection import Projection
from robid_diagnosis.search import Search
from studies.fit_accuracy.comparison import told_robots
from studies.fit_accuracy.experiments import Experiments
from studies.fit_accuracy.measurement import measured
from studies.fit_accuracy.plants import Hidden, drawn
from studies.fit_accuracy.simulators import Own

SHORT = Experiments(period_s=4.0)
EXCITATIONS = {
    "multisine": SHORT,
    "half": replace(SHORT, amplitude=0.5),
    "fifth": replace(SHORT, amplitude=0.2),
    "slow_sweep": replace(SHORT, signal="slow_sweep"),
    "fast_sweep": replace(SHORT, signal="fast_sweep"),
    "moves": replace(SHORT, move_rad=(0.3, 0.6)),
    "payload": replace(SHORT, payload_kg=8.0),
}
"""By name; `half` and `fifth` of the multisine's amplitude; `payload` of 8 kg in half of the poses, which is told."""
NOISES = ("sensing.white_noise", "sensing.coloured_noise")
"""Effects that no residual tells: what they do is drawn anew each time."""
HIGHEST_HZ, PASSES, MODEL_ERROR = 100.0, 5, 5e-4
# As `diagnosis.effects` had them when the tables were made, but for fewer passes: it grants 2e-4 since.


@dataclass(frozen=True, eq=False)
class Seen:
    """One excitation of a robot that has nothing hidden."""

    motion: Motion
    projection: Projection
    search: Search
    minutes: float
    """Of motion that is measured."""

    def at_place(self, candidate: Candidate) -> Candidate:
        """Return a candidate of another excitation, with the same values, in this robot."""
        if candidate.place is None:
            return candidate
        place = place_in(self.motion.robot, LABEL, candidate.spot.on, candidate.spot.side)
        return replace(candidate, place=place)


def seen(robot: str, excitation: str, seed: int) -> Seen:
    """Measure a robot as it is told, with the noise of its file, and fit it."""
    experiments = EXCITATIONS[excitation]
    plant = drawn((seed,), Hidden(), robot, as_told=True)
    record = measured(plant, experiments, seed, Own())
    with ExitStack() as stack:
        files = stack.enter_context(told_robots(plant, experiments.payload_kg))
        robots = {variant: Robot.load(path) for variant, path in files.items()}
        case = Case((record,), plant.nominal, {}, HIGHEST_HZ, 0, PASSES, MODEL_ERROR, robots=robots)
        fitted = case.fit(Hypothesis(), lambda *_: None, roughly=True)
    projection, _ = projection_of(fitted)
    motion = Motion(fitted.problem, fitted.point, fitted.about.weights)
    run = record.run
    minutes = run.valid[..., 0].size * len(run.time_s) * run.sample_time_s / 60
    return Seen(motion, projection, Search(motion, projection, np.random.default_rng(seed)), minutes)
