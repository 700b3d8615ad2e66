"""The robot drawn as a stick figure from the side and from above, as SVG without script."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from robid_core import FloatArray, Robot
from robid_core.mechanics import Chain
from robid_core.mechanics.chain import rotation_by

SIZE = 100.0
VIEWS = ("side", "top")


@dataclass(frozen=True)
class Skeleton:
    """Joint origins in the base frame, (n_config, n_point, 3), and the point that each hangs on (-1: the base)."""

    points: FloatArray
    parent: tuple[int, ...]


def skeleton(robot: Robot, angle: FloatArray) -> Skeleton:
    """Origins of all joints and, at the end of each branch, the last body's centre of mass.

    Parameters
    ----------
    robot
        Gives chain and gears.
    angle
        Motor angles seen through the gear, shape (n_config, n_axis); elastic coordinates stand at zero.
    """
    joint = np.zeros((len(angle), robot.chain.n_coordinate))
    joint[:, robot.mechanism.arm] = angle
    return Skeleton(
        frames(robot.chain, joint)[0], (*(int(p) for p in robot.chain.parent), *tips(robot.chain))
    )


def tips(chain: Chain) -> list[int]:
    """Bodies on which none hangs."""
    return [j for j in range(chain.n_coordinate) if j not in chain.parent]


def frames(chain: Chain, joint: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Origins of all joints with the tips' centres of mass, and the axes of all bodies.

    Parameters
    ----------
    chain
        Its bodies.
    joint
        Joint coordinates, shape (n_config, n_joint).

    Returns
    -------
    Points in the base frame, (n_config, n_joint + n_tip, 3), and rotations, (n_config, n_joint, 3, 3).
    """
    n, ends = chain.n_coordinate, tips(chain)
    points, turns = np.zeros((len(joint), n + len(ends), 3)), np.zeros((len(joint), n, 3, 3))
    for c in range(len(joint)):
        for j in range(n):
            parent = int(chain.parent[j])
            turn, origin = (turns[c, parent], points[c, parent]) if parent >= 0 else (np.eye(3), np.zeros(3))
            placed = turn @ chain.rotation[j]
            points[c, j] = origin + turn @ chain.translation[j]
            points[c, j] += placed @ chain.sliding_axis[j] * joint[c, j]
            turns[c, j] = placed @ rotation_by(chain.turning_axis[j] * joint[c, j])
        for k, tip in enumerate(ends):
            points[c, n + k] = points[c, tip] + turns[c, tip] @ chain.centre_of_mass[tip]
    return points, turns


def is_worth_drawing(body: Skeleton) -> bool:
    """Tell whether there is a link: a rotor or a slide whose mass lies in its joint draws as a point."""
    reach = body.points.max(axis=1) - body.points.min(axis=1)
    return bool(reach.max() > 0)


def draw(body: Skeleton, configuration: int, view: str) -> Markup:
    """SVG of one configuration from one of `VIEWS`; all configurations and views share one scale.

    The side view looks across the vertical plane in which the arm reaches furthest out.
    """
    everything = np.concatenate([body.points.reshape(-1, 3), np.zeros((1, 3))])
    reach = float(np.hypot(everything[:, 0], everything[:, 1]).max())
    low, high = float(everything[:, 2].min()), float(everything[:, 2].max())
    span = max(2 * reach, high - low, 1e-9) * 1.1
    points = body.points[configuration]
    if view == "side":
        furthest = points[np.hypot(points[:, 0], points[:, 1]).argmax()]
        along = np.array([furthest[0], furthest[1], 0.0]) / (np.hypot(furthest[0], furthest[1]) or 1.0)
        flat = np.column_stack([points @ along, points[:, 2] - (low + high) / 2])
        base = np.array([0.0, -(low + high) / 2])
    else:
        flat, base = points[:, :2], np.zeros(2)

    def place(point: FloatArray) -> str:
        return f"{SIZE * (0.5 + point[0] / span):.1f} {SIZE * (0.5 - point[1] / span):.1f}"

    links = "".join(
        f"M{place(flat[p] if p >= 0 else base)}L{place(flat[j])}" for j, p in enumerate(body.parent)
    )
    joints = [place(flat[j]).split() for j in range(len(body.parent)) if j in body.parent]
    dots = "".join(f'<circle cx="{x}" cy="{y}" r="2.2"/>' for x, y in joints)
    ground = place(base).split()
    floor = f'<path class="floor" d="M{float(ground[0]) - 12:.1f} {ground[1]}h24"/>' if view == "side" else ""
    return Markup(  # numbers and the view's name only: nothing of the user's text is in here
        f'<svg viewBox="0 0 {SIZE:g} {SIZE:g}" class="stick" aria-hidden="true">{floor}'
        f'<path class="link" d="{links}"/>{dots}<text x="2" y="10">{view}</text></svg>'
    )
