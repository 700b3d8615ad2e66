"""The draft of a robot file for a URDF: what the model file knows is taken, what it cannot know is a line to fill in.

A URDF knows bodies, joints and limits at the joint; one that robid wrote gear ratios and rotors, too. What it does not
say of these, torque constants and controllers are written as `fill_in`, which the reader of robot files refuses at its
line; elastic coordinates are proposed (`file.proposal`), each with where its number comes from. What is not taken over
is told: locked joints, meshes that are not found.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from pydantic import TypeAdapter

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.robot.file.body import Body
from robid_core.robot.file.derived_file import key_text
from robid_core.robot.file.model_file import JointLimits, RobotModel, bodies_of, read_model
from robid_core.robot.file.part import with_tuples
from robid_core.robot.file.proposal import (
    HIGHEST_HZ,
    INTEGRAL_RATE,
    SPEED_RATE,
    TORQUE_NOISE,
    ProposedSpring,
    bearing_directions,
    carried_inertia,
    locked_by_mimicry,
    proposed_bearing,
    proposed_gear,
    proposed_sensors,
    without_dependent,
)
from robid_core.robot.file.urdf_motors import UrdfMotor, urdf_motors
from robid_core.robot.file.wording import PLACEHOLDER
from robid_core.yaml_file.problems import suggestion

SUFFIX = ".urdf"
_COLUMN = 44  # of the comments
_SAMPLE = 0.75  # stiffness of the simulated machine over the proposed one


@dataclass(frozen=True)
class Draft:
    """A robot file with gaps that only a person can fill."""

    robot: str
    """Text of robot.yaml."""
    plant: str
    """Text of plant.yaml: a simulated machine with other springs."""
    remarks: tuple[str, ...]
    """What was not taken over, and what was decided."""
    to_fill_in: int
    """How many values wait."""
    n_springs: int
    """How many elastic coordinates are proposed, or are in the URDF already."""
    meshes: Mapping[str, Path]
    """Where the meshes are, by their names in the URDF."""


def draft_of(path: Path, name: str, lock: Collection[str] = ()) -> Draft:
    """Return the draft of a robot file that stands beside its URDF.

    Parameters
    ----------
    path
        The URDF file.
    name
        Of the robot.
    lock
        Joints to lock besides those that mimic others.

    Raises
    ------
    ConfigurationError
        Where the file is no URDF, or cannot be a chain; one line for each mistake.
    """
    if path.suffix.lower() != SUFFIX:
        expand = ": expand it first (xacro FILE > robot.urdf)" if path.suffix.lower() == ".xacro" else ""
        raise ConfigurationError(f"{path}: not a URDF file (*{SUFFIX}){expand}; give one")
    locked, motors, remarks = _look(path)
    locked |= dict.fromkeys(lock, "asked for")
    model = read_model(path, dict.fromkeys(locked, 0.0))
    unknown = [joint for joint in lock if joint not in model.joints]
    if unknown:
        raise ConfigurationError(
            f"{path.name} has no joint '{unknown[0]}' to lock; {suggestion(unknown[0], model.joints, 'it has')}"
        )
    bodies: tuple[Body, ...] = TypeAdapter(tuple[Body, ...]).validate_python(with_tuples(bodies_of(model)))
    _refuse_points(bodies, path.name)
    if model.shapes:
        drawn = "1 mesh is" if len(model.shapes) == 1 else f"{len(model.shapes)} meshes are"
        remarks.append(f"{drawn} drawn on the page; only masses and inertias count")
    if model.remarks:
        broken = "1 mesh" if len(model.remarks) == 1 else f"{len(model.remarks)} meshes"
        remarks.append(f"{broken} cannot be drawn: {model.remarks[0]}")
    remarks += [f"joint '{joint}' is locked at 0: {why}" for joint, why in locked.items()]
    remarks += [
        f"joint '{body.joint}' carries {len(behind)} joints ({', '.join(behind)}): a tree; lock what is not moved "
        "(--lock JOINT)"
        for body in bodies
        if len(behind := [other.joint for other in bodies if other.parent == body.joint]) > 1
    ]
    robot, plant, n_springs, told = _texts(path.name, name, model, bodies, locked, motors)
    meshes = {shape.name: shape.file for shape in model.shapes}
    return Draft(robot, plant, (*remarks, *told), robot.count(f": {PLACEHOLDER}"), n_springs, meshes)


def _look(path: Path) -> tuple[dict[str, str], dict[str, UrdfMotor], list[str]]:
    """Return the joints that mimicry locks, motors, and what is passed over; what is no XML is told by the reader."""
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except (OSError, ElementTree.ParseError):
        return {}, {}, []
    mimics = {
        str(joint.get("name")): str(mimic.get("joint"))
        for joint in root.findall("joint")
        if (mimic := joint.find("mimic")) is not None
    }
    names = {str(joint.get("name")) for joint in root.findall("joint")}
    for joint, other in mimics.items():
        if other == joint or other not in names:
            what = "itself" if other == joint else f"'{other}', which is no joint of the file"
            raise ConfigurationError(f"{path.name}: joint '{joint}' mimics {what}; correct its <mimic>")
    moving = {str(j.get("name")) for j in root.findall("joint") if j.get("type") != "fixed"}
    fixed = sum(joint.get("type") == "fixed" for joint in root.findall("joint"))
    what = "1 fixed joint: what it carries" if fixed == 1 else f"{fixed} fixed joints: what they carry"
    remarks = [f"{what} is part of the body before"] if fixed else []
    locked = {j: why for j, why in locked_by_mimicry(mimics).items() if j in moving}
    return locked, urdf_motors(root), remarks


def _refuse_points(bodies: Iterable[Body], file: str) -> None:
    points = [body.joint for body in bodies if body.mass > 0 and not any(map(any, body.inertia))]
    if points:
        raise ConfigurationError(
            f"{file}: what moves with joint '{points[0]}' has a mass and no inertia; give its link an <inertia> about "
            "the centre of mass"
        )


def _texts(
    file: str,
    name: str,
    model: RobotModel,
    bodies: tuple[Body, ...],
    locked: dict[str, str],
    motors: Mapping[str, UrdfMotor],
) -> tuple[str, str, int, list[str]]:
    """Return robot.yaml, plant.yaml, the number of springs, and what was decided about them."""
    lines = [
        f"# Bodies, joints and limits: {file}. What is '{PLACEHOLDER}' the URDF cannot know: data sheets of motor,",
        "# gear and drive do. Springs and sensors are proposals to begin with. `robid doctor robot.yaml` looks for",
        "# implausible values. Where recordings are only read and fitted, the controllers can be deleted.",
        "robid_robot: 1",
        f"name: {key_text(name)}",
        f"model: {key_text(file)}",
    ]
    if locked:
        lines.append(
            "lock:"
            + " " * (_COLUMN - 5)
            + "# joints that stay at a coordinate, rad or m; delete a line to move it"
        )
        lines += [_line(f"  {key_text(joint)}: 0", why) for joint, why in locked.items()]
    lines.append("axes:")
    bearings: list[str] = []
    own = [body.joint for body in bodies if body.elastic is not None]
    told = [f"joint '{joint}' is elastic in the URDF already, and stays so" for joint in own]
    told += ["no further springs are proposed"] if own else []
    gears, springs = False, dict[str, dict[str, FloatArray]]()  # directions by name, of each joint
    for body in (body for body in bodies if body.elastic is None):
        limits = model.limits.get(body.joint, JointLimits())
        carried = carried_inertia(model.chain, body.joint)
        gear = None if own else proposed_gear(carried, body.type == "prismatic", limits.effort)
        if gear is not None and gear.frequency_hz > HIGHEST_HZ:
            told.append(
                f"gear of '{body.joint}': taken as rigid, it would swing at {gear.frequency_hz:.0f} Hz, above the "
                f"{HIGHEST_HZ:g} Hz that fits look at"
            )
        elastic = gear is not None and gear.frequency_hz <= HIGHEST_HZ
        gears |= elastic
        springs[body.joint] = {"gear": np.array(body.axis)} if elastic else {}
        motor = motors.get(body.joint, UrdfMotor())
        lines += _axis(body, limits, motor, gear if elastic else None, carried)
        if gear is None or body.type == "prismatic":
            continue
        across = proposed_bearing(bodies, body.joint, gear)
        if across.frequency_hz > HIGHEST_HZ / 2:
            continue
        directions, left = bearing_directions(model.chain, bodies, body.joint)
        left += without_dependent(directions, springs.get(body.parent or "", {}), springs[body.joint], body)
        told += [f"no bearing '{body.joint}_{why}".replace(": ", "': ", 1) for why in left]
        for letter, direction in directions.items():
            springs[body.joint][letter] = np.array(direction)
            label = f"{body.joint}_{letter}"
            spring = f"stiffness: {across.stiffness:.3g}, damping: {across.damping:.3g}"
            entry = f"  {key_text(label)}: {{joint: {key_text(body.joint)}, axis: {direction}, {spring}}}"
            bearings.append(f"{entry}  # proposed: {across.origin}, {across.frequency_hz:.0f} Hz")
    if bearings:
        lines += [
            "bearings:"
            + " " * (_COLUMN - 9)
            + "# elasticity across the axes; delete what the arm does not have",
            *bearings,
        ]
    heads = {"gear_stiffness": gears, "bearing_stiffness": bool(bearings or own)}
    softer = ", ".join(f'"{head}.*": {_SAMPLE}' for head, there in heads.items() if there)
    plant = [
        "# The simulated machine: robot.yaml with springs a quarter softer, to see whether they are found.",
        "robid_robot: 1",
        f"name: {key_text(f'{name}_plant')}",
        "base: robot.yaml",
        f"factors: {{{softer}}}",
    ]
    n_springs = len(own) + sum(len(directions) for directions in springs.values())
    return "\n".join(lines) + "\n", "\n".join(plant) + "\n", n_springs, told


def _axis(
    body: Body, limits: JointLimits, motor: UrdfMotor, gear: ProposedSpring | None, carried: float
) -> list[str]:
    slides = body.type == "prismatic"
    angle, force = ("m", "N") if slides else ("rad", "N m")
    lines = [f"  {key_text(body.joint)}:"]
    sensing = "proposed; for simulation, planning, and fits of motions that do not repeat"
    if not limits.effort:
        sensing += (
            f"; torque_noise: rms of a sample at the motor, N m, {TORQUE_NOISE:g} * torque_limit is usual"
        )
    if limits.position is None:
        bound = "    position_limits: fill_in" if slides else "    position_limits: [-3.14, 3.14]"
        lines.append(
            _line(
                bound,
                f"[lower, upper], {angle}; none in the URDF" + ("" if slides else ": one turn proposed"),
            )
        )
    else:
        lower, upper = limits.position
        lines.append(f"    # position_limits: those of the URDF, {lower:g} to {upper:g} {angle}")
    ratio, rotor = (
        (PLACEHOLDER, "") if told is None else (f"{told:.9g}", "; that of the URDF")
        for told in (motor.gear_ratio, motor.rotor_inertia)
    )
    lines += [
        _line(
            f"    gear_ratio: {ratio[0]}",
            f"motor turns (rad) per {angle} of the joint, negative where it reverses{ratio[1]}",
        ),
        _line(
            f"    rotor_inertia: {rotor[0]}",
            f"rotor, brake and gear input at the motor shaft, kg m^2{rotor[1]}",
        ),
        _line(
            f"    torque_constant: {PLACEHOLDER}", "N m/A, motor data sheet; 1 where the drive reports torque"
        ),
    ]
    for key, value, unit in (
        ("torque_limit", limits.effort, force),
        ("speed_limit", limits.speed, f"{angle}/s"),
    ):
        if value is None:
            lines.append(
                _line(
                    f"    {key}: {PLACEHOLDER}",
                    f"at the motor, {'N m' if unit == force else 'rad/s'}; none in the URDF",
                )
            )
        else:
            lines.append(f"    # {key}: that of the URDF through the gear, {value:g} {unit} at the joint")
    if gear is not None:
        spring = f"    gear: {{stiffness: {gear.stiffness:.3g}, damping: {gear.damping:.3g}}}"
        lines.append(
            _line(spring, f"proposed: {gear.origin}; {gear.frequency_hz:.0f} Hz with all that it carries")
        )
    lines += [
        _friction(motor, force, angle),
        _line(f"    sensors: {proposed_sensors(limits.effort)}", sensing),
        _line("    controller:", "speed controller of the drive, at the motor; unknown: begin as said below"),
        _line(
            f"      speed_gain: {PLACEHOLDER}",
            f"N m s/rad; {SPEED_RATE:g} * (rotor_inertia + {carried:.3g} / gear_ratio^2)",
        ),
        _line(
            f"      integral_gain: {PLACEHOLDER}",
            f"N m/rad; {INTEGRAL_RATE:g} * speed_gain; with 0 angles drift",
        ),
    ]
    return lines


def _friction(motor: UrdfMotor, force: str, angle: str) -> str:
    """Friction at the motor, which a URDF tells at the joint."""
    comment = "at the motor, N m and N m s/rad; fit.friction finds it"
    coulomb, viscous = motor.at_motor or (0.0, 0.0)
    if motor.friction or motor.damping:
        told = f"{motor.friction:.3g} {force} and {motor.damping:.3g} {force} s/{angle} at the joint"
        comment += f"; the URDF has {told}"
    return _line(f"    friction: {{coulomb: {coulomb:.6g}, viscous: {viscous:.6g}}}", comment)


def _line(text: str, comment: str) -> str:
    return f"{text:{_COLUMN - 1}} # {comment}"
