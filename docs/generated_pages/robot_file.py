"""The page of keys of a robot file, from the models that read it."""

from __future__ import annotations

import inspect

from pydantic import BaseModel

from generated_pages.docstrings import prose
from generated_pages.text import escaped, heading, literal, table
from robid_core.commands.stages import setting_rows
from robid_core.robot.file import axis, body, data_sheet, denavit_hartenberg, description, reading
from robid_core.robot.file.part import LARGEST

PARTS: tuple[tuple[str, str, type[BaseModel]], ...] = (
    ("The whole file", "", description.RobotDescription),
    ("A file that changes another robot", "", reading.DerivedRobot),
    ("``bodies``", "A list, parents before children.", body.Body),
    ("``bodies[].elastic``, ``axes.NAME.gear``", "", axis.Spring),
    ("``bodies[].flexible``", "", body.FlexibleLink),
    ("``bodies[].flexible.reduced``", "Written by robid.", body.ReducedLink),
    ("``bodies[].flexible.reduced.modes``", "Written by robid.", body.LinkMode),
    (
        "``dh``",
        "In place of ``bodies``: a Denavit-Hartenberg table.",
        denavit_hartenberg.DenavitHartenbergTable,
    ),
    ("``dh.links``", "", denavit_hartenberg.LinkRow),
    ("``dh.base``", "", denavit_hartenberg.Placement),
    ("``axes``", "By name, in the order of the motors.", axis.Axis),
    ("``axes.NAME.gear.data_sheet``", "In place of stiffness and damping.", data_sheet.GearSheet),
    (
        "``axes.NAME.bearing``",
        "A data sheet, in place of entries under ``bearings``.",
        data_sheet.BearingSheet,
    ),
    ("``axes.NAME.friction``", "", axis.Friction),
    ("``axes.NAME.sensors``", "", axis.Sensors),
    ("``axes.NAME.sensors.inertial``", "", axis.InertialSensorEntry),
    ("``axes.NAME.controller``", "", axis.ControllerEntry),
    ("``axes.NAME.servo``", "In place of a controller.", axis.VoltageServo),
    ("``bearings``", "By name.", description.Bearing),
    ("``effects``", "By label. The effects are listed in :doc:`effects/index`.", description.EffectEntry),
)


def pages() -> dict[str, str]:
    """Return the text of the page by its path."""
    lines = heading("Keys of a robot file")
    lines += [
        "Every key that a ``robot.yaml`` may have, written from the models that read it. The bodies stand in the file",
        "itself (``bodies``), in a Denavit-Hartenberg table (``dh``), in a URDF file (``model: robot.urdf``, a path",
        "relative to the robot file), or in another robot file (``base``). :doc:`/your_own_robot` has examples.",
        "",
    ]
    for title, note, model in PARTS:
        lines += heading(title, "-")
        lines += [prose(inspect.getdoc(model) or ""), ""]
        lines += [note, ""] if note else []
        rows = [
            (
                literal(key),
                escaped(_without_widest(kind)),
                "**required**" if default == "required" else literal(_short(default)),
                escaped(said),
            )
            for key, kind, default, said in setting_rows(model)
        ]
        lines += table(("key", "type", "default", "meaning"), rows, "22 20 16 42")
    return {"robot_file.rst": "\n".join(lines)}


def _short(default: str) -> str:
    """Return a default as it fits into a cell: that of a whole part is its own table's."""
    return "see below" if default.startswith("{") and len(default) > 2 else default


def _without_widest(kind: str) -> str:
    """Leave out of a type the limits beyond which no number means anything."""
    return kind.replace(f" >= {-LARGEST:g}", "").replace(f" <= {LARGEST:g}", "")
