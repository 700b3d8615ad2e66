"""Records that do not fit into the machine's memory: found from the settings, before anything is measured."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping

from robid_core.artifacts import Record
from robid_core.pipeline.planned_motion import planned_motion
from robid_core.pipeline.resolving import Declared
from robid_core.pipeline.wiring import Wires, each
from robid_core.robot import Robot
from robid_core.yaml_file.problems import ProblemList

CHANNELS = 3  # of a record at least: positions, torques, references
BYTES = 8.0  # of a number


def check_memory(
    declared: Mapping[str, Declared], wires: Wires, load: Callable[[], Robot], problems: ProblemList
) -> None:
    """Tell which stages measure more than this machine can hold.

    Parameters
    ----------
    declared
        The stages by name.
    wires
        What feeds each of them, by parameter.
    load
        Gives the nominal robot; not called where nothing is measured.
    problems
        Takes the mistakes.
    """
    there = float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    for name, entry in declared.items():
        if entry.stage is None or entry.output is None or not issubclass(entry.output, Record):
            continue
        sources = {one: declared[one].stage for named in wires.get(name, {}).values() for one in each(named)}
        upstream = {one: stage for one, stage in sources.items() if stage is not None}
        robot = load()
        motion = planned_motion(entry.stage, upstream, robot.n_axis)
        if motion is None:
            continue
        n_sample = motion.n_experiment * motion.n_recorded * motion.period_s / robot.sample_time_s
        needed = CHANNELS * BYTES * n_sample * robot.n_axis
        if needed > there:
            problems.add(
                entry.node.keys["use"],
                ("stages", name, "use"),
                f"the record takes {needed / 1e9:.3g} GB ({motion}), more than the {there / 1e9:.3g} GB of this "
                "machine; ask for fewer configurations, blocks or periods, or for a shorter period",
            )
