"""Meshes on the page: where pinocchio puts them, few enough, moving with the modes; else capsules."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from scipy.spatial import cKDTree

from robid_core import FloatArray, IntArray, LinkMesh, Robot, link_meshes
from robid_core.testing import example_fit, example_frf
from robid_report.body import body_data
from robid_report.html import HtmlReport
from robid_report.meshes import MOST_TRIANGLES, UNITS, clustered, drawn_meshes, told_once

INERTIAL = """<inertial><origin xyz="0.2 0 0"/><mass value="4"/>
<inertia ixx="0.02" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>"""
LIMIT = '<limit lower="-2" upper="2" effort="90" velocity="3"/>'


def visual(file: str, origin: str = "", scale: str = "1 1 1", kind: str = "visual") -> str:
    mesh = f'<geometry><mesh filename="{file}" scale="{scale}"/></geometry>'
    return f"<{kind}><origin {origin}/>{mesh}</{kind}>"


URDF = f"""<robot name="arm"><link name="base">{visual("stand.stl", 'xyz="0 0 0.1"')}</link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>{LIMIT}
<origin xyz="0 0.1 0.4" rpy="0 0 0.3"/><axis xyz="0 1 0"/></joint>
<link name="upper">{INERTIAL}{visual("arm.stl", 'xyz="0.1 0 0.05" rpy="0.4 -0.3 1.2"', "0.001 0.002 0.001")}
{visual("absent.stl", kind="collision")}</link>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>{LIMIT}
<origin xyz="0.6 0 0" rpy="0.2 0 0"/><axis xyz="0 0.6 0.8"/></joint>
<link name="lower">{INERTIAL}</link>
<joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0.4 0 0" rpy="0 1 0"/></joint>
<link name="tool">{visual("stand.stl", kind="collision")}</link>
</robot>"""
ROBOT = """robid_robot: 1
name: arm
model: arm.urdf
axes:
  shoulder: {gear_ratio: 100, rotor_inertia: 1.0e-4, gear: {stiffness: 2.0e+4, damping: 20}}
  elbow: {gear_ratio: 100, rotor_inertia: 1.0e-4, position_limits: [-2, 2], gear: {stiffness: 1.0e+4, damping: 10}}
bearings:
  shoulder_tilt: {joint: shoulder, axis: [1, 0, 0], stiffness: 1.0e+4, damping: 10}
"""
POSE = np.array([[0.5, -0.9]])


def facets(seed: int, size: float) -> FloatArray:
    """Eight triangles anywhere, (8, 3, 3)."""
    return np.random.default_rng(seed).uniform(-size, size, (8, 3, 3))


def as_ascii_stl(facets: FloatArray) -> bytes:
    told = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in facet.tolist())
        + "endloop\nendfacet\n"
        for facet in facets
    )
    return f"solid part\n{told}endsolid part\n".encode()


def as_binary_stl(facets: FloatArray) -> bytes:
    found = np.zeros(len(facets), [("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("colour", "<u2")])
    found["corner"] = facets
    return bytes(80) + np.uint32(len(facets)).tobytes() + found.tobytes()


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Base with an ASCII mesh, upper arm with a binary one in millimetres, tool with a collision mesh."""
    folder = tmp_path_factory.mktemp("arm")
    (folder / "arm.urdf").write_text(URDF)
    (folder / "robot.yaml").write_text(ROBOT)
    (folder / "stand.stl").write_bytes(as_ascii_stl(facets(0, 0.15)))
    (folder / "arm.stl").write_bytes(as_binary_stl(facets(1, 200.0)))
    return Robot.load(str(folder / "robot.yaml"))


def drawn(robot: Robot) -> dict[str, Any]:
    found = body_data(robot, POSE, 200.0, link_meshes(robot))
    assert found is not None
    return found[0]


def in_the_base(data: dict[str, Any]) -> list[FloatArray]:
    """Vertices as the page's script places them, for each mesh."""
    pose, found = data["configurations"][0], []
    for mesh, turn in zip(data["meshes"], pose["turns"], strict=True):
        origin = np.array(pose["points"][mesh["joint"]]) if mesh["joint"] >= 0 else np.zeros(3)
        vertices = np.reshape(mesh["vertices"], (-1, 3)) * data["unit"]
        found.append(vertices @ np.reshape(turn, (3, 3)).T + origin)
    return found


def test_drawn_vertices_are_where_pinocchio_places_them(arm: Robot) -> None:
    assert arm.file is not None
    urdf = str(arm.file.with_name("arm.urdf"))
    model = pinocchio.buildModelFromUrdf(urdf)
    data = model.createData()
    places = pinocchio.integrate(model, pinocchio.neutral(model), POSE[0])
    pinocchio.forwardKinematics(model, data, places)
    pinocchio.updateFramePlacements(model, data)
    shapes = {  # link, corners as the file has them, scale and origin as the URDF says
        "base": (facets(0, 0.15), (1, 1, 1), (0, 0, 0), (0, 0, 0.1)),
        "upper": (facets(1, 200.0), (0.001, 0.002, 0.001), (0.4, -0.3, 1.2), (0.1, 0, 0.05)),
        "tool": (facets(0, 0.15), (1, 1, 1), (0, 0, 0), (0, 0, 0)),
    }
    page = drawn(arm)
    # A unit in each coordinate by the grid, points and turns to half of 0.1 mm and of 1e-5.
    tolerance = np.sqrt(3) * (page["unit"] + 0.5e-4 + 3 * 0.5e-5 * 0.6)
    for found, (link, (corners, scale, rpy, xyz)) in zip(in_the_base(page), shapes.items(), strict=True):
        origin = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(*map(float, rpy)), np.array(xyz, dtype=float))
        placed = data.oMf[model.getFrameId(link)] * origin
        expected = (corners.reshape(-1, 3) * scale) @ placed.rotation.T + placed.translation
        assert len(found) == len(expected)
        assert cKDTree(found).query(expected)[0].max() < tolerance
        assert cKDTree(expected).query(found)[0].max() < tolerance
    assert [len(mesh["triangles"]) for mesh in page["meshes"]] == [24, 24, 24]


def test_a_fitted_robot_keeps_its_meshes(arm: Robot) -> None:
    """Its model has numbers only: the meshes are those of the robot that was loaded."""
    fit = example_fit(arm).replace(model=arm.model({"gear_stiffness.elbow": 8e3}))
    assert len(link_meshes(arm.fitted(fit))[0]) == 3
    page = HtmlReport().run(robot=arm, frf=example_frf(arm), fit=fit).html
    assert "Elastic modes of the fitted model" in page
    assert "Links are drawn by the meshes of the model file, in 24 triangles;" in page


def test_meshes_move_in_a_mode_as_the_bodies_do(arm: Robot) -> None:
    """The mesh behind a bearing turns with it: its velocity is the difference of two poses, in which it is rigid."""
    page = drawn(arm)
    pose = page["configurations"][0]
    assert [mesh["joint"] for mesh in page["meshes"]] == [
        -1, arm.chain.index("shoulder_tilt"), arm.chain.index("elbow"),
    ]  # fmt: skip
    for mode in pose["modes"]:
        base, upper, lower = np.array(mode["turned"])
        assert not base.any()
        # The tip hangs on the lower arm: it moves by the arm's turn about the elbow, to the digits that are written.
        points, moved = np.array(pose["points"]), np.array(mode["moved"])
        elbow, tip = arm.chain.index("elbow"), arm.chain.n_coordinate
        lever = points[tip] - points[elbow]
        np.testing.assert_allclose(
            moved[tip], moved[elbow] + np.cross(lower, lever), atol=2e-4 + 1e-4 * np.abs(lower).max()
        )
        lever = points[elbow] - points[arm.chain.index("shoulder_tilt")]
        np.testing.assert_allclose(
            moved[elbow], np.cross(upper, lever), atol=2e-4 + 1e-4 * np.abs(upper).max()
        )
    assert pose["modes"]


def sphere(n: int) -> tuple[FloatArray, IntArray]:
    """A sphere of radius 0.3 m of 2 n^2 triangles; those at the poles have no area."""
    row, column = (part.ravel() for part in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    polar, around = np.meshgrid(np.linspace(0, np.pi, n + 1), np.linspace(0, 2 * np.pi, n + 1), indexing="ij")
    vertices = 0.3 * np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1
    )
    corner = row * (n + 1) + column
    halves = [(corner, corner + n + 1, corner + n + 2), (corner, corner + n + 2, corner + 1)]
    return vertices.reshape(-1, 3), np.concatenate([np.stack(half, axis=1) for half in halves])


def test_fine_meshes_keep_their_shape_in_few_triangles(arm: Robot) -> None:
    vertices, triangles = sphere(200)
    meshes = [LinkMesh(joint, vertices, triangles, "ball") for joint in ("shoulder", "elbow")]
    found = drawn_meshes(arm, meshes, [], 1.0)
    count = sum(map(len, found.triangles))
    assert MOST_TRIANGLES / 3 < count <= MOST_TRIANGLES  # a step of the grid changes the number by 1.25^2
    for reduced in found.vertices:
        # The mean of points of a sphere within a cell is no further inside than their spread allows.
        inside = 0.3 - np.linalg.norm(reduced, axis=1)
        assert inside.min() >= -1e-12
        assert inside.max() < 3 * found.cell**2 / (2 * 0.3)
    assert "vertices within" in found.in_words()
    # Every direction is still covered: no hole is wider than two diagonals of a cell.
    assert cKDTree(found.vertices[0]).query(vertices)[0].max() < 2 * np.sqrt(3) * found.cell


def test_the_worst_meshes_stay_below_the_size_that_is_stated(arm: Robot) -> None:
    """Triangles that share no vertex, as far from the joint as is drawn: no mesh takes more characters."""
    far = 9.9 * np.random.default_rng(0).choice([-1, 1], (20_000, 3, 3))
    corners = (far * np.random.default_rng(1).uniform(0.99, 1.0, far.shape)).reshape(-1, 3)
    mesh = LinkMesh("elbow", corners, np.arange(len(corners)).reshape(-1, 3), "dust")
    found = drawn_meshes(arm, [mesh], [], 1.0)
    assert len(json.dumps(found.data(1.0), separators=(",", ":"))) < 300_000


def test_a_cell_as_fine_as_the_page_changes_nothing() -> None:
    vertices, triangles = sphere(6)
    found = clustered((vertices, triangles), 1 / UNITS)
    assert len(found[0]) == 5 * 6 + 2  # rings without their seam, and the poles
    assert len(found[1]) == 2 * 6 * 5  # without those that have no area


def test_what_is_not_drawn_is_told_and_its_link_stays_a_capsule(arm: Robot, tmp_path: Path) -> None:
    assert arm.file is not None
    for name in ("arm.urdf", "robot.yaml", "stand.stl"):
        (tmp_path / name).write_bytes(arm.file.with_name(name).read_bytes())
    (tmp_path / "arm.stl").write_bytes(as_binary_stl(facets(1, 2e5)))  # micrometres
    robot = Robot.load(str(tmp_path / "robot.yaml"))
    data, capsules = drawn(robot), body_data(robot, POSE, 200.0)
    assert capsules is not None
    assert [mesh["joint"] for mesh in data["meshes"]] == [-1, robot.chain.index("elbow")]
    # Of shoulder, its bearing, elbow and tip, what hangs on the bearing is a capsule still.
    assert [r > 0 for r in capsules[0]["radius"]] == [True, False, True, True]
    assert [r > 0 for r in data["radius"]] == [False, False, True, False]
    page = HtmlReport().run(robot=robot, frf=example_frf(robot)).html
    assert "&#39;arm.stl&#39; is not drawn: it lies up to" in page
    assert "is its scale right" in page
    assert "in 16 triangles; those without a mesh as rods" in page
    (tmp_path / "stand.stl").unlink()
    page = HtmlReport().run(robot=robot, frf=example_frf(robot)).html
    assert "link &#39;tool&#39;: &#39;stand.stl&#39; is not found" in page
    assert "Links are drawn as rods" in page
    assert str(tmp_path) not in page


def test_missing_meshes_of_one_kind_are_one_sentence() -> None:
    """Seven links whose meshes are not there, and one that cannot be read."""
    missing = [
        f"link 'link_{i}': 'package://arm/link_{i}.stl' is not found; name its folder" for i in range(7)
    ]
    told = told_once([*missing, "'x.dae' is not drawn: damaged"])
    assert told == [f"{missing[0]} (and 6 more of the kind)", "'x.dae' is not drawn: damaged"]
