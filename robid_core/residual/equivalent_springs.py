"""Springs beside nonlinear ones, so that both together are as stiff as the linear springs that fit the data best.

A linear model finds the stiffness that a nonlinear spring has on average along the motion. With the law beside it the
spring would count twice: the arm would ring elsewhere, and passes that begin there hardly come back. Along the motion
of the linear model a law is, in the least squares, a spring and a damper (statistical linearization: A. Gelb, W. E.
Vander Velde, Multiple-input describing functions, 1968, chapter 7), by which those of the robot begin smaller or
larger.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.residual.motor_laws import motion_between
from robid_core.residual.problem import TorqueProblem
from robid_core.robot import Robot
from robid_core.robot.forces_along import ForceAlong, RobotMotion, forces_along

ROUNDS = 10  # a law may depend on the spring that it stands beside
FINER = 2  # points a sample
FARTHEST = 5.0  # times as stiff as the linear spring, or as soft
LITTLE = 0.1  # of a spring: passes find the way over so little by themselves


def with_equivalent_springs(problem: TorqueProblem, point: FloatArray, labels: Collection[str]) -> FloatArray:
    """Return unknowns with which springs and laws together are what the springs alone are at a point, (n_unknown,).

    Parameters
    ----------
    problem
        Whose robots have the laws.
    point
        All unknowns, (n_unknown,): springs and dampers as they fit without the laws, the laws as they begin.
    labels
        Of the laws. What acts along no elastic gear or bearing, or sees anything else, changes nothing.
    """
    free, both = problem.free, problem.robots(point)
    alone = [robot.without_effect(*(set(labels) & set(robot.description.effects))) for robot in both]
    if [one.mechanism.n_coordinate for one in alone] != [one.mechanism.n_coordinate for one in both]:
        return point  # they change where the robot is elastic
    motions = [
        motion_between(block.motion, block.coordinates(robot), FINER)
        for block, robot in zip(problem.blocks, alone, strict=True)
    ]
    found, farthest = point.copy(), np.log(FARTHEST)
    names, lower, upper = list(free.names), free.lower, free.upper
    for _ in range(ROUNDS):
        robots = problem.robots(found)
        for name, share in springs_and_laws(robots, alone, motions, labels).items():
            if name in names:
                i = names.index(name)
                away = found[i] - point[i] - np.log(np.maximum(share, 1 / FARTHEST))
                found[i] = np.clip(point[i] + np.clip(away, -farthest, farthest), lower[i], upper[i])
    stiffer = [found[i] - point[i] for i, name in enumerate(names) if "_stiffness." in name]
    return found if np.abs(stiffer).max(initial=0.0) > LITTLE else point


def laws_of_springs(robot: Robot) -> tuple[str, ...]:
    """Labels of the effects that act along elastic gears and bearings and see nothing but how these are bent."""
    rows = robot.mechanism.spring_directions
    found = (
        term.label
        for term in robot.forces
        if np.array_equal(term.direction, term.coordinate) and (rows == term.direction).all(axis=1).any()
    )
    return tuple(dict.fromkeys(found))


def springs_and_laws(
    robots: list[Robot], alone: list[Robot], motions: list[RobotMotion], labels: Collection[str]
) -> dict[str, float]:
    """Stiffness and damping of springs and laws together over those of the springs alone, by name of the parameter."""
    laws: dict[int, list[ForceAlong]] = {}
    for robot, motion in zip(robots, motions, strict=True):
        for law in forces_along(robot, motion, labels).forces:
            for number, row in enumerate(robot.mechanism.spring_directions):
                same = np.array_equal(law.term.direction, row) and np.array_equal(law.term.coordinate, row)
                if same and law.term.label in labels:
                    laws.setdefault(number, []).append(law)
    found = {}
    (stiffness, damping), before = robots[0].spring_arrays(), alone[0].spring_arrays()
    for number, own in laws.items():
        seen = np.concatenate([np.stack((law.position.ravel(), law.velocity.ravel())) for law in own], axis=1)
        force = np.concatenate([law.run.force.ravel() for law in own])
        columns = np.vstack((seen, np.ones_like(force))).T
        of_law = np.linalg.lstsq(columns, force, rcond=None)[0]
        name = robots[0].spring_names[number]
        for kind, one, linear, more in zip(
            (name, name.replace("stiffness", "damping", 1)),
            (stiffness[number], damping[number]),
            (before[0][number], before[1][number]),
            of_law,
            strict=False,
        ):
            if linear > 0:
                found[kind] = float((one + more) / linear)
    return found
