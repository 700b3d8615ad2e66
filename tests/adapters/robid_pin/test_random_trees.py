"""Random trees of 1 to 12 axes from URDF, against pinocchio's own mass matrix and gravity, and against the drawing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pinocchio
import pytest
from scipy.spatial.transform import Rotation

from robid_core import Robot
from robid_core.mechanics import Chain, dynamics
from robid_pin.urdf import model_from_urdf

FloatArray = npt.NDArray[np.float64]


@dataclass
class Tree:
    """What was drawn: URDF text, and the arrays it was written from (fixed joints have no rows)."""

    text: str
    names: list[str]
    parents: list[str]
    kinds: list[str]
    axes: FloatArray
    translations: FloatArray
    rotations: FloatArray
    masses: FloatArray
    centres: FloatArray
    inertias: FloatArray


def numbers(values: FloatArray) -> str:
    return " ".join(repr(float(value)) for value in values)


def random_tree(rng: np.random.Generator, n: int, *, fixed: bool) -> Tree:
    """Draw a tree: any parent, revolute, continuous and prismatic joints, any axes and rotations.

    With `fixed`, every other link hangs on a fixed frame with a mass of its own.
    """
    parts, names = ['<link name="base"/>'], [f"joint_{rng.integers(1000)}_{j}" for j in range(n)]
    kinds = [str(kind) for kind in rng.choice(["revolute", "continuous", "prismatic"], n)]
    parents = [["", *names[:j]][rng.integers(j + 1)] for j in range(n)]  # the base now and then
    axes = rng.normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    translations, angles = rng.uniform(-0.5, 0.5, (n, 3)), rng.uniform(-np.pi, np.pi, (n, 3))
    masses, centres = rng.uniform(0.5, 20, n), rng.uniform(-0.2, 0.2, (n, 3))
    # principal moments of three sheets of mass satisfy the triangle inequality: sums of two positive numbers
    spread = rng.uniform(0.01, 0.3, (n, 3))
    principal = spread.sum(axis=1, keepdims=True) - spread
    turned = Rotation.random(n, random_state=rng).as_matrix()
    inertias = turned @ (principal[:, :, None] * np.swapaxes(turned, 1, 2))

    def link(name: str, mass: float, centre: FloatArray, inertia: FloatArray) -> str:
        upper = {
            f"i{a}{b}": inertia["xyz".index(a), "xyz".index(b)]
            for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
        }
        moments = " ".join(f'{key}="{float(value)!r}"' for key, value in upper.items())
        return (
            f'<link name="{name}"><inertial><origin xyz="{numbers(centre)}"/><mass value="{mass!r}"/>'
            f"<inertia {moments}/></inertial></link>"
        )

    for j in range(n):
        parent = f"{parents[j]}_link" if parents[j] else "base"
        if fixed and j % 2:
            parts.append(link(f"frame_{j}", 0.7, centres[0], inertias[0]))
            parts.append(
                f'<joint name="bolt_{j}" type="fixed"><parent link="{parent}"/><child link="frame_{j}"/>'
                f'<origin xyz="0.1 -0.2 0.05" rpy="0.3 -0.2 0.9"/></joint>'
            )
            parent = f"frame_{j}"
        parts.append(link(f"{names[j]}_link", float(masses[j]), centres[j], inertias[j]))
        parts.append(
            f'<joint name="{names[j]}" type="{kinds[j]}"><parent link="{parent}"/><child link="{names[j]}_link"/>'
            f'<origin xyz="{numbers(translations[j])}" rpy="{numbers(angles[j])}"/><axis xyz="{numbers(axes[j])}"/>'
            '<limit lower="-3" upper="3" effort="10" velocity="5"/></joint>'
        )
    rotations = Rotation.from_euler("xyz", angles).as_matrix()  # URDF: R = Rz(yaw) Ry(pitch) Rx(roll)
    text = f'<robot name="drawn">{"".join(parts)}</robot>'
    return Tree(text, names, parents, kinds, axes, translations, rotations, masses, centres, inertias)


def pinocchio_dynamics(
    model: pinocchio.Model, names: tuple[str, ...], position: FloatArray, speed: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mass matrix, gravity torque and bias of pinocchio, in the order of `names`."""
    data = model.createData()
    order = [model.joints[model.getJointId(name)].idx_v for name in names]
    step, v = np.empty(model.nv), np.empty(model.nv)
    step[order], v[order] = position, speed
    q = pinocchio.integrate(model, pinocchio.neutral(model), step)
    upper = np.triu(pinocchio.crba(model, data, q))
    mass = upper + np.triu(upper, 1).T
    gravity = pinocchio.computeGeneralizedGravity(model, data, q)
    bias = pinocchio.rnea(model, data, q, v, np.zeros(model.nv))
    return mass[np.ix_(order, order)], gravity[order], bias[order]


@pytest.mark.parametrize("n", range(1, 13))
@pytest.mark.parametrize("fixed", [False, True])
def test_a_random_tree_has_the_mass_matrix_and_gravity_of_pinocchio(
    n: int, fixed: bool, tmp_path: Path
) -> None:
    rng = np.random.default_rng(1000 * n + fixed)
    tree = random_tree(rng, n, fixed=fixed)
    (tmp_path / "robot.urdf").write_text(tree.text)
    chain = model_from_urdf(tmp_path / "robot.urdf").chain
    assert sorted(chain.names) == sorted(tree.names)
    model = pinocchio.buildModelFromXML(tree.text)
    for _ in range(3):
        position, speed = rng.normal(size=(2, n))
        mass, gravity, bias = pinocchio_dynamics(model, chain.names, position, speed)
        # Sums of at most 12 x 6 products each: 1e-10 is a thousand times their rounding.
        np.testing.assert_allclose(
            dynamics(chain, position, speed).mass, mass, rtol=0, atol=1e-10 * abs(mass).max()
        )
        still = dynamics(chain, position, np.zeros(n)).bias
        np.testing.assert_allclose(still, gravity, rtol=0, atol=1e-10 * abs(gravity).max())
        np.testing.assert_allclose(
            dynamics(chain, position, speed).bias, bias, rtol=0, atol=1e-10 * abs(bias).max()
        )


@pytest.mark.parametrize("n", [1, 2, 6, 12])
def test_a_random_tree_has_the_arrays_it_was_drawn_from(n: int, tmp_path: Path) -> None:
    tree = random_tree(np.random.default_rng(n), n, fixed=False)
    (tmp_path / "robot.urdf").write_text(tree.text)
    chain = model_from_urdf(tmp_path / "robot.urdf").chain
    for j, name in enumerate(tree.names):
        k = chain.index(name)
        parent = chain.names[chain.parent[k]] if chain.parent[k] >= 0 else ""
        assert parent == tree.parents[j]
        assert chain.joint_type[k] == (tree.kinds[j] == "prismatic")
        for field, drawn in (
            ("axis", tree.axes), ("translation", tree.translations), ("rotation", tree.rotations),
            ("mass", tree.masses), ("centre_of_mass", tree.centres), ("inertia", tree.inertias),
        ):  # fmt: skip
            np.testing.assert_allclose(getattr(chain, field)[k], drawn[j], rtol=0, atol=1e-12, err_msg=field)


@pytest.mark.parametrize("n", [1, 5, 12])
def test_a_robot_file_takes_any_tree_with_a_drive_for_every_joint(n: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(77 + n)
    tree = random_tree(rng, n, fixed=True)
    (tmp_path / "robot.urdf").write_text(tree.text)
    drive = "rotor_inertia: 1.0e-3, torque_limit: 10, speed_limit: 100, gear_ratio: -50, controller: {speed_gain: 1}"
    axes = "".join(f"  motor_{j}: {{joint: {name}, {drive}}}\n" for j, name in enumerate(tree.names))
    (tmp_path / "robot.yaml").write_text(f"robid_robot: 1\nname: drawn\nmodel: robot.urdf\naxes:\n{axes}")
    robot = Robot.load("robot.yaml", tmp_path)
    assert robot.n_axis == n
    direct: Chain = model_from_urdf(tmp_path / "robot.urdf").chain
    position = rng.normal(size=n)
    np.testing.assert_array_equal(robot.chain.axis, direct.axis)
    expected = dynamics(direct, position, np.zeros(n)).mass
    np.testing.assert_allclose(dynamics(robot.chain, position, np.zeros(n)).mass, expected, rtol=1e-13)
    (tmp_path / "back.yaml").write_text(robot.to_yaml())
    assert Robot.load("back.yaml", tmp_path) == robot
