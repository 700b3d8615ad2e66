"""A base that gives way under the robot, put into MuJoCo's description: a body on two springs between floor and arm."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree


@dataclass(frozen=True)
class Base:
    """A body on springs and dampers about, or along, x and y of the base frame."""

    rocks: bool
    """About x and y; else it sways along them."""
    stiffness: tuple[float, float]
    """N m/rad or N/m."""
    damping: tuple[float, float]
    mass: float
    height: float = 0.0
    """Of its centre of mass over the base frame, m."""
    radius: float = 0.0
    """Of gyration, m."""


def on_base(xml: str, base: Base) -> str:
    """Return the description with all bodies of the arm on a base; its two joints stand before those of the arm."""
    root = ElementTree.fromstring(xml)
    world = root.find("worldbody")
    assert world is not None
    arm = [body for body in world if not (body.get("name") or "").startswith("motor.")]
    body = ElementTree.Element("body", {"name": "base"})
    moment = " ".join([repr(max(base.mass * base.radius**2, 1e-9))] * 3)
    ElementTree.SubElement(
        body, "inertial", {"pos": f"0 0 {base.height!r}", "mass": repr(base.mass), "diaginertia": moment}
    )
    axes = zip("xy", ("1 0 0", "0 1 0"), base.stiffness, base.damping, strict=True)
    for name, axis, stiffness, damping in axes:
        numbers = {"stiffness": repr(stiffness), "damping": repr(damping)}
        kind = "hinge" if base.rocks else "slide"
        ElementTree.SubElement(body, "joint", {"name": f"base.{name}", "type": kind, "axis": axis, **numbers})
    for child in arm:
        world.remove(child)
        body.append(child)
    world.append(body)
    return ElementTree.tostring(root, encoding="unicode")
