"""The robot as capsules or meshes that the page's script turns, and how they move in the elastic modes.

A capsule stands for what is between two joints; its thickness is that of an aluminium rod of the bodies' mass. A short
fin on each driven body shows turns about its own axis. A link with meshes (`link_meshes`) is drawn with those instead.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robid_core import FloatArray, LinkMesh, Robot
from robid_core.plot import compact
from robid_report.meshes import UNITS, DrawnMeshes, drawn_meshes
from robid_report.mode_shapes import ElasticMode, elastic_modes, energy_in_words
from robid_report.numbers import significant
from robid_report.stick_figure import Skeleton, frames, is_worth_drawing, tips

DENSITY = 2700.0  # kg/m^3, aluminium
THICKNESS = (0.018, 0.07)  # of the robot's size: no thinner and no thicker is drawn
FIN = 0.09  # of the robot's size
SWING = 0.1  # of the robot's size: largest motion of a point in a mode
STEP = 1e-6  # of the central difference, in units of the scaled shape
MOST_MODES = 6


def body_data(
    robot: Robot,
    angle: FloatArray,
    highest_hz: float,
    meshes: tuple[list[LinkMesh], list[str]] = ([], []),
) -> tuple[dict[str, Any], DrawnMeshes] | None:
    """Return points, capsules, meshes and modes of each configuration as plain values, and the meshes that are drawn.

    None where there is nothing to draw.

    Parameters
    ----------
    robot
        The fitted robot where there is one.
    angle
        Joint-side motor angles, shape (n_config, n_axis).
    highest_hz
        Modes above are left out.
    meshes
        Those of the robot, and a sentence for each that could not be read, as `link_meshes` gives them.
    """
    chain, mechanism = robot.chain, robot.mechanism
    joint = np.zeros((len(angle), chain.n_coordinate))
    joint[:, mechanism.arm] = angle
    parent = [*(int(p) for p in chain.parent), *tips(chain)]
    points = _points(robot, joint, 0.0)
    size = float(np.ptp(np.concatenate([points.reshape(-1, 3), np.zeros((1, 3))]), axis=0).max())
    if not is_worth_drawing(Skeleton(points, tuple(parent))):
        return None
    radius = _radii(robot, points[0], parent, size)
    modes = elastic_modes(robot, angle, highest_hz, MOST_MODES)
    shapes = drawn_meshes(robot, *meshes, size)
    radius[np.isin(parent, shapes.joint)] = 0.0
    points, turns = _points(robot, joint, FIN * size), _turns(robot, joint, shapes)
    places = _spring_joints(robot)
    found = {
        "size": round(size, 4),
        "parent": parent,
        "radius": compact(radius, 4),
        "fins": [int(j) for j in mechanism.arm],
        "unit": size / UNITS,
        "meshes": shapes.data(size),
        "configurations": [
            {
                "points": compact(points[c], 4),
                "turns": compact(turns[c].reshape(-1, 9), 5),
                "modes": [_mode(robot, joint[c], mode, size, places, shapes) for mode in modes[c]],
            }
            for c in range(len(angle))
        ],
    }
    return found, shapes


def _points(robot: Robot, joint: FloatArray, fin: float) -> FloatArray:
    """Joints, tips and, where `fin` is not zero, the end of a fin on each driven body, (n_config, n_point, 3)."""
    points, turns = frames(robot.chain, joint)
    if not fin:
        return points
    ends = []
    for j in robot.mechanism.arm:
        axis = robot.chain.axis[j]
        across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        ends.append(points[:, j] + turns[:, j] @ (fin * across / np.linalg.norm(across)))
    return np.concatenate([points, np.stack(ends, axis=1)], axis=1)


def _turns(robot: Robot, joint: FloatArray, meshes: DrawnMeshes) -> FloatArray:
    """From the frame of each mesh to the base, (n_config, n_mesh, 3, 3)."""
    turns = frames(robot.chain, joint)[1]
    still = np.broadcast_to(np.eye(3), (len(joint), 1, 3, 3))
    return np.concatenate([turns, still], axis=1)[:, meshes.joint]


def _mode(
    robot: Robot,
    joint: FloatArray,
    mode: ElasticMode,
    size: float,
    places: list[int],
    meshes: DrawnMeshes,
) -> dict[str, Any]:
    rate = robot.mechanism.constraint_map @ mode.shape
    rate = rate / np.abs(rate).max()
    around = np.stack([joint + STEP * rate, joint - STEP * rate])
    ends, turns = _points(robot, around, FIN * size), _turns(robot, around, meshes)
    moved = (ends[0] - ends[1]) / (2 * STEP)
    swing = SWING * size / np.linalg.norm(moved, axis=1).max()
    # dR/dt = [w] R: the small turn of each mesh in the base frame
    spin = (turns[0] - turns[1]) / (2 * STEP) @ np.swapaxes(turns.mean(axis=0), -1, -2)
    turned = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    share = np.zeros(len(joint))
    np.add.at(share, places, mode.energy)
    return {
        "name": f"{significant(mode.frequency_hz, 3)} Hz",
        "words": energy_in_words(robot.spring_names, mode.energy),
        "moved": compact(swing * moved, 4),
        "turned": compact(swing * turned, 5),
        "share": compact(share, 3),
    }


def _spring_joints(robot: Robot) -> list[int]:
    """Joint at which each spring stands, in the order of `Robot.spring_names`."""
    mechanism = robot.mechanism
    return [*(int(j) for j in mechanism.arm[mechanism.elastic_gear]), *(int(j) for j in mechanism.elastic)]


def _radii(robot: Robot, points: FloatArray, parent: list[int], size: float) -> FloatArray:
    """Radius of what stands between each point and the one that it hangs on; zero where they coincide."""
    chain, n = robot.chain, robot.chain.n_coordinate
    length = np.array(
        [np.linalg.norm(points[j] - (points[p] if p >= 0 else 0.0)) for j, p in enumerate(parent)]
    )
    carried = np.zeros(
        n
    )  # mass of the bodies that begin where body j does: elastic joints stand in one place
    for j in range(n):
        carried[j] = chain.mass[j] + (
            carried[parent[j]] if parent[j] >= 0 and length[j] < 1e-6 * size else 0.0
        )
    radius = np.zeros(len(parent))
    for j, p in enumerate(parent):
        if length[j] >= 1e-6 * size:
            rod = np.sqrt((carried[p] if p >= 0 else 0.0) / (np.pi * DENSITY * length[j]))
            radius[j] = np.clip(rod, THICKNESS[0] * size, THICKNESS[1] * size)
    return radius
