"""What a user gets of a diagnosis: tool position and tracking under computed torque, before and after.

A plant hides one effect, and is diagnosed from a record of four poses, three or four multisines in each. Then it makes
moves that no fit has seen, with the torque that each model asks for fed forward beside its own controller: the robot as
it was told, with its values refitted, extended by what was found; and the plant itself, which is the floor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from robid_core import FloatArray, Record, Robot
from robid_diagnosis.candidates import catalogue
from robid_diagnosis.comparison import EXTENDED, REFITTED, TOLD
from robid_diagnosis.hypothesis import Case
from robid_diagnosis.results import model_of
from robid_diagnosis.selection import Outcome, Selection
from studies.fit_accuracy.measurement import measured
from studies.fit_accuracy.plants import Hidden, Plant, drawn
from studies.fit_accuracy.simulators import Own
from studies.fit_accuracy.tables import Row
from studies.hidden_effects.excitations import HIGHEST_HZ, MODEL_ERROR, NOISES, SHORT
from studies.hidden_effects.following import Move, computed_torque, followed, tool_along

TWO_AXES = str(Path(__file__).parent / "two_axes.yaml")
EACH = {1: 3, 2: 4, 6: 3}  # experiments a pose, by the number of axes
TOLD_WRONG = Hidden(inertia=0.01)  # beside springs, dampers and friction
PASSES, MOST = 12, 5  # as diagnosis.effects has them
NO_MODEL, PLANT = "none", "plant"
MODELS = (TOLD, REFITTED, EXTENDED, PLANT)
MILLI = 1e3


@dataclass(frozen=True)
class Secret:
    """What a plant has that nobody told."""

    robot: str
    """Name or path of what is told."""
    use: str
    on: str
    values: Mapping[str, float] = field(default_factory=dict)

    def put_into(self, plant: Plant) -> Plant:
        """Return the plant with it; an elastic coordinate is one that the told robot lacks."""
        if self.use != "structure.elastic_coordinate":
            robot = plant.robot.with_effect("hidden", self.use, self.on, values=self.values)
            return replace(plant, robot=robot)
        description = plant.nominal.description
        bearings = {name: one for name, one in description.bearings.items() if name != self.on}
        return replace(plant, nominal=Robot(description.model_copy(update={"bearings": bearings})))


SECRETS = {
    "one load": Secret("one_axis", "friction.load_dependent", "axis_1",
        values={"coulomb": 0.0, "load_coulomb": 0.05, "load_excess": 0.0}),
    "one stribeck": Secret("one_axis", "friction.stribeck", "axis_1",
        values={"coulomb": 0.0, "breakaway": 0.3, "stribeck_speed": 5.0, "exponent": 1.0, "viscous": 0.0}),
    "one backlash": Secret("one_axis", "transmission.backlash", "axis_1", values={"gap": 3e-4}),
    "one stiffening": Secret("one_axis", "transmission.stiffening", "axis_1", values={"cubic": 1e8}),
    "one hard stiffening": Secret("one_axis", "transmission.stiffening", "axis_1", values={"cubic": 2e9}),
    "one ripple": Secret("one_axis", "drive.torque_ripple", "axis_1", values={"amplitude": 0.1, "order": 6.0}),
    "one gear error": Secret("one_axis", "transmission.kinematic_error", "axis_1",
        values={"amplitude": 5e-5, "order": 2.0}),
    "two load": Secret(TWO_AXES, "friction.load_dependent", "shoulder",
        values={"coulomb": 0.0, "load_coulomb": 0.05, "load_excess": 0.0}),
    "two backlash": Secret(TWO_AXES, "transmission.backlash", "elbow", values={"gap": 3e-4}),
    "six foundation": Secret("six_axis", "structure.foundation", "base",
        values={"stiffness_x": 6e6, "stiffness_y": 8e6, "damping_x": 3e3, "damping_y": 4e3, "mass": 250.0}),
    "six bearing": Secret("six_axis", "structure.elastic_coordinate", "axis_2_z"),
}  # fmt: skip
"""By the number of axes and what is hidden."""
TOOLS = {1: (0.0, 0.0, 1.0), 2: (0.0, 0.0, 0.6), 6: (0.25, 0.03, 0.06)}
"""By the number of axes: where the tool is in the last body's frame, m."""
MOVES = {
    1: {"fast": Move((-0.6,), (0.6,), 2.0), "slow": Move((0.2,), (0.5,), 4.0)},
    2: {"fast": Move((-0.5, 0.3), (0.7, 1.2), 2.0), "slow": Move((0.1, 0.6), (0.4, 0.9), 4.0)},
    6: {
        "fast": Move((-0.4, 0.2, -0.1, -0.3, 0.6, -0.5), (0.4, 0.8, -0.6, 0.5, 0.1, 0.5), 2.0),
        "slow": Move((0.2, 0.4, -0.2, 0.1, 0.5, 0.0), (0.4, 0.6, -0.4, 0.4, 0.2, 0.3), 4.0),
    },
}
"""By the number of axes: up to 130 to 180 rad/s at the motors, and up to 25."""


def hidden_plant(secret: Secret, seed: int) -> Plant:
    """Draw what is told wrong, and hide the effect."""
    return secret.put_into(drawn((seed,), TOLD_WRONG, secret.robot))


def recorded(plant: Plant, seed: int) -> Record:
    """Measure what is diagnosed."""
    return measured(plant, replace(SHORT, each=EACH[plant.robot.n_axis]), seed, Own())


def diagnosed(
    record: Record, told: Robot, seed: int, uses: Sequence[str]
) -> tuple[dict[str, Robot], Outcome]:
    """Return a robot as told, refitted and extended by what is found among effects, and all that was found."""
    case = Case((record,), told, {}, HIGHEST_HZ, 0, PASSES, MODEL_ERROR)
    generator = np.random.default_rng(seed)
    outcome = Selection(case, uses, {}, generator, lambda *_: None, MOST).run()
    robots = {TOLD: told}
    for name, fitted in ((REFITTED, outcome.base), (EXTENDED, outcome.written)):
        robots[name] = Robot.of_model(model_of(told, fitted))
    return robots, outcome


def errors(
    plant: Robot, models: Mapping[str, Robot], move: Move, seed: int
) -> Iterator[tuple[str, dict[str, float]]]:
    """Each model with what it gives on a plant, the plant's own controller alone first.

    rms and largest values of: motor, angles less the wanted ones, joint side, mrad, all axes together; path, distance
    of the tool from where it is when motors move as wanted, mm; tool, distance from where the model says that it is
    while motors move as measured under the controller alone, mm.
    """
    wanted, point = move.motor_angle(plant), TOOLS[plant.n_axis]
    ideal = tool_along(plant, wanted, point)
    alone = followed(plant, wanted, None, point, seed)
    for name in (NO_MODEL, *models):
        own, found = alone, {}
        if name != NO_MODEL:
            own = followed(plant, wanted, computed_torque(models[name], wanted), point, seed)
            found = _sizes("tool", "mm", tool_along(models[name], alone.measured, point) - alone.tool)
        motor = plant.joint_angle(own.motor - wanted)
        yield name, _sizes("motor", "mrad", motor) | _sizes("path", "mm", own.tool - ideal) | found


def rows(seed: int, told: Sequence[str]) -> Iterator[Row]:
    """Rows of each plant of `told`, one for each move and model."""
    uses = catalogue(NOISES)
    for name in told:
        plant = hidden_plant(SECRETS[name], seed)
        robots, outcome = diagnosed(recorded(plant, seed), plant.nominal, seed, uses)
        common = {"hidden": name, "seed": str(seed)}
        found = {
            "found": " ".join(f"{step.use}@{step.on}" for step in outcome.steps),
            "misfit_refitted": f"{outcome.base.misfit:.3g}",
            "misfit_extended": f"{outcome.final.misfit:.3g}",
        }
        for move, motion in MOVES[plant.robot.n_axis].items():
            for model, sizes in errors(plant.robot, robots | {PLANT: plant.robot}, motion, seed):
                numbers = {key: f"{value:.4g}" for key, value in sizes.items()}
                yield common | {"move": move, "model": model} | numbers | found


def report(told: Sequence[Row]) -> list[str]:
    """One line a plant and move: rms errors of each model, and what the extended robot gains on the others.

    Of several seeds the median.
    """
    lines = []
    for column, what in (
        ("motor_rms_mrad", "motors off the wanted motion, mrad rms"),
        ("tool_rms_mm", "tool off where the model says, mm rms"),
    ):
        found: dict[tuple[str, str], dict[str, list[float]]] = {}
        for row in told:
            if row[column]:
                own = found.setdefault((row["hidden"], row["move"]), {})
                own.setdefault(row["model"], []).append(float(row[column]))
        head = "".join(f"{name:>10}" for name in ("none", "told", "refitted", "extended", "plant"))
        lines += ["", f"{what:40}{head}{'told':>10}{'refitted':>10} / extended"]
        for (hidden, move), by_model in found.items():
            error = {name: float(np.median(values)) for name, values in by_model.items()}
            values = "".join(f"{error.get(name, np.nan):10.3g}" for name in (NO_MODEL, *MODELS))
            gains = "".join(f"{error[name] / error[EXTENDED]:10.3g}" for name in (TOLD, REFITTED))
            lines.append(f"{f'{hidden}, {move}':40}{values}{gains}")
    return lines[1:]


def _sizes(what: str, unit: str, error: FloatArray) -> dict[str, float]:
    """Rms and largest length of an error over time, (n_sample, n), in thousandths."""
    length = MILLI * np.linalg.norm(error, axis=1)
    return {
        f"{what}_rms_{unit}": float(np.sqrt(np.mean(length**2))),
        f"{what}_max_{unit}": float(length.max()),
    }
