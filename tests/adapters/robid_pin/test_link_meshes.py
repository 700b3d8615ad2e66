"""Meshes that a URDF names: found as ROS does, read whatever the format, and a sentence where that cannot be."""

from __future__ import annotations

import re
import struct
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from robid_core import Robot, link_meshes
from robid_core.commands.init import files_of_urdf
from robid_core.registry import MESHES, MODELS, Registry, registry
from robid_core.robot.file.model_file import read_model

CORNERS = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.4]])
FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))

INERTIAL = """<inertial><origin xyz="0.1 0 0"/><mass value="2"/>
<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0" ixz="0" iyz="0"/></inertial>"""
ROBOT = """robid_robot: 1
name: arm
model: {urdf}
axes:
  shoulder: {{gear_ratio: 100, rotor_inertia: 1.0e-4}}
"""


def as_ascii_stl() -> bytes:
    corner = ["vertex " + " ".join(map(str, CORNERS[k])) for face in FACES for k in face]
    facets = [
        f"facet normal 0 0 0\nouter loop\n{chr(10).join(corner[k : k + 3])}\nendloop\nendfacet"
        for k in range(0, 12, 3)
    ]
    return "\n".join(("solid part", *facets, "endsolid part\n")).encode()


def as_binary_stl() -> bytes:
    facets = [struct.pack("<12fH", 0, 0, 0, *CORNERS[list(face)].ravel(), 0) for face in FACES]
    return bytes(80) + struct.pack("<I", len(facets)) + b"".join(facets)


def as_obj() -> bytes:
    lines = ["v " + " ".join(map(str, corner)) for corner in CORNERS]
    return "\n".join((*lines, *("f " + " ".join(str(k + 1) for k in face) for face in FACES), "")).encode()


def as_dae() -> bytes:
    numbers = " ".join(map(str, CORNERS.ravel()))
    corners = " ".join(str(k) for face in FACES for k in face)
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="part"><mesh>
<source id="place"><float_array id="numbers" count="12">{numbers}</float_array><technique_common>
<accessor source="#numbers" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="corners"><input semantic="POSITION" source="#place"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#corners" offset="0"/><p>{corners}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="scene"><node><instance_geometry url="#part"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#scene"/></scene></COLLADA>""".encode()


def arm(folder: Path, mesh: str, more: str = "") -> Robot:
    """A robot of one joint, whose link has a mesh of this name."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.urdf").write_text(
        f"""<robot name="arm"><link name="base"/><joint name="shoulder" type="revolute"><parent link="base"/>
<child link="upper"/><limit lower="-1" upper="1" effort="9" velocity="9"/><axis xyz="0 1 0"/></joint>
<link name="upper">{INERTIAL}<visual>{more}<geometry><mesh filename="{mesh}"/></geometry></visual></link></robot>"""
    )
    (folder / "robot.yaml").write_text(ROBOT.format(urdf="arm.urdf"))
    return Robot.load(str(folder / "robot.yaml"))


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.stl", as_ascii_stl()), ("a.STL", as_binary_stl()), ("a.obj", as_obj()), ("a.dae", as_dae())],
    ids=["ascii", "binary", "obj", "dae"],
)
def test_every_format_gives_the_triangles_of_the_part(tmp_path: Path, name: str, content: bytes) -> None:
    robot = arm(tmp_path, name)
    (tmp_path / name).write_bytes(content)
    (mesh,), remarks = link_meshes(robot)
    assert (mesh.joint, mesh.name, remarks) == ("shoulder", name, [])
    found = {frozenset(map(tuple, np.round(mesh.vertices[face], 6).tolist())) for face in mesh.triangles}
    assert found == {frozenset(map(tuple, CORNERS[list(face)].tolist())) for face in FACES}


def test_packages_are_found_in_the_search_path_and_above_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    package, elsewhere = tmp_path / "arm_description", tmp_path / "install" / "share" / "arm_description"
    robot = arm(package / "urdf", "package://arm_description/meshes/a.stl")
    assert link_meshes(robot)[0] == []
    for folder, factor in ((elsewhere, 2), (package, 1)):
        (folder / "meshes").mkdir(parents=True)
        (folder / "meshes" / "a.stl").write_bytes(as_ascii_stl().replace(b"0.4", str(0.4 * factor).encode()))

    def height() -> float:
        (mesh,), _ = link_meshes(robot)
        return float(mesh.vertices[:, 2].max())

    assert height() == pytest.approx(0.4)
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path / 'none'}:{tmp_path / 'install' / 'share'}")
    assert height() == pytest.approx(0.8)
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    assert height() == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("mesh", "content", "said"),
    [
        ("package://none/a.stl", None, "'package://none/a.stl' is not found; .* in ROS_PACKAGE_PATH"),
        ("none.stl", None, "link 'upper': 'none.stl' is not found; the name begins at the folder of the URDF"),
        (300 * "x" + ".stl", None, "is not found"),
        ("a.stl", b"", "'a.stl' is not drawn: File is empty; export it anew"),
        ("a.stl", b"rubbish" * 40, "STL storage representation"),
        ("a.stl", as_binary_stl()[:-60], "'a.stl' is not drawn: "),
        ("a.stl", as_binary_stl().replace(struct.pack("<f", 0.4), struct.pack("<f", float("nan"))), "not all numb"),
        ("a.dae", as_dae()[:700], "Unable to read file, malformed XML"),
        ("a.ply", b"ply\n", "no reader of meshes 'ply'; there are: dae, obj, stl"),
    ],
    ids=["package", "file", "name", "empty", "rubbish", "cut", "nan", "dae", "suffix"],
)  # fmt: skip
def test_a_mesh_that_cannot_be_drawn_is_a_remark(
    tmp_path: Path, mesh: str, content: bytes | None, said: str
) -> None:
    robot = arm(tmp_path, mesh)
    if content is not None:
        (tmp_path / mesh).write_bytes(content)
    found, (remark,) = link_meshes(robot)
    assert found == []
    assert re.search(said, remark), remark


def test_a_reader_that_crashes_ends_no_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "crashing.py").write_text("import os\ndef read(path):\n    os.abort()\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    points = [plugin.entry_point for plugin in registry().plugins(MODELS)]
    crashing = Registry([*points, EntryPoint("stl", "crashing:read", MESHES)])
    monkeypatch.setattr("robid_core.registry.registry", lambda: crashing)
    monkeypatch.setattr("robid_core.robot.link_meshes.registry", lambda: crashing)
    robot = arm(tmp_path, "a.stl")
    (tmp_path / "a.stl").write_bytes(as_ascii_stl())
    found, (remark,) = link_meshes(robot)
    assert found == []
    assert "the library that reads it as stl mesh crashed (SIGABRT)" in remark


def test_an_origin_that_is_no_number_is_a_remark(tmp_path: Path) -> None:
    found, (remark,) = link_meshes(arm(tmp_path, "a.stl", more='<origin xyz="0 0 high"/>'))
    assert found == []
    assert remark == "link 'upper': origin or scale of 'a.stl' is not three numbers; it is not drawn"


def test_a_project_around_a_urdf_elsewhere_finds_its_meshes(tmp_path: Path) -> None:
    package, project = tmp_path / "arm_description", tmp_path / "project"
    arm(package, "package://arm_description/a.stl")
    (package / "a.stl").write_bytes(as_ascii_stl())
    files, remarks, _ = files_of_urdf(project, package / "arm.urdf", ())
    assert "1 mesh is drawn on the page; only masses and inertias count" in remarks
    project.mkdir()
    (project / "arm.urdf").write_text(files["arm.urdf"])
    (shape,) = read_model(project / "arm.urdf", {}).shapes
    assert shape.name == "../arm_description/a.stl"
    assert shape.file.samefile(package / "a.stl")


def test_a_robot_is_the_same_whatever_its_meshes_and_keeps_them_with_other_numbers(tmp_path: Path) -> None:
    with_mesh, without = arm(tmp_path / "with", "a.stl"), arm(tmp_path / "without", "none.stl")
    (tmp_path / "with" / "a.stl").write_bytes(as_ascii_stl())
    assert with_mesh == without
    assert with_mesh.sha256 == without.sha256
    (tmp_path / "with" / "derived.yaml").write_text("robid_robot: 1\nbase: robot.yaml\n")
    derived = Robot.load(str(tmp_path / "with" / "derived.yaml"))
    for robot in (with_mesh.with_parameters({"rotor_inertia.shoulder": 2e-4}), derived):
        assert len(link_meshes(robot)[0]) == 1
    assert link_meshes(Robot.of_model(with_mesh.model({}))) == ([], [])
