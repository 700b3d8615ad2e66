"""Robots for checks against other machinery: drawn in general position, and small ones with closed forms.

Everything is written as a robot file would say it, so that what is checked is the whole way from file to
motion.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import numpy.typing as npt
from oracles.drives import Ripple

from robid_core import Robot
from robid_core.robot.file.description import RobotDescription

FloatArray = npt.NDArray[np.float64]

STANDARD_GRAVITY = 9.81
TORQUE_RIPPLE, RESOLVER_RIPPLE = "drive.torque_ripple", "sensing.resolver_ripple"  # names of the effects


def robot_of(**data: Any) -> Robot:
    """Make a robot of what its file would hold, checked as a file is."""
    text = json.dumps({"robid_robot": 1, **data}, default=lambda value: np.asarray(value).tolist())
    return Robot(RobotDescription.model_validate_json(text))


def changed(robot: Robot, **description: Any) -> Robot:
    """Return the robot with some keys of its file replaced; what is under `every_axis` goes into each
    axis."""
    data = robot.description.model_dump(mode="json")
    for key, value in description.items():
        if key == "every_axis":
            for axis in data["axes"].values():
                axis.update(value)
        else:
            data[key] = value
    return robot_of(**data)


def without_feedback(robot: Robot) -> Robot:
    """Return the robot with drives that only hold their torque."""
    return changed(robot, every_axis={"controller": {"speed_gain": 0.0}})


def with_exact_encoders(robot: Robot) -> Robot:
    """Return the robot with encoders that measure without steps and without noise."""
    return changed(robot, every_axis={"sensors": {}})


def with_ripple(robot: Robot, ripple: Ripple) -> Robot:
    """Return the robot with ripple of motor torque and resolver as effects."""
    effects: dict[str, Any] = {}
    for a, name in enumerate(robot.description.axes):
        for use, amplitude, order in (
            (TORQUE_RIPPLE, ripple.torque[a], ripple.torque_order[a]),
            (RESOLVER_RIPPLE, ripple.position[a], ripple.position_order[a]),
        ):
            label = f"{use.partition('.')[2]}_{name}"
            effects[label] = {"use": use, "on": name, "with": {"amplitude": amplitude, "order": order}}
    return changed(robot, effects=effects)


def drawn_robot(
    generator: np.random.Generator,
    n_axis: int,
    *,
    tree: bool = False,
    prismatic: bool = False,
    coupled: bool = False,
    n_bearing: int = 0,
) -> Robot:
    """Draw a robot with joints in general position: arbitrary axes, fixed rotations, centres and inertias.

    Parameters
    ----------
    n_axis
        Number of axes.
    tree
        Whether bodies branch.
    prismatic
        Whether about half of the joints slide.
    coupled
        Whether motors move more than one joint, as in wrists.
    n_bearing
        Elastic coordinates across the transmission, dealt to the axes in turn: the seventh of six axes is the
        second of axis 1.
    """
    names = [f"axis_{a + 1}" for a in range(n_axis)]
    bodies: list[dict[str, Any]] = []
    axes: dict[str, dict[str, Any]] = {}
    bearings: dict[str, dict[str, Any]] = {}
    for a, name in enumerate(names):
        parent = int(generator.integers(-1, a)) if tree and a else a - 1
        points = generator.normal(size=(6, 3)) * 0.2  # point masses: an inertia that some body has
        mass = generator.uniform(1.0, 6.0)
        slides = bool(prismatic and generator.random() < 0.5)
        bodies.append(
            {
                "joint": name,
                "parent": names[parent] if parent >= 0 else None,
                "type": "prismatic" if slides else "revolute",
                "axis": unit_vector(generator),
                "translation": generator.normal(size=3) * 0.3,
                "rotation": rotation(generator),
                "mass": mass,
                "centre_of_mass": generator.normal(size=3) * 0.2,
                "inertia": mass * (np.sum(points**2) * np.eye(3) - points.T @ points) / 6,
            }
        )
        axes[name] = {
            "gear_ratio": float(generator.uniform(30, 120) * generator.choice([-1, 1])),
            "rotor_inertia": float(generator.uniform(2e-4, 2e-3)),
            "torque_limit": 100.0,
            "speed_limit": 500.0,
            "gear": {"stiffness": generator.uniform(5e3, 5e4), "damping": generator.uniform(2, 20)},
            "friction": {"coulomb": 0.1, "viscous": 2e-3, "offset": generator.normal() * 0.05, "speed": 2.0},
            "controller": {"speed_gain": 0.05, "integral_gain": 0.4, "position_gain": 2.0},
        }
    for b in range(n_bearing):
        bearings[f"bearing_{b + 1}"] = {
            "joint": names[b % n_axis],
            "axis": unit_vector(generator),
            "stiffness": generator.uniform(1e4, 1e5),
            "damping": generator.uniform(2, 20),
        }
    coupling = None
    if coupled:
        own = np.array([1 / axes[name]["gear_ratio"] for name in names])
        coupling = np.diag(own) + 0.2 * abs(own).min() * generator.normal(size=(n_axis, n_axis))
    gravity = np.array([1.0, 2.0, -STANDARD_GRAVITY])
    return robot_of(
        name="drawn", gravity=gravity, bodies=bodies, axes=axes, bearings=bearings, coupling=coupling
    )


def with_rigid_gears(robot: Robot, *names: str) -> Robot:
    """Return the robot with rigid gears on the named axes."""
    axes = robot.description.model_dump(mode="json")["axes"]
    for name in names:
        axes[name]["gear"] = None
    return changed(robot, axes=axes)


def unit_vector(generator: np.random.Generator) -> FloatArray:
    """Draw a direction."""
    vector = generator.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def rotation(generator: np.random.Generator) -> FloatArray:
    """Draw a rotation matrix."""
    q, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    return np.asarray(q * np.sign(np.linalg.det(q)))


def drawn_state(generator: np.random.Generator, robot: Robot) -> tuple[FloatArray, FloatArray]:
    """Draw generalised coordinates with every spring bent by about 0.01 rad, and their rates."""
    n_axis = robot.n_axis
    motor = robot.motor_angle(generator.uniform(-1.5, 1.5, n_axis))
    rate = robot.motor_angle(generator.normal(size=n_axis))
    names = [axis.joint or name for name, axis in robot.description.axes.items()]
    gear = robot.drives.gear
    position, speed = [*motor], [*rate]
    for name in free_joints(robot):
        a = names.index(name) if name in names else None
        follows = 0.0 if a is None else float(gear[a] @ motor)
        moves = 0.0 if a is None else float(gear[a] @ rate)
        position.append(follows + 0.01 * generator.normal())
        speed.append(moves + 0.3 * generator.normal())
    return np.array(position), np.array(speed)


def free_joints(robot: Robot) -> list[str]:
    """Names of the joints that are coordinates of their own, all but rigidly geared ones, as in the chain."""
    rigid = {axis.joint or name for name, axis in robot.description.axes.items() if axis.gear is None}
    return [name for name in robot.chain.names if name not in rigid]


# Robots with closed forms ---------------------------------------------------------------------------------


def two_masses(rotor: float, load: float, ratio: float, stiffness: float, damping: float = 0.0) -> Robot:
    """Rotor and flywheel joined by a spring, nothing else: inertias in kg m^2, stiffness at the joint."""
    return robot_of(
        name="two_masses",
        gravity=[0, 0, 0],
        bodies=[{"joint": "axis_1", "mass": 5.0, "inertia": np.diag([load, load, load])}],
        axes={"axis_1": _bare_axis(rotor, ratio, {"stiffness": stiffness, "damping": damping})},
    )


def pendulum(mass: float, length: float, inertia: float, rotor: float, ratio: float) -> Robot:
    """Rigidly geared pendulum: centre of mass `length` below a horizontal axis, inertia about that centre."""
    return robot_of(
        name="pendulum",
        gravity=[0, 0, -STANDARD_GRAVITY],
        bodies=[
            {
                "joint": "axis_1",
                "axis": [0, 1, 0],
                "mass": mass,
                "centre_of_mass": [0, 0, -length],
                "inertia": np.diag([inertia, inertia, inertia]),
            }
        ],
        axes={"axis_1": _bare_axis(rotor, ratio, None)},
    )


def motor_on_a_wall(rotor: float, stiffness: float, coulomb: float, friction_speed: float) -> Robot:
    """Motor that twists a spring whose other end does not move (a load of 1e6 times its inertia), ratio 1."""
    robot = two_masses(rotor, 1e6 * rotor, 1.0, stiffness)
    return changed(robot, every_axis={"friction": {"coulomb": coulomb, "speed": friction_speed}})


def motor_alone(inertia: float, coulomb: float, friction_speed: float, speed_gain: float) -> Robot:
    """Rigid rotor with friction under a speed controller, a hundredth of the inertia on the motor's side."""
    robot = two_masses(0.01 * inertia, 0.99 * inertia, 1.0, 1.0)
    return changed(
        robot,
        every_axis={
            "gear": None,
            "friction": {"coulomb": coulomb, "speed": friction_speed},
            "controller": {"speed_gain": speed_gain},
        },
    )


def _bare_axis(rotor: float, ratio: float, gear: dict[str, float] | None) -> dict[str, Any]:
    return {
        "gear_ratio": ratio,
        "rotor_inertia": rotor,
        "torque_limit": 1e6,
        "speed_limit": 1e6,
        "gear": gear,
        "controller": {"speed_gain": 0.0},
    }
