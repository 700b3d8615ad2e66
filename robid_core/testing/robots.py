"""Robots of any number of axes for tests: the packaged ones, and a chain of equal links in between."""

from __future__ import annotations

from typing import Any

from robid_core.robot import Robot, RobotDescription

PACKAGED = {1: "one_axis", 6: "six_axis"}


def example_robot(n_axis: int) -> Robot:
    """Return a robot with `n_axis` motors: one_axis, six_axis, or a planar chain of links of 0.4 m and 10 kg."""
    if n_axis in PACKAGED:
        return Robot.load(PACKAGED[n_axis])
    names = [f"axis_{number}" for number in range(1, n_axis + 1)]
    bodies: list[dict[str, Any]] = [
        {
            "joint": name,
            "parent": names[index - 1] if index else None,
            "axis": (0.0, 1.0, 0.0),
            "translation": (0.0, 0.0, 0.4 if index else 0.0),
            "mass": 10.0,
            "centre_of_mass": (0.0, 0.0, 0.2),
            "inertia": ((0.15, 0.0, 0.0), (0.0, 0.15, 0.0), (0.0, 0.0, 0.02)),
        }
        for index, name in enumerate(names)
    ]
    axis: dict[str, Any] = {
        "position_limits": (-2.0, 2.0),
        "gear_ratio": 100.0,
        "rotor_inertia": 1e-3,
        "torque_limit": 30.0,
        "speed_limit": 400.0,
        "gear": {"stiffness": 6e4, "damping": 50.0},
        "friction": {"coulomb": 0.3, "viscous": 2e-3},
        "sensors": {"encoder_counts": 1048576.0, "position_noise": 2e-5, "torque_noise": 0.01},
        "controller": {"speed_gain": 0.08, "integral_gain": 0.64},
    }
    return Robot(
        RobotDescription.model_validate(
            {
                "robid_robot": 1,
                "name": f"chain_{n_axis}",
                "bodies": tuple(bodies),
                "axes": dict.fromkeys(names, axis),
            }
        )
    )
