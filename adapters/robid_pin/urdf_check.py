"""What is wrong with a URDF file, told from its text: every mistake with its line and the name of joint or link.

A chain is a tree of links, joined by joints that turn, slide or are fixed; every joint that moves carries a mass. Links
without mass in front of a joint that robid wrote as elastic (`<robid elastic=...>`) are in order. What is locked
counts as fixed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from xml.etree.ElementTree import Element
from xml.parsers import expat

import numpy as np

from robid_core import ConfigurationError

MOVING = ("revolute", "continuous", "prismatic")
_TURN = 6.4  # rad; beyond, an angle of an origin is in degrees
_TOLERANCE = 1e-6  # relative, of the largest principal moment of inertia

_OPEN = (
    "robid models chains and trees, no closed loops: cut each loop at one joint and describe the tree that is left, or "
    "couple axes with the gear matrix of robot.yaml"
)
Mistake = tuple[Element, str]


def check_urdf(text: str, file: str, locked: Collection[str] = ()) -> Element:
    """Return the document of a URDF file in which nothing is wrong; `locked` joints do not move.

    Raises ConfigurationError with every mistake, one line each: file:line: what, and what to do.
    """
    try:
        root, lines = _parse(text)
    except expat.ExpatError as error:
        raise ConfigurationError(f"{file}: not readable as URDF: {error}; is it XML in UTF-8?") from None
    macro = next((element for element in lines if element.tag.startswith("xacro:")), None)
    if macro is not None:
        raise ConfigurationError(
            f"{file}:{lines[macro]}: <{macro.tag}> is xacro, not URDF; expand the file first: xacro FILE > robot.urdf"
        )
    if root.tag != "robot":
        raise ConfigurationError(
            f"{file}: the file describes a <{root.tag}>, not a <robot>; give a URDF file"
        )
    mistakes = [*_names(root), *_joints(root, locked), *_tree(root), *_origins(root), *_inertias(root)]
    if not mistakes:
        mistakes = [*_masses(root, locked)]
    if mistakes:
        told = sorted({(lines[element], message) for element, message in mistakes})
        raise ConfigurationError("\n".join(f"{file}:{line}: {message}" for line, message in told))
    return root


def _parse(text: str) -> tuple[Element, dict[Element, int]]:
    """Return the document and the line of every element."""
    parser = expat.ParserCreate()
    found: list[Element] = []
    stack: list[Element] = []
    lines: dict[Element, int] = {}

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes)
        lines[element] = parser.CurrentLineNumber
        (stack[-1] if stack else found).append(element)
        stack.append(element)

    def end(tag: str) -> None:
        del tag
        stack.pop()

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(text, True)
    return found[0], lines


def _names(root: Element) -> Iterator[Mistake]:
    for kind in ("link", "joint"):
        seen: set[str] = set()
        for element in root.findall(kind):
            name = element.get("name", "")
            if not name:
                yield element, f"a {kind} has no name; give it one"
            elif name in seen:
                yield element, f"{kind} '{name}' stands twice; names must differ"
            seen.add(name)


def _joints(root: Element, locked: Collection[str]) -> Iterator[Mistake]:
    joints = root.findall("joint")
    for joint in joints:
        name, kind = joint.get("name", "?"), joint.get("type", "none")
        if joint.find("mimic") is not None and name not in locked:
            yield (
                joint,
                f"joint '{name}' mimics another; a chain has free joints only: lock it (lock: {{{name}: 0}} in "
                "robot.yaml), make it fixed, or couple the axes with the gear matrix of robot.yaml",
            )
        if kind not in (*MOVING, "fixed"):
            yield (
                joint,
                f"joint '{name}' is of type '{kind}'; a chain has revolute, continuous, prismatic and fixed joints: "
                "make it fixed, or write it as joints of one degree of freedom",
            )
        axis, limit = joint.find("axis"), joint.find("limit")
        if kind in MOVING and axis is not None:
            direction = vector_of(axis.get("xyz", "1 0 0"))
            if direction is None or np.linalg.norm(direction) < 1e-9:
                yield (
                    joint,
                    f"joint '{name}' has the axis '{axis.get('xyz')}'; give a unit vector of three numbers",
                )
        lacking = [key for key in ("effort", "velocity") if limit is not None and key not in limit.attrib]
        if kind in ("revolute", "prismatic") and (limit is None or lacking):
            lacks = "no <limit>" if limit is None else f"a <limit> without {' and '.join(lacking)}"
            yield (
                joint,
                f"joint '{name}' has {lacks}; URDF asks for lower, upper, effort and velocity (0: not known)",
            )
        if kind in ("revolute", "prismatic") and limit is not None:
            ends = [number_of(limit.get(end, "0")) for end in ("lower", "upper")]
            if None in ends:
                wrong = limit.get(("lower", "upper")[ends.index(None)])
                yield joint, f"joint '{name}' has the limit '{wrong}', which is not a number; give rad or m"
            elif (ends[0] or 0.0) > (ends[1] or 0.0):
                yield (
                    joint,
                    f"joint '{name}': the lower limit {ends[0]:g} is above the upper one {ends[1]:g}; exchange them",
                )
    if not any(joint.get("type") in MOVING and joint.get("name") not in locked for joint in joints):
        yield (
            root,
            "no joint moves; give at least one revolute, continuous or prismatic joint, and do not lock all",
        )


def _tree(root: Element) -> Iterator[Mistake]:
    """Every link but one has one joint before it, and all hang on that one."""
    links = {link.get("name"): link for link in root.findall("link")}
    before: dict[str | None, Element] = {}
    for joint in root.findall("joint"):
        name = joint.get("name", "?")
        for which in ("parent", "child"):
            if _end(joint, which) not in links:
                yield joint, f"joint '{name}' names the {which} '{_end(joint, which)}', no link has that name"
        child = _end(joint, "child")
        if child in before:
            other = before[child].get("name")
            yield joint, f"link '{child}' hangs on joints '{other}' and '{name}': a closed loop; {_OPEN}"
        before.setdefault(child, joint)
    roots = [name for name in links if name not in before]
    if len(roots) > 1:
        names = ", ".join(f"'{name}'" for name in roots)
        yield (
            links[roots[1]],
            f"links {names} hang on no joint: the robot is in pieces; join them by fixed joints",
        )
    for start in links:
        loop: list[str | None] = []
        at: str | None = start
        while at in before and at not in loop:
            loop.append(at)
            at = _end(before[at], "parent")
        if at in loop and at == min(loop[loop.index(at) :], key=str):
            joints = [str(before[link].get("name")) for link in loop[loop.index(at) :]]
            told = " and ".join(f"'{joint}'" for joint in sorted(joints))
            yield before[at], f"joints {told} lead round in a closed loop with no link to stand on; {_OPEN}"


def _origins(root: Element) -> Iterator[Mistake]:
    """Refuse places and directions of joints and bodies that are not three numbers: readers leave out what has them."""
    found = [(joint, f"joint '{joint.get('name')}'", joint.find("origin")) for joint in root.findall("joint")]
    for link in root.findall("link"):
        found.append((link, f"link '{link.get('name')}': <inertial>", link.find("inertial/origin")))
    for owner, of, origin in found:
        for key, unit in (("xyz", "m"), ("rpy", "rad")):
            written = "0 0 0" if origin is None else origin.get(key, "0 0 0")
            numbers = vector_of(written)
            if numbers is not None and key == "rpy" and max(map(abs, numbers)) > _TURN:
                radians = " ".join(f"{np.radians(number):.6g}" for number in numbers)
                yield (
                    owner if origin is None else origin,
                    f"{of} has the origin rpy='{written}' rad, more than a turn; degrees? Write rpy=\"{radians}\"",
                )
            if numbers is not None:
                continue
            comma = "; decimal comma? Write a point, and blanks between numbers" if "," in written else ""
            yield (
                owner if origin is None else origin,
                f"{of} has the origin {key}='{written}'; give three numbers in {unit}, such as '0 0 0.3'{comma}",
            )


def _inertias(root: Element) -> Iterator[Mistake]:
    for link in root.findall("link"):
        name, inertial = link.get("name"), link.find("inertial")
        if inertial is None:
            continue
        mass = inertial.find("mass")
        written = "" if mass is None else mass.get("value", "")
        value = number_of(written)
        if value is None:
            yield link, f"link '{name}': mass '{written}' is not a number; give kg"
        elif value < 0:
            yield link, f"link '{name}': mass {value:g} kg is negative"
        tensor = inertial.find("inertia")
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        if tensor is not None and (lacking := [key for key in keys if key not in tensor.attrib]):
            yield tensor, f"link '{name}': <inertia> lacks {', '.join(lacking)}; give all six in kg m^2"
            continue
        moments = [number_of(tensor.get(key, "0") if tensor is not None else "0") for key in keys]
        if None in moments:
            key = keys[moments.index(None)]
            wrong = tensor.get(key) if tensor is not None else None
            yield link, f"link '{name}': {key} '{wrong}' is not a number; give kg m^2"
            continue
        xx, xy, xz, yy, yz, zz = (float(moment or 0.0) for moment in moments)
        small, middle, large = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if small < -_TOLERANCE * abs(large) or small + middle < large * (1 - _TOLERANCE):
            yield (
                link,
                f"link '{name}': principal moments {small:.6g}, {middle:.6g}, {large:.6g} kg m^2: none may be "
                "negative, and no body has the largest above the sum of the others; are they about the centre of mass?",
            )


def _masses(root: Element, locked: Collection[str]) -> Iterator[Mistake]:
    """Refuse a joint that moves nothing with a mass: itself and what is fixed or locked to it."""
    masses = {link.get("name"): _mass(link) for link in root.findall("link")}
    fixed: dict[str | None, list[str | None]] = {}
    elastic = set()
    for joint in root.findall("joint"):
        if joint.get("type") == "fixed" or joint.get("name") in locked:
            fixed.setdefault(_end(joint, "parent"), []).append(_end(joint, "child"))
        if any("elastic" in extension.attrib for extension in joint.findall("robid")):
            elastic.add(_end(joint, "parent"))
    for joint in root.findall("joint"):
        still = joint.get("type") not in MOVING or joint.get("name") in locked
        if still or _end(joint, "child") in elastic:
            continue
        moved = [_end(joint, "child")]
        for link in moved:
            moved += [child for child in fixed.get(link, []) if child not in moved]
        if not any(masses.get(link, 0.0) > 0 for link in moved):
            yield (
                joint,
                f"link '{moved[0]}' has no inertial with a mass, nor has any link fixed to it; give it an <inertial>, "
                f"joint '{joint.get('name')}' would move nothing",
            )


def _end(joint: Element, which: str) -> str | None:
    end = joint.find(which)
    return None if end is None else end.get("link")


def _mass(link: Element) -> float:
    mass = link.find("inertial/mass")
    return 0.0 if mass is None else number_of(mass.get("value", "")) or 0.0


def number_of(text: str) -> float | None:
    """Return a finite number that a text is, or None."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


def vector_of(text: str) -> list[float] | None:
    """Return three finite numbers that a text is, or None."""
    numbers = [number_of(part) for part in text.split()]
    return None if len(numbers) != 3 or None in numbers else [number or 0.0 for number in numbers]
