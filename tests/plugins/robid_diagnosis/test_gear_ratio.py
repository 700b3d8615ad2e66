"""A gear ratio that is told wrong: when gains and rotor are said to be that together, and when not."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import Finding, ParameterTable
from robid_diagnosis.gear_ratio import gear_ratio_lines

FACTOR, ERROR = 1.03, 3e-4
NOTHING = np.empty(0)
ANGLE, TORQUE = ("sensing.gain_error", "position"), ("sensing.gain_error", "torque_measurement")


def finding(effect: str, side: str, error: float) -> Finding:
    return Finding(
        kind="cause", effect=effect, on="elbow", side=side, names=("error",), units=("1",), nominal=np.array([np.nan]),
        value=np.array([error]), standard_error=np.array([ERROR]), gain=1e4, p_value=1e-9, share=1.0,
        by_configuration=NOTHING, held_out=NOTHING, by_own_size=NOTHING,
    )  # fmt: skip


def rotor(factor: float) -> ParameterTable:
    one = np.ones(1)
    return ParameterTable(
        ("rotor_inertia.elbow",), ("kg m^2",), ("inertia",), 2e-4 * one, 2e-4 * factor * one, 2e-4 * ERROR * one,
        one > 0, one < 0,
    )  # fmt: skip


@pytest.mark.parametrize("factor", [FACTOR, 1 / FACTOR])
@pytest.mark.parametrize("constant", [False, True])
def test_gains_and_rotor_of_a_wrong_ratio_are_said_to_be_one(factor: float, constant: bool) -> None:
    """The arm turns and pushes as it does: the angle is 1/f of the one expected, the torque f, the rotor 1/f^2."""
    angle = finding(*ANGLE, 1 / factor - 1 + ERROR)
    torque = (
        finding("drive.torque_constant", "torque", 1 / factor - 1)
        if constant
        else finding(*TORQUE, factor - 1)
    )
    (line,) = gear_ratio_lines((angle, torque), rotor(1 / factor**2))
    assert line.startswith("elbow: gains of angle and torque and the rotor inertia together suggest")
    number, way = line.rsplit(" gear ratio is ", 1)[1].split(" ± ")[0], line.rsplit(" ", 1)[1]
    assert float(number) == pytest.approx(100 * abs(factor - 1), abs=100 * ERROR)
    assert way == ("large." if factor > 1 else "small.")


def test_what_does_not_coincide_is_no_ratio() -> None:
    """A gain of the angle alone; another rotor, ten standard errors off; a torque with the other sign."""
    angle, torque = finding(*ANGLE, 1 / FACTOR - 1), finding(*TORQUE, FACTOR - 1)
    right = rotor(FACTOR**-2)
    assert gear_ratio_lines((angle, torque), right)
    assert not gear_ratio_lines((angle,), right)
    assert not gear_ratio_lines((angle, torque), rotor(FACTOR**-2 + 20 * ERROR))
    assert not gear_ratio_lines((angle, finding(*TORQUE, 1 / FACTOR - 1)), right)
    assert not gear_ratio_lines((angle, torque), rotor(1.0))
