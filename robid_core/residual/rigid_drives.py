"""The nominal robot as a rigid one: what motions are planned with, and what recordings are held against first."""

from __future__ import annotations

from dataclasses import replace

from robid_core.estimation.rigid.rigid_torque import RigidDrives
from robid_core.robot import Robot


def rigid_drives(robot: Robot) -> RigidDrives:
    """Bodies on their own joints, structure effects (payloads, counterweights) included, with the motors.

    Bearings, gears and links are stiff, and effects beside the motors' friction are left out.
    """
    bodies = tuple(body.model_copy(update={"flexible": None}) for body in robot.structure.bodies)
    changes = {"bearings": {}, "bodies": bodies, "effects": {}}
    stiff = replace(robot, description=robot.structure.model_copy(update=changes))
    d = stiff.drives
    return RigidDrives(
        tree=stiff.chain,
        arm=stiff.mechanism.arm,
        gear=d.gear,
        rotor_inertia=d.rotor_inertia,
        viscous=d.viscous,
        coulomb=d.coulomb,
        offset=d.friction_offset,
        friction_speed=d.friction_speed,
    )
