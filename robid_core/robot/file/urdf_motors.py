"""What a URDF says of motors: friction by its own tag, the rest where robid wrote the file (`robot/urdf.py`)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from xml.etree import ElementTree


@dataclass(frozen=True)
class UrdfMotor:
    """The motor of a joint; None: the file does not say."""

    gear_ratio: float | None = None
    rotor_inertia: float | None = None
    """At the motor shaft, kg m^2."""
    damping: float = 0.0
    """At the joint, N m s/rad."""
    friction: float = 0.0
    """At the joint, N m."""

    @property
    def at_motor(self) -> tuple[float, float] | None:
        """Coulomb level and viscous friction at the motor, N m and N m s/rad; None without the gear ratio."""
        if self.gear_ratio is None:
            return None
        return self.friction / abs(self.gear_ratio), self.damping / self.gear_ratio**2


def urdf_motors(root: ElementTree.Element) -> dict[str, UrdfMotor]:
    """Return what the file says of each joint's motor, by the joint's name; what is no number is passed over."""
    return {str(joint.get("name")): _motor(joint) for joint in root.findall("joint")}


def _motor(joint: ElementTree.Element) -> UrdfMotor:
    own, dynamics = joint.find("robid"), joint.find("dynamics")
    rotor, ratio = None, None
    if own is not None:
        rotor = _number(own.get("rotor_inertia"))
        row = [_number(text) for text in str(own.get("gear_row", "")).split()]
        turning = [one for one in row if one]
        ratio = 1 / turning[0] if len(turning) == 1 else None  # of coupled axes there is none
    return UrdfMotor(
        gear_ratio=ratio,
        rotor_inertia=rotor or None,
        damping=(_number(dynamics.get("damping")) or 0.0) if dynamics is not None else 0.0,
        friction=(_number(dynamics.get("friction")) or 0.0) if dynamics is not None else 0.0,
    )


def _number(text: str | None) -> float | None:
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if math.isfinite(value) else None
