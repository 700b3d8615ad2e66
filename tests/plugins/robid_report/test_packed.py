"""What a page carries packed: the bundle of Plotly is that of the installed version, and has what figures need."""

from __future__ import annotations

import base64
import gzip
import json
import re

import numpy as np
import pytest
from plotly.offline import get_plotlyjs_version

from robid_core import Robot, TimeComparison
from robid_core.testing import example_fit, example_frf
from robid_report.html import response_section
from robid_report.packed import json_for_script, packed_json, packed_library, script_hash
from robid_report.plots import time_plots

BUNDLED = {"scatter", "bar", "pie"}


def library() -> str:
    return gzip.decompress(base64.b64decode(packed_library()[0])).decode()


def test_the_bundle_is_of_the_major_version_that_notebooks_draw_with_and_says_its_license() -> None:
    head = library()[:300]
    found = re.search(r"plotly.js \(basic - minified\) v([\d.]+)", head)
    assert found
    assert found[1].partition(".")[0] == get_plotlyjs_version().partition(".")[0]
    assert "MIT license" in head


def test_the_bundle_takes_a_quarter_of_the_whole() -> None:
    assert len(packed_library()[0]) < 600_000
    assert packed_library()[1] == script_hash(library())


def test_figures_of_the_page_have_traces_of_the_bundle_only() -> None:
    robot = Robot.load("six_axis")
    plots, _ = response_section(robot, example_frf(robot), example_fit(robot), None)
    wave = np.sin(np.arange(40.0))[:, None] * np.ones(6)
    one = TimeComparison(robot.axis_names, "motor_torque", "N m", 0.05, np.arange(40.0), wave, 0.9 * wave)
    kinds = set()

    def visit(part: object) -> None:
        if isinstance(part, dict):
            if "x" in part and "y" in part and "mode" in part:
                kinds.add(part.get("type", "scatter"))
            for entry in part.values():
                visit(entry)
        elif isinstance(part, list):
            for entry in part:
                visit(entry)

    visit([plots, time_plots(one, "")])
    assert kinds
    assert kinds <= BUNDLED


@pytest.mark.parametrize("text", ["</script>", "<!--", "\u2028", "&amp;"])
def test_no_text_can_leave_its_script_element(text: str) -> None:
    packed = packed_json({"name": text})
    assert re.fullmatch(r"[A-Za-z0-9+/=]+", packed)
    assert json.loads(gzip.decompress(base64.b64decode(packed))) == {"name": text}
    assert not re.search(r"[<>&]", json_for_script({"name": text}))
