"""Pages that are written from the code: complete, and their pictures are what theory says."""

from __future__ import annotations

import io
import logging
import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import Robot
from robid_core.registry import EFFECTS, STAGES, registry
from robid_core.robot.file.part import Part

pytest.importorskip("sphinx", reason="the extra `docs` is not installed")
DOCS = Path(__file__).parents[2] / "docs"
sys.path.append(str(DOCS))

from generated_pages import (  # noqa: E402
    commands,
    docstrings,
    effects,
    fingerprint,
    formulas,
    robot_file,
    show_warnings_only,
    stages,
)
from generated_pages.chart import Curve, chart  # noqa: E402

MATHML = "{http://www.w3.org/1998/Math/MathML}"
LARGE = 1  # index of the larger amplitude


def test_every_built_in_stage_and_effect_has_a_page() -> None:
    pages = stages.pages()
    for plugin in registry().plugins(STAGES):
        if plugin.distribution == "robid":
            assert f":doc:`{plugin.name}`" in pages["stages/index.rst"]
            for setting in plugin.load().model_fields:
                assert setting.rstrip("_") in pages[f"stages/{plugin.name}.rst"]
    groups = {name.partition(".")[0] for name in registry().names(EFFECTS)}
    assert set(effects.KINDS) >= groups - {""}


def parts(kind: type[Part]) -> set[type[Part]]:
    return {kind} | {found for child in kind.__subclasses__() for found in parts(child)}


def test_every_part_of_a_robot_file_stands_in_the_reference() -> None:
    shown = {model for _, _, model in robot_file.PARTS}
    written = {one for one in parts(Part) if one.__module__.endswith(".schema")}  # the same keys, for editors
    assert parts(Part) - {Part} - written == shown
    text = robot_file.pages()["robot_file.rst"]
    for model in shown:
        for name, info in model.model_fields.items():
            assert f"``{info.alias or name}``" in text, (model.__name__, name)


def test_every_command_and_exit_code_stands_in_the_reference() -> None:
    pages = commands.pages()
    for word in ("robid run", "robid diagnose", "--keep-apart", "--locked", "--strict"):
        assert word in pages["commands.rst"]
    for code in ("0", "2", "3", "4", "5", "6", "7", "8", "70", "130"):
        assert f"* - {code}\n" in pages["exit_codes.rst"]


def test_every_fault_of_the_code_stands_in_the_documentation() -> None:
    sources = [
        path
        for folder in ("robid_core", "plugins", "adapters")
        for path in (DOCS.parent / folder).rglob("*.py")
    ]
    known = set(
        re.findall(r"^\| ([BDAR]\d\d) \|", (DOCS / "faults.md").read_text(encoding="utf-8"), re.MULTILINE)
    )
    used = {
        one for path in sources for one in re.findall(r"\b[BDAR]\d\d\b", path.read_text(encoding="utf-8"))
    }
    assert used == known


def ratio(name: str, values: dict[str, float]) -> Any:
    robot = Robot.load("one_axis")
    changed = robot.with_effect("cause", name, "axis_1", None, values)
    return (fingerprint.measured(changed, 0) / fingerprint.measured(robot, 0))[LARGE]


def test_the_fingerprint_of_a_gain_is_one_number() -> None:
    """A torque that is reported 2 % too large makes the response 1/1.02 as large at all lines, in closed loop too.

    The controller sees no torque, so motion and torque are the same: only sums over the same numbers are rounded.
    """
    np.testing.assert_allclose(ratio("sensing.gain_error", {"error": 0.02}), 1 / 1.02, rtol=1e-3)


def test_the_fingerprint_of_a_delay_is_a_linear_phase() -> None:
    """Angles one sample late turn the phase by -omega T; the loop moves a little otherwise, and friction scatters that.

    The response is a mean over eight realisations and friction is a seventh of the torque: 3 degrees are granted, the
    delay's own phase is 29 degrees at 80 Hz.
    """
    delay_s = 1e-3
    expected = -360 * fingerprint.lines() * delay_s
    found = np.degrees(np.unwrap(np.angle(ratio("sensing.delay", {"delay": delay_s}))))
    assert abs(found - expected).max() < 3.0


def test_the_page_of_an_effect_has_its_law_and_its_fingerprint() -> None:
    page = effects._page("friction.stribeck", registry().load(EFFECTS, "friction.stribeck"))
    drawings = page.split("<svg")[1:]
    assert len(drawings) == 3
    for drawing in drawings:
        svg = "<svg" + drawing.partition("</svg>")[0] + "</svg>"
        ElementTree.fromstring("\n".join(line.strip() for line in svg.split("\n")))


def test_a_chart_puts_points_where_they_belong() -> None:
    line = np.linspace(0.0, 1.0, 3)
    root = ElementTree.fromstring(chart("t", "x", "y", [Curve(line, line)]))
    (path,) = (one for one in root.iter("path") if one.get("class") == "first")
    points = np.array([point.split() for point in path.attrib["d"][1:].split("L")], dtype=float)
    assert (np.diff(points[:, 0]) > 0).all()
    assert (np.diff(points[:, 1]) < 0).all()  # downwards on the screen
    np.testing.assert_allclose(
        points[1], (points[0] + points[2]) / 2, atol=0.1
    )  # a tenth of a pixel is written


def test_an_accent_stands_over_its_letter_and_an_index_beside_it() -> None:
    tree = ElementTree.fromstring(formulas.mathml(r"{\dot q}_m + \ddot q"))
    (found,) = tree.iter(f"{MATHML}msub")
    assert [child.text for child in found] == ["\U0001d45e\u0307", "m"]
    assert [one.text for one in tree.iter(f"{MATHML}mi")][-1] == "\U0001d45e\u0308"
    assert not list(tree.iter(f"{MATHML}mover"))


def test_bars_are_escaped_in_prose_only() -> None:
    assert docstrings.prose("|v| and ``|w|``\n\n    |z|") == "\\|v\\| and ``|w|``\n\n    |z|"


def test_information_that_runs_log_stays_off_the_screen_of_a_build_and_warnings_do_not() -> None:
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)  # as a package of the theme adds it
    root, robid = logging.getLogger(), logging.getLogger("robid.documentation")
    levels = {one: one.level for one in root.handlers}
    before = robid.level
    root.addHandler(handler)
    try:
        show_warnings_only()
        robid.setLevel(logging.DEBUG)  # as a run sets it
        robid.info("begins")
        robid.warning("drifts")
    finally:
        root.removeHandler(handler)
        robid.setLevel(before)
        for one, level in levels.items():
            one.setLevel(level)
    assert stream.getvalue() == "drifts\n"
