"""One page for each built-in effect: theory, source, parameters, its law and its fingerprint, YAML to paste."""

from __future__ import annotations

import inspect
import sys
from typing import Any

from generated_pages.chart import row_of
from generated_pages.docstrings import prose
from generated_pages.fingerprint import fingerprint
from generated_pages.law_picture import law_picture
from generated_pages.stages import built_in
from generated_pages.text import code, contents, escaped, heading, literal, table
from robid_core import Robot, StructureEffect
from robid_core.commands.effect_screen import kind_line, parameter_rows, paste
from robid_core.commands.stages import summary
from robid_core.registry import EFFECTS

KINDS = {
    "friction": "Friction",
    "transmission": "Transmission",
    "drive": "Drive",
    "sensing": "Sensing",
    "load": "Load",
    "structure": "Structure",
}
# In the pictures: values that show what the effect does on this robot, where the defaults do little on it.
SHOWN: dict[str, dict[str, float]] = {
    "drive.saturation": {"limit": 5.0},
    "drive.core_loss": {"hysteresis": 5e-3},
    "friction.asymmetric": {"coulomb_forwards": 0.8, "coulomb_backwards": 0.4},
    "friction.eyring": {"shear_forwards": 0.3, "shear_backwards": 0.3},
    "friction.power_law": {"drag_forwards": 0.3, "drag_backwards": 0.3},
    "friction.quadratic_load": {"load_square": 0.01},
    "load.cable_spring": {"stiffness": 500.0, "damping": 5.0},
    "load.centre_of_mass": {"z": 0.05},
    "load.payload": {"mass": 10.0, "z": 0.5},
    "structure.elastic_coordinate": {"axis_x": 0.0, "axis_y": 1.0, "stiffness": 5e3, "damping": 4.0},
    "structure.foundation": {"stiffness_x": 5e5, "stiffness_y": 5e5, "damping_x": 300.0, "damping_y": 300.0},
    "structure.foundation_sway": {"stiffness_x": 2e6, "stiffness_y": 2e6, "damping_x": 1e3, "damping_y": 1e3},
    "transmission.coupled_axes": {"from_motor": 2.0, "ratio": 0.004},
    "transmission.kinematic_error": {"amplitude": 2e-4, "order": 8.0},
    "sensing.delay": {"delay": 1e-3},
    "sensing.white_noise": {"rms": 1e-3},
    "sensing.coloured_noise": {"rms": 1e-3},
}
# Robot and axis, where one_axis does not do.
ELSEWHERE = {
    "transmission.coupled_axes": ("six_axis", "axis_1"),
    "structure.elastic_coordinate": ("six_axis", "axis_6"),
}


def pages() -> dict[str, str]:
    """Return the text of every page by its path."""
    plugins = built_in(EFFECTS)
    found = {f"effects/{plugin.name}.rst": _page(plugin.name, plugin.load()) for plugin in plugins}
    lines = heading("Effects")
    lines += [
        "An effect is one phenomenon that a robot may have beyond rigid bodies and linear springs. A robot file lists",
        "those that act (:doc:`/your_own_robot`); a diagnosis searches all of them (:doc:`/hidden_effects`).",
        "",
        "The pictures are computed from the law itself. The fingerprint is the change of the frequency response of the",
        "packaged robot ``one_axis`` in simulated closed loop (motor acceleration over motor torque, multisine on",
        "a slow sine), with and without the effect, at two amplitudes. What depends on the amplitude is not linear.",
        "",
    ]
    for kind, title in KINDS.items():
        lines += heading(title, "-")
        rows = [
            (f":doc:`{p.name}`", escaped(summary(p.load()))) for p in plugins if p.name.startswith(f"{kind}.")
        ]
        lines += table(("effect", "what it is"), rows, "32 68")
    lines += contents([plugin.name for plugin in plugins])
    return found | {"effects/index.rst": "\n".join(lines)}


def _page(name: str, effect: Any) -> str:
    lines = heading(name)
    lines += [prose(inspect.getdoc(effect) or ""), "", kind_line(effect).capitalize() + ".", ""]
    lines += _pictures(name, effect)
    lines += heading("Theory", "-")
    lines += [prose(inspect.getdoc(sys.modules[effect.__module__]) or ""), ""]
    lines += heading("Source", "-")
    lines += ["\\" + escaped(effect.source) + ".", ""]  # or initials are taken for a list
    lines += heading("Parameters", "-")
    rows = [
        (literal(n), escaped(unit), default, bounds, escaped(said))
        for n, unit, default, bounds, said in parameter_rows(effect)
    ]
    lines += table(("parameter", "unit", "default", "range", "meaning"), rows, "20 14 12 20 34")
    lines += heading("To paste into a robot file", "-")
    return "\n".join([*lines, *code("yaml", paste(name, effect))])


def _pictures(name: str, effect: Any) -> list[str]:
    base, axis = ELSEWHERE.get(name, ("one_axis", "axis_1"))
    values = SHOWN.get(name, {})
    on = "base" if getattr(effect, "places", ("",))[0] == "base" else axis
    robot = Robot.load(base).with_effect("cause", name, on, None, values)
    law = "" if issubclass(effect, StructureEffect) else law_picture(name, robot, effect)
    given = "".join(f"{key} {value:g}, " for key, value in values.items()) + ("else " if values else "")
    values_shown = f"On {axis} of {base} with {given}default values."
    caption = f"{values_shown} Fingerprint: response with over response without the effect."
    index = robot.axis_names.index(axis)
    return row_of([*([law] if law else []), *fingerprint(robot, base, index)], caption)
