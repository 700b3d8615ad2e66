"""Effects on an axis that slides: what is rad and N m elsewhere is m and N there."""

from __future__ import annotations

from pathlib import Path

from robid_core import Robot


def test_across_a_slide_an_effect_has_metres_and_newtons() -> None:
    emps = Robot.load("robot.yaml", Path(__file__).parents[3] / "examples" / "emps")
    slide = emps.with_effect("wave", "drive.torque_ripple", "carriage").with_effect(
        "mud", "friction.dahl", "carriage"
    )
    units = {name: slide.parameter_unit(name) for name in slide.layout if name.startswith("effect.")}
    expected = {"wave.amplitude": "N", "wave.relative": "1", "wave.order": "1/(2 pi m)", "wave.phase": "rad"}
    expected |= {"mud.coulomb": "N", "mud.stiffness": "N/m"}
    assert {name: units[f"effect.{name}"] for name in expected} == expected
    assert not [unit for unit in units.values() if "N m" in unit or unit.startswith("rad/")]
    turning = Robot.load("one_axis").with_effect("mud", "friction.dahl", "axis_1")
    assert turning.parameter_unit("effect.mud.coulomb") == "N m"
