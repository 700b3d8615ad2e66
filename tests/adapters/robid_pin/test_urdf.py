"""A URDF becomes the chain that pinocchio sees, and what no chain can hold is refused by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio
import pytest

from robid_core import ConfigurationError
from robid_core.mechanics import dynamics
from robid_pin.urdf import model_from_urdf

_INERTIAL = """<inertial><origin xyz="0.1 -0.05 0.2" rpy="0.4 0.2 0.3"/><mass value="{mass}"/>
<inertia ixx="0.05" iyy="0.06" izz="0.04" ixy="0.004" ixz="-0.003" iyz="0.002"/></inertial>"""


def _link(name: str, mass: float | None) -> str:
    return f'<link name="{name}">{"" if mass is None else _INERTIAL.format(mass=mass)}</link>'


def _joint(name: str, kind: str, parent: str, child: str, axis: str = "0 0 1", more: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.3 0.1 0.4" rpy="0.2 -0.5 0.7"/><axis xyz="{axis}"/>'
        f'<limit lower="-3" upper="3" effort="10" velocity="5"/>{more}</joint>'
    )


def _write(folder: Path, *parts: str) -> Path:
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="test">{"".join(parts)}</robot>')
    return path


def test_the_chain_has_the_dynamics_of_pinocchios_model(tmp_path: Path) -> None:
    # Every kind of joint, skew axes, a continuous joint (two configuration numbers in pinocchio), a branch, fixed
    # joints before, between and behind, names that sort otherwise than the tree.
    path = _write(
        tmp_path,
        _link("base", None), _link("stand", 5.0), _link("z", 2.0), _link("y", 3.0), _link("plate", 0.5),
        _link("x", 1.5), _link("w", 1.0), _link("tool", 0.7),
        _joint("foot", "fixed", "base", "stand"),
        _joint("swing", "continuous", "stand", "z", "0.6 0 0.8"),
        _joint("lift", "prismatic", "z", "y", "0 -0.6 0.8"),
        _joint("bolt", "fixed", "y", "plate"),
        _joint("bend", "revolute", "plate", "x", "0 -1 0"),
        _joint("arm", "continuous", "y", "w", "1 0 0"),
        _joint("flange", "fixed", "x", "tool"),
    )  # fmt: skip
    chain = model_from_urdf(path).chain
    assert sorted(chain.names) == ["arm", "bend", "lift", "swing"]
    assert dict(zip(chain.names, chain.joint_type.tolist(), strict=True)) == {
        "swing": 0, "lift": 1, "bend": 0, "arm": 0,
    }  # fmt: skip
    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    order = [model.joints[model.getJointId(name)].idx_v for name in chain.names]
    rng = np.random.default_rng(0)
    for _ in range(5):
        position, speed = rng.normal(size=(2, 4))
        step, v = np.empty(4), np.empty(4)
        step[order], v[order] = position, speed
        q = pinocchio.integrate(model, pinocchio.neutral(model), step)
        upper = np.triu(pinocchio.crba(model, data, q))
        ours = dynamics(chain, position, speed)
        mass = (upper + np.triu(upper, 1).T)[np.ix_(order, order)]
        np.testing.assert_allclose(ours.mass, mass, rtol=0, atol=1e-12 * abs(mass).max())
        bias = pinocchio.rnea(model, data, q, v, np.zeros(4))[order]
        np.testing.assert_allclose(ours.bias, bias, rtol=0, atol=1e-12 * abs(bias).max())


_SQUARE = (_link("a", 1.0), _link("b", 1.0), _link("c", 1.0))
_AB, _BC = _joint("i", "revolute", "a", "b"), _joint("j", "revolute", "b", "c")


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ((*_SQUARE, _AB, _joint("j", "floating", "b", "c")), ["6: joint 'j' is of type 'floating'"]),
        ((*_SQUARE, _AB, _joint("j", "planar", "b", "c")), ["6: joint 'j' is of type 'planar'"]),
        ((*_SQUARE, _AB, _joint("j", "revolute", "b", "c", more='<mimic joint="i"/>')), ["6: joint 'j' mimics"]),
        ((_link("a", 1.0), _link("b", 1.0), _joint("j", "fixed", "a", "b")), ["1: no joint moves"]),
        ((_link("a", 1.0), _link("b", None), _AB), ["4: link 'b' has no inertial with", "'i' would move"]),
        ((_link("a", 1.0), _link("b", 0.0), _AB), ["4: link 'b' has no inertial with a mass"]),
        (
            (_link("a", 1.0), _link("b", 1.0).replace('"1.0"', '"much"'), _AB),
            ["3: link 'b': mass 'much' is not a number; give kg"],
        ),
        ((_link("a", 1.0), _link("b", -2.0), _AB), ["3: link 'b': mass -2 kg is negative"]),
        (
            (_link("a", 1.0), _link("b", 1.0).replace('izz="0.04"', 'izz="0.4"'), _AB),
            ["3: link 'b': principal moments 0.0485622, 0.0614", ", 0.4", "kg m^2: none may be negative"],
        ),
        (
            (_link("a", 1.0), _link("b", 1.0).replace('ixy="0.004"', 'ixy="x"'), _AB),
            ["3: link 'b': ixy 'x' is not a number; give kg m^2"],
        ),
        (
            (_link("a", 1.0), _link("b", 1.0).replace('ixy="0.004"', ""), _AB),
            ["3: link 'b': <inertia> lacks ixy; give all six in kg m^2"],
        ),
        (
            (_link("a", 1.0), _link("b", 1.0).replace("<inertial>", '<inertial><origin xyz="0 0 0,2"/>'), _AB),
            ["3: link 'b': <inertial> has the origin xyz='0 0 0,2'; give three numbers in m", "decimal comma?"],
        ),
        (
            (*_SQUARE[:2], _AB.replace("0.3 0.1 0.4", "0 0.3")),
            ["4: joint 'i' has the origin xyz='0 0.3'; give three numbers in m, such as '0 0 0.3'"],
        ),
        (
            (*_SQUARE[:2], _AB.replace("0.2 -0.5 0.7", "0 0 90deg")),
            ["4: joint 'i' has the origin rpy='0 0 90deg'; give three numbers in rad"],
        ),
        (
            (*_SQUARE[:2], _AB.replace("0.2 -0.5 0.7", "90 0 0")),
            ["4: joint 'i' has the origin rpy='90 0 0' rad, more than a turn; degrees? Write rpy=\"1.5708 0 0\""],
        ),
        (
            (*_SQUARE, _AB, _BC, _joint("k", "revolute", "a", "c")),
            ["7: link 'c' hangs on joints 'j' and 'k': a closed loop; robid models chains and trees"],
        ),
        (
            (*_SQUARE, _AB, _BC, _joint("k", "revolute", "c", "a")),
            ["7: joints 'i' and 'j' and 'k' lead round in a closed loop with no link to stand on; robid models"],
        ),
        ((*_SQUARE, _AB), ["4: links 'a', 'c' hang on no joint: the robot is in pieces"]),
        ((*_SQUARE[:2], _AB, _joint("j", "revolute", "b", "d")), ["5: joint 'j' names the child 'd', no link has"]),
        ((*_SQUARE[:2], _link("b", 1.0), _AB), ["4: link 'b' stands twice; names must differ"]),
        ((*_SQUARE, _AB, _BC.replace('name="j"', 'name="i"')), ["6: joint 'i' stands twice"]),
        ((*_SQUARE[:2], _AB.replace('name="i"', "")), ["4: a joint has no name; give it one"]),
        ((*_SQUARE[:2], _joint("i", "revolute", "a", "b", "0 0 0")), ["4: joint 'i' has the axis '0 0 0'; give"]),
        ((*_SQUARE[:2], _joint("i", "revolute", "a", "b", "0 up 1")), ["4: joint 'i' has the axis '0 up 1'"]),
        (
            (*_SQUARE[:2], _AB.replace('lower="-3"', 'lower="4"')),
            ["4: joint 'i': the lower limit 4 is above the upper one 3; exchange them"],
        ),
        ((*_SQUARE[:2], _AB.replace('upper="3"', 'upper="pi"')), ["4: joint 'i' has the limit 'pi', which is not a"]),
    ],
)  # fmt: skip
def test_what_no_chain_can_hold_is_refused_by_name_and_line(
    tmp_path: Path, parts: tuple[str, ...], told: list[str]
) -> None:
    path = _write(tmp_path, *(f"\n{part.replace(chr(10), ' ')}" for part in parts))
    with pytest.raises(ConfigurationError) as refused:
        model_from_urdf(path)
    message = str(refused.value)
    assert message.startswith(f"{path}:{told[0]}")
    assert all(words in message for words in told)
    assert "\n" not in message


def test_every_mistake_of_a_file_is_told_at_once_in_the_order_of_lines(tmp_path: Path) -> None:
    parts = (
        _link("a", 1.0), _link("b", -1.0), _link("c", 1.0).replace('ixx="0.05"', 'ixx="5"'),
        _joint("i", "revolute", "a", "b", "0 0 0"), _joint("j", "planar", "b", "c"), _joint("k", "revolute", "a", "c"),
    )  # fmt: skip
    path = _write(tmp_path, *(f"\n{part.replace(chr(10), ' ')}" for part in parts))
    with pytest.raises(ConfigurationError) as refused:
        model_from_urdf(path)
    lines = [line.removeprefix(f"{path}:").split(" ")[0] for line in str(refused.value).split("\n")]
    assert lines == ["3:", "4:", "5:", "6:", "7:"]


def test_a_mass_behind_a_fixed_joint_counts(tmp_path: Path) -> None:
    path = _write(
        tmp_path, _link("a", 1.0), _link("frame", None), _link("load", 2.0),
        _joint("j", "revolute", "a", "frame"), _joint("weld", "fixed", "frame", "load"),
    )  # fmt: skip
    assert model_from_urdf(path).chain.mass.tolist() == [2.0]


def test_a_file_that_is_no_urdf_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="No such file"):
        model_from_urdf(tmp_path / "none.urdf")
    path = tmp_path / "robot.urdf"
    for content, told in ((b"<robot", "not readable as URDF"), (b"\xff\xfe", "not readable as URDF"),
                          (b"<sdf/>", "describes a <sdf>, not a <robot>")):  # fmt: skip
        path.write_bytes(content)
        with pytest.raises(ConfigurationError, match=told):
            model_from_urdf(path)
