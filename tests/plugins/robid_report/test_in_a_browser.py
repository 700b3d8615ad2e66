"""The page in a real browser: no script error, nothing wider than the window, words whole, text readable, keyboard."""

from __future__ import annotations

import base64
import hashlib
import html
import itertools
import json
import logging
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from blind.cases import blind_case
from blind.plan import Wanted

from robid_core import Context, LinkMesh, Robot, TimeComparison
from robid_core.stage import map_in_process
from robid_core.testing import example_design, example_fit, example_frf, example_truth
from robid_diagnosis.effects import Effects
from robid_report.comparison_page import ComparisonPage
from robid_report.html import HtmlReport

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome on the PATH")

A4_TEXT_PX = 703  # 210 mm less two margins of 12 mm, at 96 px in 25.4 mm
PROBE = r"""
"use strict";
const errors = [];
addEventListener("error", (event) => errors.push(event.message));
addEventListener("unhandledrejection", (event) => errors.push(String(event.reason)));
addEventListener("securitypolicyviolation", (event) => errors.push("policy: " + event.violatedDirective));
const paper = location.hash === "#paper";
function luminance(colour) {
  const [r, g, b] = colour.map((v) => v / 255).map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}
const numbers = (text) => (text.match(/[\d.]+/g) || [0, 0, 0, 0]).map(Number);
function ground(node) {
  for (; node; node = node.parentElement) {
    const found = numbers(getComputedStyle(node).backgroundColor);
    if (found.length === 3 || found[3] > 0.99) return found.slice(0, 3);
  }
  return [255, 255, 255];
}
function look() {
  const words = [], faint = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const parent = node.parentElement;
    if (!node.data.trim() || parent.closest("script,style,noscript") || !parent.getClientRects().length) continue;
    const style = getComputedStyle(parent), inside = parent.closest("svg");
    const ink = luminance(numbers(inside ? style.fill : style.color)), back = luminance(ground(parent));
    const contrast = (Math.max(ink, back) + 0.05) / (Math.min(ink, back) + 0.05);
    if (contrast < 4.5) faint.push(node.data.trim() + " " + contrast.toFixed(2));
    if (!parent.closest("tbody th") || parent.closest("details:not([open])")) continue;
    for (const match of node.data.matchAll(/\S+/g)) {
      const range = document.createRange();
      range.setStart(node, match.index); range.setEnd(node, match.index + match[0].length);
      if (range.getClientRects().length > 1) words.push(match[0]);
    }
  }
  const plots = Array.from(document.querySelectorAll(".plot"));
  const cut = Array.from(document.querySelectorAll(".scroll")).filter((one) => one.scrollWidth > one.clientWidth + 1);
  const beyond = Array.from(document.body.querySelectorAll("*")).filter((one) => !one.closest(".scroll,svg")
    && one.getBoundingClientRect().right > innerWidth + 1).map((one) => `${one.tagName}#${one.id}.${one.className}`);
  const result = {beyond: beyond.slice(0, 5), width: innerWidth, wide: document.documentElement.scrollWidth,
    words, faint, errors, ground: getComputedStyle(document.body).backgroundColor, cut: cut.length,
    plots: plots.length, drawn: plots.filter((one) => one.querySelector(".main-svg")).length};
  const error = document.querySelector("#parameters tbody td:nth-child(3)");
  if (error) {
    const scroll = error.closest(".scroll"), name = error.parentElement.firstElementChild;
    result.error = error.getBoundingClientRect().right;
    scroll.scrollLeft = 200;
    result.name = name.getBoundingClientRect().left - scroll.getBoundingClientRect().left;
  }
  const body = document.getElementById("body-canvas");
  if (body) {
    const before = body.toDataURL();
    document.querySelector("#body-modes button").click();
    const rest = body.toDataURL();
    const pixels = body.getContext("2d").getImageData(0, 0, body.width, body.height).data;
    let blue = 0;  // the colours of links, none else
    const rows = [body.height, 0], columns = [body.width, 0];
    for (let k = 0; k < pixels.length; k += 4) if (pixels[k + 2] > pixels[k] + 30) {
      const x = (k / 4) % body.width, y = Math.floor(k / 4 / body.width);
      blue += 1;
      rows[0] = Math.min(rows[0], y); rows[1] = Math.max(rows[1], y);
      columns[0] = Math.min(columns[0], x); columns[1] = Math.max(columns[1], x);
    }
    const [left, right] = columns.map((one) => one / body.width), [top, bottom] = rows.map((one) => one / body.height);
    result.room = [right - left, bottom - top, top, 1 - bottom];
    body.dispatchEvent(new KeyboardEvent("keydown", {key: "ArrowLeft"}));
    result.body = [before !== rest, rest !== body.toDataURL(),
      document.getElementById("body-modes").children.length, blue];
  }
  result.facts = Array.from(document.querySelectorAll(".facts div")).map((one) => one.getBoundingClientRect().top);
  result.hidden = Array.from(document.querySelectorAll(".correlation.few,.promised")).map((one) =>
    one.getBoundingClientRect().width - one.closest(".scroll").clientWidth);
  result.shade = Array.from(document.querySelectorAll(".scroll")).map((one) => getComputedStyle(one).backgroundImage);
  const matrix = document.querySelector("#response-matrix svg");
  if (matrix) result.letter = matrix.getScreenCTM().a * parseFloat(matrix.getAttribute("font-size"));
  const cells = document.querySelectorAll("#response-matrix .cell");
  if (cells.length) {
    cells[cells.length - 1].focus();
    cells[cells.length - 1].dispatchEvent(new KeyboardEvent("keydown", {key: "Enter", bubbles: true}));
    result.entry = document.getElementById("response-entry-title").textContent;
    result.focus = document.activeElement.getAttribute("aria-label");
  }
  parent.postMessage(result, "*");
}
addEventListener("load", () => setTimeout(() => {
  if (paper) {
    for (const sheet of document.styleSheets) for (const rule of sheet.cssRules)
      if (rule.media && rule.media.mediaText === "print") rule.media.mediaText = "all";
    dispatchEvent(new Event("beforeprint"));
  }
  setTimeout(look, 300);
}, 800));
"""
HOST = """<!DOCTYPE html><title>host</title><pre id="found"></pre>{frames}<script>
const found = [];
addEventListener("message", (event) => {{ found.push(event.data);
  document.getElementById("found").textContent = JSON.stringify(found); }});
</script>"""


def seen(folder: Path, page: str, views: dict[str, int], *options: str) -> dict[int, dict[str, Any]]:
    """What the probe finds in frames of such widths, by their width; `views` by what follows # in the address."""
    digest = base64.b64encode(hashlib.sha256(PROBE.encode()).digest()).decode()
    probed = page.replace("script-src ", f"script-src 'sha256-{digest}' ", 1)
    probed = probed.replace('<meta name="viewport"', f'<script>{PROBE}</script><meta name="viewport"', 1)
    (folder / "page.html").write_text(probed, encoding="utf-8")
    frames = "".join(
        f'<iframe src="page.html#{view}" width="{width}" height="900" style="border:0"></iframe>'
        for view, width in views.items()
    )
    (folder / "host.html").write_text(HOST.format(frames=frames), encoding="utf-8")
    command = [
        str(CHROMIUM),
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        f"--user-data-dir={folder / 'profile'}",
        "--window-size=1500,1000",
        "--virtual-time-budget=5000",
        *options,
        "--dump-dom",
        (folder / "host.html").as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    found = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.S)
    assert found, done.stderr[-500:]
    results = json.loads(html.unescape(found[1]) or "[]")
    assert len(results) == len(views), results
    return {result["width"]: result for result in results}


@pytest.fixture(scope="module")
def page() -> str:
    """Six axes with long names of parameters, responses, a comparison over time and a design."""
    robot = Robot.load("six_axis")
    time = np.arange(400) * 1e-3
    wave = np.sin(40 * time)[:, None] * np.ones(6)
    trace = TimeComparison(robot.axis_names, "motor_torque", "N m", 0.05, time, wave, 0.95 * wave)
    fit, truth = example_fit(robot), example_truth(robot)
    table = fit.parameters
    known = truth.as_mapping()
    sharp = table.replace(  # large numbers with small errors: as wide as a row becomes
        estimate=np.array([1.0000123 * known[name] for name in table.names]),
        standard_error=np.array([3.4e-5 * abs(known[name]) for name in table.names]),
    )
    fit = fit.replace(time=(trace,), parameters=sharp)
    parts = {"frf": example_frf(robot), "design": example_design(robot)}
    return HtmlReport().run(robot, fit=fit, truth=truth, **parts).html


@pytest.fixture(scope="module")
def light(page: str, tmp_path_factory: pytest.TempPathFactory) -> dict[int, dict[str, Any]]:
    views = {"phone": 390, "screen": 1400, "paper": A4_TEXT_PX}
    return seen(tmp_path_factory.mktemp("light"), page, views, "--blink-settings=preferredColorScheme=1")


@pytest.mark.parametrize("width", [390, 1400, A4_TEXT_PX])
def test_no_script_fails_and_every_plot_is_drawn(light: dict[int, dict[str, Any]], width: int) -> None:
    found = light[width]
    assert found["errors"] == []
    assert found["drawn"] == found["plots"] >= 3


@pytest.mark.parametrize("width", [390, 1400, A4_TEXT_PX])
def test_nothing_is_wider_than_the_window_and_no_name_is_broken(
    light: dict[int, dict[str, Any]], width: int
) -> None:
    assert light[width]["wide"] <= width, light[width]["beyond"]
    assert light[width]["words"] == []
    assert light[width]["cut"] == 0 or width == 390  # a phone's tables are moved sideways, paper's cannot be


def test_a_phone_shows_estimate_and_error_beside_the_name_which_stays(
    light: dict[int, dict[str, Any]],
) -> None:
    assert light[390]["error"] <= 390
    assert light[390]["name"] == pytest.approx(0, abs=1)  # moved sideways by 200 pixels


def test_a_phone_shows_small_tables_and_maps_whole_and_says_where_there_is_more(
    light: dict[int, dict[str, Any]],
) -> None:
    assert len(light[390]["hidden"]) >= 2
    assert max(light[390]["hidden"]) <= 1
    assert light[390]["shade"]
    assert all("gradient" in one for one in light[390]["shade"])
    assert all(one == "none" for one in light[A4_TEXT_PX]["shade"])


@pytest.mark.parametrize("width", [390, 1400, A4_TEXT_PX])
def test_labels_of_the_matrix_are_readable(light: dict[int, dict[str, Any]], width: int) -> None:
    assert light[width]["letter"] > 7  # pixels


def test_no_headline_figure_stands_alone_in_a_row(light: dict[int, dict[str, Any]]) -> None:
    """Eight stand in two rows of four; six stood in a row of five and one alone."""
    tops = light[1400]["facts"]
    assert sorted(tops.count(top) for top in set(tops)) == [4, 4]


def test_the_robot_fills_its_canvas_and_stands_in_its_middle(light: dict[int, dict[str, Any]]) -> None:
    across, up, above, below = light[1400]["room"]
    assert max(across, up) > 0.6
    assert abs(above - below) < 0.1


@pytest.mark.parametrize("width", [390, 1400, A4_TEXT_PX])
def test_text_stands_out_from_its_ground(light: dict[int, dict[str, Any]], width: int) -> None:
    """4.5 to 1, as WCAG 2.2 asks of text at level AA."""
    assert light[width]["faint"] == []


def test_an_entry_is_chosen_by_the_keyboard_and_keeps_the_focus(light: dict[int, dict[str, Any]]) -> None:
    assert light[1400]["entry"] == "Acceleration of axis_6 over torque of axis_6"
    assert light[1400]["focus"] == "axis_6 over axis_6"


def test_the_robot_swings_in_its_modes_and_is_turned_by_arrow_keys(light: dict[int, dict[str, Any]]) -> None:
    swings, turns, n_button, _ = light[1400]["body"]
    assert swings
    assert turns
    assert n_button > 2


def test_meshes_are_drawn_in_place_of_capsules(
    light: dict[int, dict[str, Any]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cube of 0.8 m about the second joint covers far more than the links of the same robot as capsules."""
    corners = np.array([[x, y, z] for x in (-0.4, 0.4) for y in (-0.4, 0.4) for z in (-0.4, 0.4)])
    faces = np.array(list(itertools.combinations(range(8), 3)))  # with some inside: no matter
    cube = LinkMesh("axis_2", corners, faces, "cube.stl")
    remark = f"'package://{'x' * 80}/<b>.stl' is not drawn"
    monkeypatch.setattr("robid_report.html.link_meshes", lambda robot: ([cube], [remark]))
    robot = Robot.load("six_axis")
    page = HtmlReport().run(robot, frf=example_frf(robot)).html
    by_width = seen(tmp_path, page, {"phone": 390, "screen": 1400}, "--blink-settings=preferredColorScheme=1")
    found = by_width[1400]
    assert found["errors"] == []
    assert by_width[390]["wide"] <= 390, by_width[390]["beyond"]
    assert "&lt;b&gt;.stl&#39; is not drawn" in page
    swings, turns, _, blue = found["body"]
    assert swings
    assert turns
    assert blue > 2 * light[1400]["body"][3] > 0


def test_the_page_is_dark_where_the_reader_wants_it_and_paper_stays_white(page: str, tmp_path: Path) -> None:
    found = seen(tmp_path, page, {"screen": 1400}, "--blink-settings=preferredColorScheme=0")[1400]
    assert found["errors"] == []
    assert sum(int(part) for part in re.findall(r"\d+", found["ground"])) < 150
    assert found["faint"] == []


def printed(folder: Path, page: str) -> Path:
    """The page as a PDF file, by the browser's own printing."""
    (folder / "page.html").write_text(page, encoding="utf-8")
    target = folder / "page.pdf"
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=5000"]
    options += [f"--user-data-dir={folder / 'profile'}", f"--print-to-pdf={target}"]
    command = [str(CHROMIUM), *options, (folder / "page.html").as_uri()]
    subprocess.run(command, capture_output=True, timeout=60, check=True)
    return target


@pytest.fixture(scope="module")
def paper(page: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return printed(tmp_path_factory.mktemp("paper"), page)


def test_paper_is_a4(paper: Path) -> None:
    """595 x 842 points."""
    boxes = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", paper.read_bytes())
    assert boxes
    for width, height in boxes:
        assert float(width) == pytest.approx(595.3, abs=1)
        assert float(height) == pytest.approx(841.9, abs=1)


def text_of(paper: Path) -> str:
    program = shutil.which("pdftotext")
    if program is None:
        pytest.skip("no pdftotext on the PATH")
    return subprocess.run([program, "-layout", paper, "-"], capture_output=True, text=True, check=True).stdout


def test_names_of_parameters_are_whole_on_paper(paper: Path) -> None:
    """In the table of parameters beside estimate, error, truth and start, which is the widest row there is."""
    text = text_of(paper)
    for name in example_fit(Robot.load("six_axis")).parameters.names:
        assert re.search(rf"^ *{re.escape(name)} +\d.* ± ", text, re.M), name


def test_a_long_name_breaks_at_its_dots_and_underscores_on_paper(tmp_path: Path) -> None:
    robot = Robot.load("six_axis")
    fit = example_fit(robot)
    long = "bearing_stiffness.manipulator_shoulder_lift_bearing_x"
    names = (long, *fit.parameters.names[1:])
    fit = fit.replace(parameters=fit.parameters.replace(names=names), free_names=names)
    page = HtmlReport().run(robot, fit=fit, truth=example_truth(robot)).html
    text = text_of(printed(tmp_path, page))
    pieces = re.findall(r"^ *((?:bearing_stiffness\.)?(?:manipulator_)?[a-z_]*[._])$", text, re.M)
    assert all(piece in long for piece in pieces)
    assert "manipulator" in text


def test_paper_has_no_buttons_nor_hints_for_a_pointer(paper: Path) -> None:
    text = text_of(paper)
    assert "arrow keys" not in text
    assert "Choose an entry" not in text
    assert not re.search(r"at rest|Pause", text)
    assert len(re.findall(r"drawn below", text)) == 1


@pytest.mark.parametrize("scheme", [0, 1], ids=["dark", "light"])
def test_a_comparison_is_drawn_on_phone_screen_and_paper_dark_and_light(scheme: int, tmp_path: Path) -> None:
    robot = Robot.load("six_axis")
    fits, responses = (example_fit(robot),) * 3, (example_frf(robot),) * 3
    page = ComparisonPage(labels=("before", "after", "after a third run")).run(fits, responses).html
    assert (
        len(page) < 1_000_000
    )  # bytes; Plotly alone takes 4.8 MB where it is neither trimmed nor compressed
    views = {"phone": 390, "tablet": 700, "screen": 1400}
    if scheme == 1:  # paper is light, which a frame on a screen is not where a reader wants it dark
        views["paper"] = A4_TEXT_PX
    for width, found in seen(
        tmp_path, page, views, f"--blink-settings=preferredColorScheme={scheme}"
    ).items():
        assert found["errors"] == []
        assert found["drawn"] == found["plots"] >= 6  # a figure for each axis
        assert found["wide"] <= width, found["beyond"]
        assert found["faint"] == []
        assert found["words"] == []
        assert found["cut"] == 0 or width == 390
        dark = sum(int(part) for part in re.findall(r"\d+", found["ground"])) < 150
        assert dark == (scheme == 0)


def test_a_diagnosis_is_drawn_on_phone_screen_and_paper(tmp_path: Path) -> None:
    """Friction that falls with the speed: verdict, picture of the cause, curves of the residual, detectable sizes."""
    case = blind_case(Wanted("strong", 900_013, 1, ("friction.stribeck",), (1000.0, 3000.0)))
    log = logging.getLogger("page")
    context = Context(np.random.default_rng(0), map_in_process, lambda *_, **__: None, log)
    diagnosis = Effects(separate=False, response_check=()).run((case.record,), case.told, context)
    assert [one.effect for one in diagnosis.findings] == ["friction.stribeck"]
    page = HtmlReport().run(case.told, diagnosis=diagnosis).html
    views = {"phone": 390, "screen": 1400, "paper": A4_TEXT_PX}
    for width, found in seen(tmp_path, page, views, "--blink-settings=preferredColorScheme=1").items():
        assert found["errors"] == []
        assert found["wide"] <= width, found["beyond"]
        assert found["words"] == []
        assert found["faint"] == []
        assert found["cut"] == 0 or width == 390
