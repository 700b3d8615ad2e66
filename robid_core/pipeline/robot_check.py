"""Settings of stages and drives against the robot: patterns of parameters, axes, whatever only the robot knows.

What is checked is the nominal robot, also for a stage that is given another one when the pipeline runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from robid_core.drives import Drives
from robid_core.errors import RobidError
from robid_core.pipeline.resolving import Declared
from robid_core.robot import Robot
from robid_core.robot.file.document import line_of
from robid_core.robot.plausibility import impossibilities
from robid_core.stage import Stage
from robid_core.yaml_file.nodes import Node
from robid_core.yaml_file.problems import Mark, ProblemList


def check_against_robot(
    declared: Iterable[Declared],
    load: Callable[[], Robot],
    mark: Mark,
    problems: ProblemList,
    file: Path | None = None,
    moves: bool = False,
    data_root: Path | None = None,
) -> None:
    """Ask each stage that looks at the robot what is wrong, and tell it where the setting stands.

    A robot that cannot be is told instead: what stages would say of it follows from that.

    Parameters
    ----------
    declared
        The stages as far as they could be understood.
    load
        Gives the nominal robot; not called where no stage asks for it.
    mark
        Where the robot stands in the file.
    problems
        Takes the mistakes.
    file
        The robot's, for the places of numbers that cannot be; None where it was made in memory.
    moves
        Whether the pipeline has drives, which must then hold the robot.
    data_root
        Where measured data are; None: they are not looked at.
    """
    asking = [d for d in declared if d.stage and _asks(d.stage)]
    if not asking:
        return
    try:
        robot = load()
        wrong = list(impossibilities(robot, moves))
    except RobidError as error:
        problems.add(mark, ("robot",), " ".join(str(error).split()))
        return
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        what = f"its numbers are too large or too small to be computed with ({type(error).__name__}: {error})"
        problems.add(mark, ("robot",), f"{what}; see robid doctor")
        return
    for remark in wrong:
        place = "" if file is None else f"{line_of(file, remark.key)}: "
        problems.add(mark, ("robot",), f"{place}{remark.where}: {remark.what}")
    for entry in asking if not wrong else ():
        _check(entry, robot, problems, data_root)


def check_drives_against_robot(
    drives: Drives, node: Node, load: Callable[[], Robot], problems: ProblemList
) -> None:
    """Ask drives what of their settings does not go with the robot, and tell it where the setting stands.

    Parameters
    ----------
    drives
        With their settings checked.
    node
        What the file says under `drives`.
    load
        Gives the nominal robot.
    problems
        Takes the mistakes.
    """
    if type(drives).problems_with is Drives.problems_with:
        return
    try:
        wrong = dict(drives.problems_with(load()))
    except RobidError as error:
        wrong = {(): " ".join(str(error).split())}
    for place, message in wrong.items():
        found, mark = node.at(("with", *place))
        problems.add(mark if found else node.mark, ("drives", "with", *place), message)


def _asks(stage: Stage) -> bool:
    """Whether a stage looks at the robot at all before it runs: a robot that cannot be is refused for it then."""
    kind = type(stage)
    return any(
        getattr(kind, name) is not getattr(Stage, name)
        for name in ("problems_with", "problems_with_files", "needs_of_axes")
    )


def _check(entry: Declared, robot: Robot, problems: ProblemList, data_root: Path | None) -> None:
    assert entry.stage is not None
    path = ("stages", entry.name)
    try:
        wrong = dict(entry.stage.problems_with(robot))
        if not wrong and data_root is not None:
            wrong = dict(entry.stage.problems_with_files(robot, data_root))
        missing = robot.left_out(entry.stage.needs_of_axes())
    except Exception as error:  # a stranger's code: no reason to say nothing about the other stages
        what = str(error) if isinstance(error, RobidError) else f"{type(error).__name__}: {error}"
        problems.add(entry.mark, path, f"{entry.plugin} cannot be used with {robot.name}: {what}")
        return
    for place, message in wrong.items():
        found, mark = entry.node.at(("with", *place))
        problems.add(mark if found else entry.mark, (*path, "with", *place), message)
    if missing:
        problems.add(entry.mark, path, f"{entry.plugin} needs more of the robot: {missing}")
