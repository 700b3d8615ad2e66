"""Elastic coordinates proposed for a robot of which bodies and joint torques are known, and nothing of its gears.

By size: a gear winds up by eight milliradians at its largest torque (main axes of the packaged robots by 4 to 13), and
a bearing with its links is twice as stiff across the axis as the gear is along it. What then swings above `HIGHEST_HZ`
with all that it carries, motors held, is rigid for what motors can shake: a gear in the pose where that has most
inertia, a bearing with the stretched arm. By direction: a bearing gets the two directions across its axis, less those
about the line of the next axis (`coaxial`), those of which the lines about one point are too many (`meeting`), and
those that no joint's motion excites: a bearing is felt through the mass matrix alone.

Speed controllers and sensors have the size of those of the packaged robots: `SPEED_RATE` and `INTEGRAL_RATE` lie within
their range (5 to 70/s; 8/s), torque noise is 0.5 to 0.7 thousandths of their torque limits.

These are numbers to begin with, no data: a fit has to find them, a sheet may give them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.robot.file.body import Body
from robid_core.robot.file.expansion import directions_across
from robid_core.robot.file.meeting import dependent_springs, has_origin_of_parent
from robid_core.robot.file.tree import stretched_inertia
from robid_core.robot.file.wording import PLACEHOLDER

if TYPE_CHECKING:
    from robid_core.mechanics import Chain

WIND_UP = 8e-3  # rad at the largest torque
SLIDE = 1e-4  # m at the largest force
UNKNOWN_HZ = 15.0  # of a gear whose torque the URDF does not give, with the most inertia that it carries
BEARING_RATIO = 2.0
HIGHEST_HZ = 100.0
SPEED_RATE = 20.0  # 1/s, speed gain over the inertia at the motor shaft
INTEGRAL_RATE = 8.0  # 1/s, integral gain over the speed gain
TORQUE_NOISE = 6e-4  # rms of a sample over the torque limit
USUAL_RATIO = 100.0  # of a gear whose ratio is not known yet
DAMPING_RATIO = 0.03
_PARALLEL = 1e-6
_LEAST_COUPLING = 0.02  # cosine between two coordinates in the metric of the mass matrix
_POSES = 16
_POSES_OF_INERTIA = 256


@dataclass(frozen=True)
class ProposedSpring:
    """Stiffness, damping and why."""

    stiffness: float
    """N m/rad or N/m."""
    damping: float
    """N m s/rad or N s/m."""
    frequency_hz: float
    """With all that it carries, motors held."""
    origin: str
    """Where the stiffness comes from, in words."""


def proposed_gear(carried: float, slides: bool, effort: float | None) -> ProposedSpring:
    """Return the spring of a joint's gear; above `HIGHEST_HZ` it is better left out.

    Parameters
    ----------
    carried
        By the joint, from `carried_inertia`.
    slides
        Whether it is prismatic.
    effort
        Largest torque or force at the joint; None: not known.
    """
    if effort is None:
        stiffness, origin = carried * (2 * math.pi * UNKNOWN_HZ) ** 2, "the URDF gives no torque"
    else:
        wind_up = SLIDE if slides else WIND_UP
        stiffness, unit = effort / wind_up, "mm" if slides else "mrad"
        origin = f"{1000 * wind_up:g} {unit} at {effort:g} {'N' if slides else 'N m'}"
    return _spring(stiffness, carried, origin)


def proposed_sensors(effort: float | None) -> str:
    """Return the entry of a drive's sensors: a 20-bit encoder; torque noise waits where no torque limit is known."""
    noise = f"{TORQUE_NOISE * effort / USUAL_RATIO:.2g}" if effort else PLACEHOLDER
    return f"{{encoder_counts: 1048576, position_noise: 2.0e-5, torque_noise: {noise}}}"


def carried_inertia(chain: Chain, joint: str) -> float:
    """Return the most that a joint moves in any pose, about its own axis: kg m^2, or kg where it slides."""
    from robid_core.mechanics import REVOLUTE, dynamics

    poses = np.random.default_rng(0).uniform(-np.pi, np.pi, (_POSES_OF_INERTIA, chain.n_coordinate))
    poses[:, chain.joint_type != REVOLUTE] = 0.0
    row = chain.index(joint)
    return float(dynamics(chain, poses).mass[:, row, row].max())


def proposed_bearing(bodies: tuple[Body, ...], joint: str, gear: ProposedSpring) -> ProposedSpring:
    """Return the spring across the axis of a turning joint, in each direction."""
    origin = f"{BEARING_RATIO:g} times the gear's"
    return _spring(BEARING_RATIO * gear.stiffness, stretched_inertia(bodies, joint), origin)


def bearing_directions(
    chain: Chain, bodies: tuple[Body, ...], joint: str
) -> tuple[dict[str, list[float]], list[str]]:
    """Return the directions across a joint's axis by letter, and those left out, each with why."""
    own = next(body for body in bodies if body.joint == joint)
    kept, left = {}, []
    for letter, direction in directions_across(own.axis).items():
        same = next(
            (body.joint for body in bodies if body.parent == joint and _coaxial(direction, body)), None
        )
        if same is not None:
            left.append(f"{letter}: the line of {same}, whose gear would be the same spring")
        elif (coupling := _coupling(chain, joint, direction)) < _LEAST_COUPLING:
            left.append(f"{letter}: no joint's motion excites it (coupling {coupling:.2g} at most)")
        else:
            kept[letter] = direction
    return kept, left


def without_dependent(
    directions: dict[str, list[float]],
    before: Mapping[str, FloatArray],
    gear: Mapping[str, FloatArray],
    body: Body,
) -> list[str]:
    """Take bearings off `directions` that motors cannot tell from springs about the same point; return each with why.

    `before` are the springs of the joint before, `gear` that of this one where it is elastic: directions by name.
    """
    left: list[str] = []
    while has_origin_of_parent(body) and body.type == "revolute":
        own = {letter: np.array(direction) for letter, direction in directions.items()}
        behind = {f"{letter} behind": direction for letter, direction in own.items()} | dict(gear)
        names = dependent_springs({f"{name} before": one for name, one in before.items()}, behind, body)
        letter = next((name.removesuffix(" behind") for name in names if name.endswith(" behind")), "")
        if not letter:
            break
        del directions[letter]
        left.append(
            f"{letter}: its line intersects those of '{body.parent}' in one point, and motors feel the springs there "
            "in one combination less"
        )
    return left


def locked_by_mimicry(mimics: Mapping[str, str]) -> dict[str, str]:
    """Return the joints of grippers and the like to lock, each with the reason: what mimics, and what is mimicked."""
    found = {joint: f"mimics {other}" for joint, other in mimics.items()}
    return found | {other: "others mimic it" for other in mimics.values() if other not in found}


def _coupling(chain: Chain, joint: str, direction: list[float]) -> float:
    """Largest cosine, over poses and joints, of a bearing's coordinate with one that moves; 0: nothing stirs it."""
    from robid_core.mechanics import dynamics

    bent = chain.with_elastic(joint, "bearing", np.array(direction))
    row = bent.index("bearing")
    poses = np.random.default_rng(0).uniform(-1, 1, (_POSES, bent.n_coordinate))
    poses[:, row] = 0.0
    mass = dynamics(bent, poses).mass
    diagonal = np.diagonal(mass, axis1=-2, axis2=-1)
    cosine = abs(mass[:, row]) / np.sqrt(diagonal * diagonal[:, [row]])
    return float(np.delete(cosine, row, axis=1).max())


def _coaxial(direction: list[float], body: Body) -> bool:
    """Whether a joint turns about the line through the origin before it."""
    turned = np.array(body.rotation) @ np.array(body.axis)
    parallel = np.linalg.norm(np.cross(direction, turned)) < _PARALLEL
    return body.type == "revolute" and bool(
        parallel and np.linalg.norm(np.cross(direction, body.translation)) < _PARALLEL
    )


def _spring(stiffness: float, carried: float, origin: str) -> ProposedSpring:
    damping = 2 * DAMPING_RATIO * math.sqrt(stiffness * carried)
    return ProposedSpring(stiffness, damping, math.sqrt(stiffness / carried) / (2 * math.pi), origin)
