"""Numbers of a robot whose size another unit would explain: gravity in g, torque constants in mN m/A, loads in grams.

Each may be meant, so that all are remarks. What no robot can have stands in `plausibility`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.robot.remark import Remark

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

_EARTH = (9.5, 10.1)  # m/s^2; 9.76 to 9.84 from the equator to the poles, rounded to 10 by some
_IN_G = (0.9, 1.1)
_SLOWEST_S = 0.1  # of a drive
_TORQUE_CONSTANT = 20.0  # N m/A, of a motor with a gear; large direct drives have more
_NOISE_SHARE = 0.1  # of the torque limit
_COUNTS = 100  # per turn of the motor
_BITS = (8, 32)  # of an encoder's turn
_RIPPLE_SHARE = 0.5  # of the torque limit
_GYRATION_M = 5.0
_GYRATION_LENGTHS = (2.0, 10.0)  # m, and times the longest link: a turntable has neither link nor arm
_CHAIN = 4  # bodies with mass, from which on joints that lie close together are no gimbal or pan-tilt head
_WIDE = (
    0.5  # radius of gyration, or distance of centres of mass from their joints, over the length of the chain
)
_DENSE = 2000.0  # kg/m^3, mass over the cube of that length
# The packaged arms, KR 300, TX40 and UR5 have 0.08 to 0.19 of the first and 12 to 250 kg/m^3; translations that are ten
# times too short make that 0.8 to 1.9, and 12000 and more.
_PAYLOAD_SHARE = 3.0  # of the mass of all bodies
_SAG_RAD = 0.1
_WAVES = {"drive.torque_ripple": "amplitude", "drive.cogging": "amplitude"}
_COULOMB = "friction.coulomb"


def in_other_units(robot: Robot) -> Iterator[Remark]:
    """Yield what single numbers say."""
    yield from _gravity(robot)
    yield from _clock(robot)
    yield from _inertias(robot)
    yield from _lengths(robot)
    yield from _motors(robot)
    yield from _effects(robot)


def sagging(robot: Robot, joint: FloatArray, poses: FloatArray) -> Iterator[Remark]:
    """Yield gears that gravity bends by an angle that one would see.

    Parameters
    ----------
    joint
        Coordinates of the joints at rest, shape (n_pose, n_joint).
    poses
        Angles of the motors, joint side, shape (n_pose, n_axis).
    """
    bent = np.abs(joint[:, robot.mechanism.arm] - poses).max(axis=0)
    kinds = {body.joint: body.type for body in robot.description.bodies}
    for (name, axis), most in zip(robot.description.axes.items(), bent, strict=True):
        if axis.gear is None or kinds[axis.joint or name] != "revolute" or most <= _SAG_RAD:
            continue
        yield Remark(
            f"axes.{name}.gear.stiffness",
            f"gravity bends the gear by up to {most:.3g} rad ({math.degrees(most):.3g} degrees); N m/rad, not N m per "
            "degree or per minute of arc?",
        )


def _gravity(robot: Robot) -> Iterator[Remark]:
    size = math.hypot(*robot.description.gravity)
    if size == 0:
        return
    if _IN_G[0] <= size <= _IN_G[1]:
        yield Remark(
            "gravity",
            f"{size:.4g} m/s^2, and {9.81 * size:.4g} on earth; in multiples of g? m/s^2 are wanted",
        )
    elif not _EARTH[0] <= size <= _EARTH[1] and size <= 2 * _EARTH[1]:  # more is told already
        yield Remark("gravity", f"{size:.4g} m/s^2, where the earth has 9.81; is it meant?")
    if robot.description.gravity[2] > 0.9 * size and _height(robot) > 0:
        yield Remark(
            "gravity",
            "it points up along z of the base, and the arm stands up along z: it hangs from a ceiling; where it stands "
            "on a floor gravity is [0, 0, -9.81], which is also what it is where it is left out",
        )


def _clock(robot: Robot) -> Iterator[Remark]:
    step = robot.sample_time_s
    if step > _SLOWEST_S:
        yield Remark(
            "sample_time_s",
            f"{step:g} s from sample to sample; ms? {step:g} ms are {step / 1000:g} s, and no drive is so slow",
        )


def _height(robot: Robot) -> float:
    """Height of the centre of mass over the base where all joints are at zero, times the mass."""
    turn: dict[str | None, FloatArray] = {None: np.eye(3)}
    origin: dict[str | None, FloatArray] = {None: np.zeros(3)}
    moment = 0.0
    for body in robot.description.bodies:
        if body.parent not in turn:  # bodies may stand in any order
            return 0.0
        origin[body.joint] = origin[body.parent] + turn[body.parent] @ np.array(body.translation)
        turn[body.joint] = turn[body.parent] @ np.array(body.rotation)
        centre = origin[body.joint] + turn[body.joint] @ np.array(body.centre_of_mass)
        moment += body.mass * float(centre[2])
    return moment


def _inertias(robot: Robot) -> Iterator[Remark]:
    bodies = robot.description.bodies
    longest = max(max(math.hypot(*body.translation), math.hypot(*body.centre_of_mass)) for body in bodies)
    bound = min(_GYRATION_M, max(_GYRATION_LENGTHS[0], _GYRATION_LENGTHS[1] * longest))
    for index, body in enumerate(bodies):
        if body.mass == 0:
            continue
        moment = float(np.linalg.eigvalsh(np.array(body.inertia))[-1])
        radius = math.sqrt(abs(moment) / body.mass)
        if bound < radius <= 4 * _GYRATION_M:  # more is told already
            yield Remark(
                f"bodies[{index}] ({body.joint}).inertia",
                f"{moment:.3g} kg m^2 at {body.mass:g} kg is a radius of gyration of {radius:.3g} m, and the longest "
                f"link has {longest:.3g} m; kg cm^2?",
            )


def _lengths(robot: Robot) -> Iterator[Remark]:
    """Hold the distances between joints against the bodies that are between them: arms are longer than wide."""
    bodies = robot.description.bodies
    heavy = [body for body in bodies if body.mass > 0]
    links = [(math.hypot(*body.translation), index) for index, body in enumerate(bodies) if body.parent]
    length, mass = sum(one for one, _ in links), sum(body.mass for body in heavy)
    if len(heavy) < _CHAIN or length == 0 or sum(body.type == "prismatic" for body in bodies) > 1:
        return
    moment = sum(float(np.trace(np.array(body.inertia))) / 2 for body in heavy)
    gyration = math.sqrt(abs(moment) / mass)
    centre = sum(body.mass * math.hypot(*body.centre_of_mass) for body in heavy) / mass
    if max(gyration, centre) > _WIDE * length:
        seen = f"radii of gyration of {gyration:.3g} m and centres of mass {centre:.3g} m from their joints, on average"
    elif mass > _DENSE * length**3:
        seen = f"a mass of {mass:.3g} kg, as of a cube of metal of that size"
    else:
        return
    index = max(links)[1]
    yield Remark(
        f"bodies[{index}] ({bodies[index].joint}).translation",
        f"from the first joint to the last the translations add up to {length:.3g} m, beside {seen}; "
        "ten times too short? m are wanted",
    )


def _motors(robot: Robot) -> Iterator[Remark]:
    kinds = {body.joint: body.type for body in robot.description.bodies}
    for name, axis in robot.description.axes.items():
        place, limit = f"axes.{name}", axis.torque_limit
        geared = kinds[axis.joint or name] == "revolute" and abs(axis.gear_ratio) != 1
        if geared and axis.torque_constant > _TORQUE_CONSTANT:
            yield Remark(
                f"{place}.torque_constant",
                f"{axis.torque_constant:g} N m/A, where motors behind gears have 0.01 to 5; mN m/A? That would be "
                f"{axis.torque_constant / 1000:g}",
            )
        noise = axis.sensors.torque_noise
        if limit is not None and _NOISE_SHARE * limit < noise <= limit:  # more is told already
            yield Remark(
                f"{place}.sensors.torque_noise",
                f"{noise:g} N m in every sample are {100 * noise / limit:.3g} % of the torque limit {limit:g} N m; rms "
                "at standstill in N m at the motor, not per cent or counts?",
            )
        counts = axis.sensors.encoder_counts
        if 0 < counts < _COUNTS:
            bits = f"; bits? {counts:g} bits are {2.0**counts:.10g}" if _BITS[0] <= counts <= _BITS[1] else ""
            yield Remark(
                f"{place}.sensors.encoder_counts",
                f"{counts:g} counts are a turn of the motor, {360 / counts:.3g} degrees each{bits}; 0: no steps",
            )


def _effects(robot: Robot) -> Iterator[Remark]:
    axes, whole = robot.description.axes, sum(body.mass for body in robot.description.bodies)
    for label, entry in robot.description.effects.items():
        place, axis = f"effects.{label}", axes.get(entry.on or "")
        size = abs(entry.with_.get(_WAVES.get(entry.use, ""), 0.0))
        if axis is not None and axis.torque_limit is not None and size >= _RIPPLE_SHARE * axis.torque_limit:
            yield Remark(
                f"{place}.with.amplitude",
                f"{size:g} N m are {100 * size / axis.torque_limit:.3g} % of the torque limit {axis.torque_limit:g} "
                "N m of the motor; N m at the motor, not per cent or N m at the joint?",
            )
        at_motor = entry.use.startswith(_COULOMB) and entry.side in (None, "motor")
        if axis is not None and at_motor and axis.friction.coulomb > 0:
            yield Remark(
                place,
                f"Coulomb friction of {entry.on} is stated twice and acts twice: by {entry.use}, and by "
                f"axes.{entry.on}.friction (coulomb: {axis.friction.coulomb:g}); set one of them to 0",
            )
        mass = entry.with_.get("mass", 0.0)
        if entry.use == "load.payload" and mass > _PAYLOAD_SHARE * whole:
            yield Remark(
                f"{place}.with.mass",
                f"a payload of {mass:g} kg on an arm of {whole:g} kg; grams? {mass:g} g are {mass / 1000:g} kg",
            )
