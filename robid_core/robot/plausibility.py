"""Numbers of a robot that are hard to believe, or cannot be: degrees for radians, a ratio upside down, motors too weak.

Each is told with its place, its size and what to do. Poses are drawn within the position limits, the same every time.
What is only unusual is a remark; with what no robot can have (`impossibilities`) no pipeline runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.robot.file.clock import FOLLOWING, following_time
from robid_core.robot.file.coaxial import coaxial_springs
from robid_core.robot.file.meeting import meeting_springs
from robid_core.robot.remark import Remark
from robid_core.robot.stability import refuse_unstable
from robid_core.robot.suspect_units import in_other_units, sagging

if TYPE_CHECKING:
    from robid_core.robot.robot import Robot

POSES = 64
_TURNS = (2.0, 4.0)  # of a joint with limits: unusual, and none has them
_INERTIA_RATIO = (0.02, 50.0)  # rotor through the gear over arm
_SLOWEST_RATIO = 0.2  # motor turns per joint turn; motors turn faster than joints, or as fast
_NO_INERTIA = 1e-9
_JOINT_SPEED = (0.1, 40.0)  # rad/s
_RESONANCE_HZ = (1.0, 200.0)
_WINDUP_RAD = 3e-5  # of a gear at the motor's torque limit, 0.1 minutes of arc; stiff gears for robots have 1
_HARDLY = 0.9  # of the steps that a file without step_s gets: friction may be a little larger than told
_LONGEST_M = 20.0
_FRICTION_SHARE = 0.3  # of the torque limit
_GRAVITY = (20.0, 30.0)  # m/s^2: of no place where robots stand, and of no planet that one could stand on
_MOTOR_SPEED = 1500.0  # rad/s: 14 000 turns a minute
_ROTOR_ACCELERATION = 1.0e6  # rad/s^2, of the rotor alone; servo motors have up to 2e5
_CURRENT_A = (0.01, 2000.0)  # at the torque limit
_ANGLE_NOISE = 0.1  # rad at the motor
_INDEPENDENT = 1e-12  # smallest eigenvalue of a mass matrix with ones on its diagonal


def impossibilities(robot: Robot, moves: bool) -> Iterator[Remark]:
    """Yield what no robot can have; what drives cannot do, and no rest, only of one that `moves`."""
    yield from (
        remark for remark in (remarks_on(robot) if moves else _as_written(robot)) if remark.impossible
    )


def refuse_weightless(robot: Robot) -> None:
    """Raise ConfigurationError where a spring has nothing behind it: no linear model has it."""
    for remark in _weightless(robot, drawn_poses(robot)):
        raise ConfigurationError(f"{robot.name}: {remark.sentence}")


def _as_written(robot: Robot) -> Iterator[Remark]:
    """Yield what single numbers say."""
    yield from _surroundings(robot)
    yield from _bodies(robot)
    yield from _limits(robot)
    yield from _gears(robot)
    yield from _motors(robot)
    yield from in_other_units(robot)


def remarks_on(robot: Robot) -> Iterator[Remark]:
    """Yield what is implausible: geometry, drives, springs on one line, gravity, inertias, resonances, controller."""
    yield from _as_written(robot)
    if missing := robot.left_out(("torque_limit", "speed_limit", "controller")):
        yield Remark("axes", f"{missing}, before anything moves or is simulated")
    for pair in coaxial_springs(robot.description):
        yield Remark(pair.first, pair.sentence)
    for group in meeting_springs(robot.description):
        yield Remark(group.least, group.sentence)
    poses = drawn_poses(robot)
    rest = robot.equilibrium(poses, partial=True)
    stands = np.isfinite(rest.position).all(axis=1)
    if not stands.any():
        yield Remark(
            "axes",
            f"gravity bends the springs over in all of {POSES} poses drawn: {rest.refused[0]}; are stiffnesses in "
            "N m/rad, masses in kg?",
            impossible=True,
        )
        return
    if not stands.all():
        yield Remark(
            "axes",
            f"in {np.sum(~stands)} of {POSES} poses drawn the arm has no stable rest; raise stiffnesses",
        )
    yield from _gravity(robot, rest.torque[stands])
    yield from sagging(robot, rest.joint[stands], poses[stands])
    yield from _inertias(robot, poses[stands])
    weightless = list(_weightless(robot, poses[stands]))
    yield from weightless
    if weightless:
        return
    yield from _resonances(robot, poses[stands])
    yield from _controller(robot, poses[stands][0])
    yield from _friction_steps(robot)


def drawn_poses(robot: Robot) -> FloatArray:
    """Joint-side motor angles within the limits (a turn where there are none), shape (POSES, n_axis)."""
    generator = np.random.default_rng(0)
    lower, upper = (
        np.where(np.isfinite(e), e, s * math.pi)
        for e, s in ((robot.drives.lower, -1), (robot.drives.upper, 1))
    )
    drawn: FloatArray = lower + generator.random((POSES, robot.n_axis)) * (upper - lower)
    return drawn


def _turns(robot: Robot) -> list[bool]:
    """Whether each axis turns."""
    kinds = {body.joint: body.type == "revolute" for body in robot.description.bodies}
    return [kinds[axis.joint or name] for name, axis in robot.description.axes.items()]


def _surroundings(robot: Robot) -> Iterator[Remark]:
    gravity = math.hypot(*robot.description.gravity)
    if gravity > _GRAVITY[0]:
        yield Remark(
            "gravity", f"{gravity:.4g} m/s^2; were mm/s^2 written?", impossible=gravity > _GRAVITY[1]
        )


def _bodies(robot: Robot) -> Iterator[Remark]:
    for index, body in enumerate(robot.description.bodies):
        place = f"bodies[{index}] ({body.joint})"
        if (distance := math.hypot(*body.centre_of_mass)) > _LONGEST_M:
            yield Remark(
                f"{place}.centre_of_mass",
                f"{distance:.4g} m away; were millimetres written?",
                impossible=True,
            )
        length = math.hypot(*body.translation)
        if length > _LONGEST_M:
            yield Remark(
                f"{place}.translation", f"{length:.4g} m long; were millimetres written?", impossible=True
            )
        if body.mass == 0:
            continue
        moments = np.linalg.eigvalsh(np.array(body.inertia))
        radius = math.sqrt(abs(moments[-1]) / body.mass)
        if radius > _LONGEST_M:
            yield Remark(
                f"{place}.inertia",
                f"{moments[-1]:.3g} kg m^2 at {body.mass:g} kg is a radius of gyration of {radius:.3g} m; kg mm^2?",
                impossible=True,
            )
        elif moments[-1] == 0 and body.type == "revolute" and body.flexible is None:
            yield Remark(
                f"{place}.inertia",
                f"{body.mass:g} kg in one point; give its inertia about the centre of mass",
            )


def _limits(robot: Robot) -> Iterator[Remark]:
    for (name, axis), turns in zip(robot.description.axes.items(), _turns(robot), strict=True):
        if axis.position_limits is None or not turns:
            continue
        largest = max(map(abs, axis.position_limits))
        if largest > 2 * math.pi * _TURNS[0]:
            yield Remark(
                f"axes.{name}.position_limits",
                f"{largest:g} rad are {largest / (2 * math.pi):.3g} turns; degrees? {largest:g} deg would be "
                f"{math.radians(largest):.4g} rad; an axis that turns on and on has none",
                impossible=largest > 2 * math.pi * _TURNS[1],
            )


def _gears(robot: Robot) -> Iterator[Remark]:
    coupled = robot.description.coupling is not None
    for (name, axis), turns in zip(robot.description.axes.items(), _turns(robot), strict=True):
        ratio = abs(axis.gear_ratio)
        if turns and ratio < 1 and not coupled:
            yield Remark(
                f"axes.{name}.gear_ratio",
                f"{axis.gear_ratio:g}: the joint turns faster than its motor; motor turns per joint turn are wanted, "
                f"{1 / axis.gear_ratio:.4g}?",
                impossible=ratio < _SLOWEST_RATIO,
            )
        if turns and not coupled and axis.speed_limit is not None:
            speed = axis.speed_limit / ratio
            if not _JOINT_SPEED[0] <= speed <= _JOINT_SPEED[1]:
                yield Remark(
                    f"axes.{name}.speed_limit",
                    f"{axis.speed_limit:g} rad/s are {speed:.3g} rad/s at the joint; is it at the motor, and in rad/s, "
                    "not turns a minute?",
                )
        if turns and axis.speed_limit is not None and axis.speed_limit > _MOTOR_SPEED:
            yield Remark(
                f"axes.{name}.speed_limit",
                f"{axis.speed_limit:g} rad/s are {axis.speed_limit * 30 / math.pi:.4g} turns a minute of the motor; "
                "were turns a minute written?",
            )
        stiff = None if axis.gear is None else axis.gear.stiffness
        windup = ratio * (axis.torque_limit or math.inf) / stiff if turns and stiff else math.inf
        if windup < _WINDUP_RAD:
            yield Remark(
                f"axes.{name}.gear.stiffness",
                f"{stiff:.3g} N m/rad: the motor's torque limit winds the gear up by {windup:.2g} rad, hundreds "
                "of times less than gears of robots; N m/rad at the joint? Left out, the gear is rigid",
            )
        rubbing = axis.friction.coulomb / (axis.torque_limit or math.inf)
        if rubbing > _FRICTION_SHARE:
            yield Remark(
                f"axes.{name}.friction.coulomb",
                f"{axis.friction.coulomb:g} N m is {100 * rubbing:.3g} % of the torque limit {axis.torque_limit:g} "
                "N m; is it at the motor?",
                impossible=rubbing >= 1,
            )


def _motors(robot: Robot) -> Iterator[Remark]:
    for name, axis in robot.description.axes.items():
        place, sensors = f"axes.{name}", axis.sensors
        if sensors.position_noise > _ANGLE_NOISE:
            yield Remark(
                f"{place}.sensors.position_noise",
                f"{sensors.position_noise:g} rad ({math.degrees(sensors.position_noise):.3g} degrees) in every sample; "
                "is it in rad at the motor?",
            )
        if axis.torque_limit is None:
            continue
        if sensors.torque_noise > axis.torque_limit:
            yield Remark(
                f"{place}.sensors.torque_noise",
                f"{sensors.torque_noise:g} N m is more than the torque limit {axis.torque_limit:g} N m",
                impossible=True,
            )
        current = axis.torque_limit / axis.torque_constant
        if not _CURRENT_A[0] <= current <= _CURRENT_A[1]:
            yield Remark(
                f"{place}.torque_constant",
                f"{axis.torque_constant:g} N m/A makes the torque limit {axis.torque_limit:g} N m a current of "
                f"{current:.3g} A; N m/A, not mN m/A?",
            )
        if axis.torque_limit / axis.rotor_inertia > _ROTOR_ACCELERATION:
            yield Remark(
                f"{place}.torque_limit",
                f"{axis.torque_limit:g} N m accelerate the rotor alone ({axis.rotor_inertia:g} kg m^2) by "
                f"{axis.torque_limit / axis.rotor_inertia:.3g} rad/s^2; is the torque at the motor, in N m?",
            )
        braking = axis.friction.viscous * (axis.speed_limit or 0.0)
        if braking > axis.torque_limit:
            yield Remark(
                f"{place}.friction.viscous",
                f"at the speed limit friction takes {braking:.4g} N m, more than the torque limit "
                f"{axis.torque_limit:g} N m; N m s/rad at the motor?",
            )


def _gravity(robot: Robot, torque: FloatArray) -> Iterator[Remark]:
    loads = [
        f"{label} ({entry.with_['mass']:g} kg)"
        for label, entry in robot.description.effects.items()
        if entry.use == "load.payload" and "mass" in entry.with_
    ]
    counted = f", the payload {' and '.join(loads)} among what it bears" if loads else ""
    share = np.abs(torque) / robot.drives.torque_limit_or(np.full(robot.n_axis, np.inf))
    for name, column, torques in zip(robot.axis_names, share.T, torque.T, strict=True):
        worst = int(np.argmax(column))
        if column[worst] <= 1:
            continue
        over = float(np.mean(column > 1))
        yield Remark(
            f"axes.{name}.torque_limit",
            f"gravity asks for {abs(torques[worst]):.4g} N m of the motor, {column[worst]:.3g} times the limit, and "
            f"for more than it in {over:.0%} of the poses{counted}; torque and ratio at the motor?",
            impossible=over > 0.5,
        )


def _inertias(robot: Robot, poses: FloatArray) -> Iterator[Remark]:
    from robid_core.mechanics import dynamics

    gear = np.linalg.inv(robot.drives.gear)
    reflected = np.diag(gear.T @ np.diag(robot.drives.rotor_inertia) @ gear)
    position = np.zeros((len(poses), robot.chain.n_coordinate))
    position[:, robot.mechanism.arm] = poses
    mass = dynamics(robot.chain, position).mass[:, robot.mechanism.arm, robot.mechanism.arm]
    for name, rotor, arm in zip(robot.axis_names, reflected, np.median(mass, axis=0), strict=True):
        if arm < _NO_INERTIA:
            continue  # told by what is weightless
        ratio = rotor / arm
        if not _INERTIA_RATIO[0] <= ratio <= _INERTIA_RATIO[1]:
            more = "less" if ratio < 1 else "more"
            yield Remark(
                f"axes.{name}.rotor_inertia",
                f"through the gear the rotor is {rotor:.3g}, the arm at this axis {arm:.3g} (kg m^2, or kg): much "
                f"{more}; rotor_inertia at the motor shaft in kg m^2 (1 kg cm^2 = 1e-4), and gear_ratio?",
            )


def _weightless(robot: Robot, poses: FloatArray) -> Iterator[Remark]:
    """A spring with nothing behind it swings infinitely fast: no linear model has it."""
    behind = slice(robot.n_axis, None)
    mass = robot.second_order(poses).mass[:, behind, behind]
    names = robot.mechanism.coordinate_names[robot.n_axis :]
    own = np.diagonal(mass, axis1=1, axis2=2)
    nothing = {int(column) for column in np.flatnonzero((own <= 0).any(axis=0))}
    if not nothing and len(names):
        root = np.sqrt(own)
        value, vector = np.linalg.eigh(mass / root[:, :, None] / root[:, None, :])
        worst = int(np.argmin(value[:, 0]))
        if value[worst, 0] < _INDEPENDENT:
            nothing = {int(np.argmax(abs(vector[worst, :, 0])))}
    for column in sorted(nothing):
        yield Remark(
            "bodies",
            f"nothing that '{names[column]}' moves behind its spring has a mass or an inertia about it; give mass, "
            "centre_of_mass and inertia of the bodies it carries",
            impossible=True,
        )


def _resonances(robot: Robot, poses: FloatArray) -> Iterator[Remark]:
    behind = slice(robot.n_axis, None)
    model = robot.second_order(poses)
    if model.mass.shape[-1] == robot.n_axis:
        yield Remark("axes", "nothing is elastic: no gear, no bearing; give gear: {stiffness, damping}")
        return
    lowest = np.array(
        [
            math.sqrt(max(float(eigh(k[behind, behind], m[behind, behind], eigvals_only=True)[0]), 0.0))
            for k, m in zip(model.stiffness, model.mass, strict=True)
        ]
    ) / (2 * math.pi)
    low, high = float(lowest.min()), float(lowest.max())
    if high < _RESONANCE_HZ[0] or low > _RESONANCE_HZ[1]:
        advice = (
            "stiffness in N m/rad, not N m per minute of arc?"
            if high < 1
            else "too stiff to be seen by motors"
        )
        yield Remark(
            "axes", f"the first resonance, motors held, lies at {low:.3g} to {high:.3g} Hz; {advice}"
        )


def _controller(robot: Robot, pose: FloatArray) -> Iterator[Remark]:
    if robot.left_out(("controller",)):
        return
    try:
        refuse_unstable(robot, pose, robot.step_s, "implicit_midpoint")
    except ConfigurationError as error:
        yield Remark("axes", str(error).removeprefix(f"{robot.name}: "), impossible=True)


def _friction_steps(robot: Robot) -> Iterator[Remark]:
    times = {name: following_time(axis.model_dump()) for name, axis in robot.description.axes.items()}
    fastest = min(times, key=lambda name: times[name])
    if times[fastest] < _HARDLY * FOLLOWING * robot.step_s:
        yield Remark(
            "step_s",
            f"the motor of {fastest} follows its friction in {1e3 * times[fastest]:.2g} ms (rotor_inertia times "
            f"friction: speed over coulomb), which steps of {1e3 * robot.step_s:.3g} ms do not resolve: what is "
            "simulated has another friction than this file; give shorter steps, or a larger friction: speed",
        )
