"""The plants of the reference bench: robots of which everything that a user does not know is drawn, one seed a plant.

About a packaged robot: stiffness +-30 % (log-uniform), damping, friction and its zero-speed shape, torque ripple and
resolver ripple (orders, amplitudes, phases); and what a user does know but no claim may hang on: gains of the drives,
noise of the sensors, poses. Each group has a stream of its own, so that a new one leaves the others as they are.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from robid_core import Robot
from robid_core.robot.file.description import RobotDescription
from robid_core.testing import example_robot

FloatArray = npt.NDArray[np.float64]

SEED = 20_261_121
N_PLANT, N_POSE = 50, 8
BASES = {"one_axis": 1, "three_axis": 3, "six_axis": 6}

# Factors on the nominal value, and amplitudes: log-uniform between the two.
STIFFNESS = (0.7, 1.3)
DAMPING = (0.6, 1.6)
FRICTION = (0.6, 1.6)
FRICTION_SPEED = (0.7, 1.4)
SPEED_GAIN = (0.7, 1.4)
INTEGRAL_TIME_S = (0.08, 0.2)  # integral gain = speed gain / integral time
NOISE = (0.5, 2.0)
ENCODER_COUNTS = (2**19, 2**20, 2**21)  # per motor turn
OFFSET_RIPPLE = (0.002, 0.01)  # share of the torque limit: offset of the current measurement
CURRENT_RIPPLE = (0.005, 0.02)  # share of the torque: harmonics of flux and current
RESOLVER_RIPPLE_ARC_MINUTES = (0.5, 4.0)  # of the electrical turn
POLE_PAIRS = (3, 4, 5)
POSE_MARGIN = 0.08  # of each joint's range, left free at either end for the motion about the pose
GRAVITY_SHARE = 0.5  # largest share of a torque limit that holding the arm may take
ARC_MINUTE = np.pi / 180 / 60


@dataclass(frozen=True, eq=False)
class ReferencePlant:
    """One drawn machine, what its user believes, and where it is measured."""

    index: int
    robot: Robot
    """The machine: what simulates."""
    nominal: Robot
    """What its user has: values of the packaged robot, but the machine's own controllers and sensors; no ripple."""
    pose: FloatArray
    """Configurations, joint side, rad, shape (N_POSE, n_axis)."""

    @property
    def stiffness(self) -> FloatArray:
        """True stiffness, N m/rad, in the order of `robot.stiffness_names`, shape (n_spring,)."""
        return self.robot.spring_arrays()[0]

    def write(self, folder: Path) -> Path:
        """Write the machine as <name>.yaml, for `plant:` of simulated drives; return its path."""
        path = folder / f"{self.robot.name}.yaml"
        path.write_text(self.robot.to_yaml(), encoding="utf-8")
        return path


def reference_plant(index: int, base: str = "six_axis") -> ReferencePlant:
    """Return plant `index` (1, 2, ...) about a base robot: one_axis, three_axis or six_axis."""
    groups = ("stiffness", "damping", "friction", "ripple", "controller", "sensors", "pose")
    # One child seed a plant, of it one a group: Generator streams are independent by construction.
    children = np.random.SeedSequence(SEED, spawn_key=(BASES[base], index)).spawn(len(groups))
    chance = {group: np.random.default_rng(child) for group, child in zip(groups, children, strict=True)}
    believed = example_robot(BASES[base])
    known = _known_to_the_user(believed, chance["controller"], chance["sensors"])
    data = known.description.model_dump(mode="json")
    data["name"] = f"{base}_{index:02d}"
    for axis in data["axes"].values():
        axis["friction"]["speed"] *= log_uniform(FRICTION_SPEED, chance["friction"])
    data["effects"] = drawn_ripple(known, chance["ripple"])
    machine = _robot_of(data)
    spread = {"stiffness": STIFFNESS, "damping": DAMPING, "friction": FRICTION}
    machine = machine.with_parameters(
        {
            name: value * log_uniform(spread[group], chance[group])
            for name, value in known.parameters().items()
            if (group := known.parameter_kind(name)) in spread
        }
    )
    return ReferencePlant(index, machine, known, drawn_poses(known, N_POSE, chance["pose"]))


def log_uniform(bounds: tuple[float, float], generator: np.random.Generator) -> float:
    """Draw a number whose logarithm is uniform between two bounds."""
    return float(np.exp(generator.uniform(*np.log(bounds))))


def drawn_ripple(robot: Robot, generator: np.random.Generator) -> dict[str, Any]:
    """Entries of a robot file: on each axis two orders of torque ripple and one of the resolver.

    A motor of p pole pairs has ripple of order p from an offset of its current measurement (constant amplitude), and
    of order 6 p from harmonics of flux and current (in proportion to the torque). A resolver of one or p pole pairs
    errs at once (offsets) or twice (unequal windings) its electrical turn; amplitudes there are of the electrical
    angle, at the motor 1 / pole pairs of it.
    """
    effects: dict[str, Any] = {}
    for name, limit in zip(robot.axis_names, robot.drives.torque_limit, strict=True):
        pairs = int(generator.choice(POLE_PAIRS))
        resolver_pairs = int(generator.choice([1, pairs]))
        order = resolver_pairs * int(generator.choice([1, 2]))
        offset = float(limit) * log_uniform(OFFSET_RIPPLE, generator)
        share = log_uniform(CURRENT_RIPPLE, generator)
        angle = ARC_MINUTE * log_uniform(RESOLVER_RIPPLE_ARC_MINUTES, generator) / resolver_pairs
        for label, use, values in (
            (f"offset_ripple_{name}", "drive.torque_ripple", {"amplitude": offset, "order": pairs}),
            (
                f"current_ripple_{name}",
                "drive.torque_ripple",
                {"amplitude": 0.0, "relative": share, "order": 6 * pairs},
            ),
            (f"resolver_ripple_{name}", "sensing.resolver_ripple", {"amplitude": angle, "order": order}),
        ):
            phase = float(generator.uniform(-np.pi, np.pi))
            effects[label] = {"use": use, "on": name, "with": {**values, "phase": phase}}
    return effects


def drawn_poses(robot: Robot, count: int, generator: np.random.Generator) -> FloatArray:
    """Draw configurations uniformly within the limits, gravity not too heavy for a motor, shape (count, n_axis)."""
    lower, upper = robot.drives.lower, robot.drives.upper
    room = POSE_MARGIN * (upper - lower)
    found: list[FloatArray] = []
    while len(found) < count:
        angle = generator.uniform(lower + room, upper - room)
        if np.all(np.abs(robot.gravity_torque(angle[None])[0]) <= GRAVITY_SHARE * robot.drives.torque_limit):
            found.append(angle)
    return np.array(found)


def without_sensor_errors(robot: Robot) -> Robot:
    """Return the robot with angles and torques that are measured without noise and steps (ripple stays)."""
    data = robot.description.model_dump(mode="json")
    for axis in data["axes"].values():
        axis["sensors"] = {}
    return _robot_of(data)


def without_effects(robot: Robot) -> Robot:
    """Return the robot without ripple: what its linear model is about."""
    return robot.without_effect(*robot.description.effects)


def _known_to_the_user(robot: Robot, gains: np.random.Generator, sensors: np.random.Generator) -> Robot:
    data = robot.description.model_dump(mode="json")
    for axis in data["axes"].values():
        gain = axis["controller"]["speed_gain"] * log_uniform(SPEED_GAIN, gains)
        axis["controller"] |= {
            "speed_gain": gain,
            "integral_gain": gain / log_uniform(INTEGRAL_TIME_S, gains),
        }
        axis["sensors"] = {
            "encoder_counts": float(sensors.choice(ENCODER_COUNTS)),
            "position_noise": axis["sensors"]["position_noise"] * log_uniform(NOISE, sensors),
            "torque_noise": axis["sensors"]["torque_noise"] * log_uniform(NOISE, sensors),
        }
    return _robot_of(data)


def _robot_of(data: dict[str, Any]) -> Robot:
    return Robot(RobotDescription.model_validate_json(json.dumps(data)))
