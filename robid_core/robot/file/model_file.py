"""Bodies and limits from a model file (URDF), through the reader that is registered for its suffix.

A reader takes the path and the joints that do not move, with the coordinate each stays at (`lock:` of a robot file),
and gives a `RobotModel`. What the robot file says of an axis wins; limits that it leaves out are those of the model
file, brought to the motor side by the gear ratio. Joints that robid wrote as elastic (`robot.urdf`) are elastic again.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError, PluginError
from robid_core.registry import MODELS, call_fault, registry

if TYPE_CHECKING:
    from robid_core.mechanics import Chain

_KINDS = ("revolute", "prismatic")  # as numbered in mechanics.chain; a flexible link's modes come after
_KEYS = ("position_limits", "speed_limit", "torque_limit")


@dataclass(frozen=True)
class JointLimits:
    """What a model file says of a joint, joint side; null: nothing, or nothing that can be a limit."""

    position: tuple[float, float] | None = None
    """Lower and upper end, rad or m."""
    speed: float | None = None
    """Largest speed, rad/s or m/s."""
    effort: float | None = None
    """Largest torque or force, N m or N."""


@dataclass(frozen=True)
class MeshShape:
    """A mesh file with which a model file draws a link."""

    joint: str | None
    """The joint that it moves with; null: the base."""
    rotation: FloatArray
    """From the mesh's frame to the joint's, shape (3, 3)."""
    translation: FloatArray
    """Origin of the mesh's frame in the joint's, m, shape (3,)."""
    scale: FloatArray
    """What one unit of the file is along its three axes, m."""
    file: Path
    """Where it is."""
    name: str
    """As the model file names it."""


@dataclass(frozen=True)
class RobotModel:
    """What a model file says of a robot."""

    chain: Chain
    """The joints that move, with their bodies; what is fixed or locked is merged into the body before."""
    joints: tuple[str, ...] = ()
    """All joints of the file that could move, also those that were locked."""
    limits: Mapping[str, JointLimits] = field(default_factory=dict)
    """By joint."""
    springs: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Stiffness and damping of joints that no motor moves, N m/rad and N m s/rad; robid writes such into a URDF."""
    shapes: tuple[MeshShape, ...] = ()
    """What its links are drawn with."""
    remarks: tuple[str, ...] = ()
    """What cannot be drawn and why, a sentence each."""


def read_model(path: Path, locked: Mapping[str, float]) -> RobotModel:
    """Return what a model file describes, some joints held at a coordinate (rad or m).

    Raises
    ------
    ConfigurationError
        Where there is no such file, or it describes no chain of rigid bodies; one line for each mistake.
    PluginError
        Where no reader for its suffix can be imported, or what is registered is none.
    """
    if not path.is_file():
        raise ConfigurationError(f"{path} is no file (`model:` of a robot file is relative to that file)")
    plugin = registry().find(MODELS, path.suffix.lstrip(".").lower())
    reader = plugin.load()
    if fault := call_fault(reader, "file", "locked joints"):
        raise PluginError(f"{plugin} {fault}")
    model = reader(path, locked)
    if not isinstance(model, RobotModel):
        raise PluginError(
            f"{plugin} gave a {type(model).__name__} for {path.name}, not a robid_core.RobotModel"
        )
    chain = model.chain
    modal = [name for name, kind in zip(chain.names, chain.joint_type, strict=True) if kind >= len(_KINDS)]
    if modal:
        raise ConfigurationError(
            f"{path.name}: '{modal[0]}' is a mode of a flexible link; a model file gives rigid bodies, the link is "
            "written as `flexible` under `bodies`"
        )
    return model


def bodies_of(model: RobotModel, driven: Container[str] = ()) -> list[dict[str, Any]]:
    """Return the entries of `bodies` that a model is; a joint that an axis drives has no spring of its own."""
    chain = model.chain
    springs = {
        joint: {"stiffness": stiffness, "damping": damping}
        for joint, (stiffness, damping) in model.springs.items()
        if joint not in driven
    }
    names = list(chain.names)
    return [
        {
            "joint": names[j],
            "parent": names[int(chain.parent[j])] if chain.parent[j] >= 0 else None,
            "type": _KINDS[int(chain.joint_type[j])],
            "axis": chain.axis[j].tolist(),
            "translation": chain.translation[j].tolist(),
            "rotation": chain.rotation[j].tolist(),
            "mass": float(chain.mass[j]),
            "centre_of_mass": chain.centre_of_mass[j].tolist(),
            "inertia": chain.inertia[j].tolist(),
            "elastic": springs.get(names[j]),
        }
        for j in range(len(names))
    ]


def with_limits(axes: Any, limits: Mapping[str, JointLimits], coupled: bool) -> Any:
    """Return the entries of `axes` with the limits of a model file where they say nothing.

    A key that is written wins, null too. Speed and torque go through the gear of the axis: those of a robot whose gears
    are coupled (`coupling`) have no one axis to go to, and stay out.
    """
    if not isinstance(axes, Mapping):
        return axes
    found = {}
    for name, axis in axes.items():
        joint = limits.get(str(axis.get("joint") or name)) if isinstance(axis, Mapping) else None
        found[name] = axis if joint is None else {**_told(axis, joint, coupled), **axis}
    return found


def _told(axis: Mapping[str, Any], joint: JointLimits, coupled: bool) -> dict[str, Any]:
    ratio = axis.get("gear_ratio", 1.0)
    told: dict[str, Any] = {"position_limits": None if joint.position is None else list(joint.position)}
    if not coupled and isinstance(ratio, int | float) and ratio and math.isfinite(ratio):
        told["speed_limit"] = None if joint.speed is None else joint.speed * abs(ratio)
        told["torque_limit"] = None if joint.effort is None else joint.effort / abs(ratio)
    return {key: told[key] for key in _KEYS if told.get(key) is not None}
