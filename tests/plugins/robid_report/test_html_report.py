"""The page: whole, safe, the same every time, and honest about what is wrong first."""

from __future__ import annotations

import base64
import dataclasses
import gzip
import hashlib
import json
import re
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from robid_core import (
    Artifact,
    Channel,
    DenseRun,
    Design,
    Diagnosis,
    Doubt,
    Excitation,
    Finding,
    Fit,
    Frf,
    FrictionCurve,
    MisfitTable,
    ParameterTable,
    Record,
    ResponseComparison,
    Robot,
    TimeComparison,
    Truth,
)
from robid_core.testing import check_stage, example_artifacts, example_design, example_fit, example_frf
from robid_report.html import HtmlReport
from robid_report.packed import json_for_script
from robid_report.stick_figure import is_worth_drawing, skeleton

N_CONFIG, N_FREQ = 3, 20


def single_spaced(text: str) -> str:
    return re.sub(r"[ \n]+", " ", text)


class Page(HTMLParser):
    """Elements, attributes and text of a page, as a browser's parser would see them."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.scripts: list[tuple[dict[str, str], str]] = []
        self.text: list[str] = []
        self._script: dict[str, str] | None = None
        self._collected: list[str] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        self.elements.append((tag, found))
        if tag == "script":
            self._script, self._collected = found, []

    def handle_endtag(self, tag: str) -> None:
        if tag == "script" and self._script is not None:
            self.scripts.append((self._script, "".join(self._collected)))
            self._script = None

    def handle_data(self, data: str) -> None:
        (self._collected if self._script is not None else self.text).append(data)

    @property
    def words(self) -> str:
        return single_spaced(" ".join(self.text))


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("one_axis")


def everything(robot: Robot, n_axis: int | None = None) -> dict[str, Any]:
    """One of each artifact, small and plausible."""
    draw = np.random.default_rng(0)
    axes = robot.axis_names
    n = len(axes)
    angle = draw.uniform(-0.5, 0.5, (N_CONFIG, n))
    frequency = np.geomspace(4, 80, N_FREQ)
    response = robot.response(angle, frequency)
    names = ("gear_stiffness.axis_1", "gear_damping.axis_1")
    table = ParameterTable(
        names=names,
        units=("N m/rad", "N m s/rad"),
        groups=("stiffness", "damping"),
        start=np.array([8e4, 60.0]),
        estimate=np.array([5.5e4, 44.0]),
        standard_error=np.array([6e2, 3.0]),
        reported=np.array([True, False]),
        at_bound=np.array([False, False]),
    )
    comparison = ResponseComparison(
        axes, frequency, 1.1 * response, response, 0.9 * response, np.full(response.shape, 0.5)
    )
    time = np.arange(50) * 0.001
    wave = np.sin(40 * time)[:, None] * np.ones(n)
    trace = TimeComparison(axes, "motor_torque", "N m", 0.05, time, wave, 0.95 * wave)
    channel = Channel("motor", "rad", np.zeros((1, 1, 1, 1, 50, n)))
    run = DenseRun(0.001, {"motor_position": channel}, time, np.ones((1, 1, 1, 1, 50), dtype=bool))
    return {
        "frf": Frf(
            axis_names=axes, estimator="logarithmic mean", pooling="two blocks", sample_time_s=1e-3,
            torque_hold="zero_order_hold", angle=angle, frequency_hz=frequency, response=response,
            valid=np.ones((N_CONFIG, N_FREQ), dtype=bool),
        ),
        "fit": Fit("log response", "converged", True, 1.05, 20, 12, table, np.eye(2), names, comparison, (trace,)),
        "record": Record(axes, "drives", "zero_order_hold", (run,), angle),
        "design": Design(
            axis_names=axes, angle=angle, criterion="D", parameter_names=names[:1], gap=1e-7, efficiency=0.97,
            weight=np.array([0.5, 0.3, 0.2]), experiments=np.array([4, 2, 2]), candidate_index=np.arange(3),
            information=np.eye(1), predicted_standard_error=np.array([0.01]),
        ),
        "diagnosis": Diagnosis("closed loop", "The robot does what it should.", (trace,)),
        "excitation": Excitation(
            axes, 1e-3, 2, np.array([5, 7]), np.zeros((1, 2, 1, 1000, n)), np.zeros(n)
        ),
        "truth": Truth("one_axis_true", names, np.array([5.6e4, 45.0])),
    }  # fmt: skip


def whole(value: Any, pool: list[Any]) -> Any:
    """Figures with everything in its place that stands once in the page, as the page's script puts it there."""
    if isinstance(value, list):
        return [whole(entry, pool) for entry in value]
    if isinstance(value, dict) and "$" in value:
        return whole(pool[value["$"]], pool)
    return {key: whole(entry, pool) for key, entry in value.items()} if isinstance(value, dict) else value


def stribeck(kind: str) -> Finding:
    """A finding about one axis, a picture left out."""
    one, none = np.ones(1), np.full(1, np.nan)
    return Finding(
        kind, "friction.stribeck", "axis_1", "motor", 500.0, 1e-9, 0.98, ("excess",), ("N m",), none, one, 0.1 * one,
        one, one, one,
    )  # fmt: skip


def figures_of(html: str) -> dict[str, Any]:
    (packed,) = [text for attributes, text in Page(html).scripts if attributes.get("id") == "page-data"]
    data = json.loads(gzip.decompress(base64.b64decode(packed)))
    found: dict[str, Any] = whole(data["value"], data["pool"])
    return found


def curve(traces: list[dict[str, Any]], name: str, phase: bool = False) -> dict[str, Any]:
    """A trace of a figure of one entry."""
    (found,) = [one for one in traces if one["name"] == name and (one["yaxis"] != "y") == phase]
    return found


def page_of(robot: Robot, **artifacts: Any) -> str:
    return HtmlReport().run(robot, **artifacts).html


@pytest.fixture(scope="module")
def full(robot: Robot) -> str:
    return page_of(robot, **everything(robot))


def test_the_page_has_every_section_and_its_numbers(full: str) -> None:
    page = Page(full)
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert {"parameters", "responses", "time", "design", "provenance", "time-0", "time-1"} <= set(ids)
    numbers = (
        "55\u202f000",
        "± 600",
        "−1.79\u202f%",
        "−1.7",
        "12 of 20",
        "Measure here 4 times",
        "Measure here twice",
        "97.0\u202f%",
    )
    sentences = ("The robot does what it should.", "logarithmic mean; uncertainty: two blocks")
    for text in ("gear_stiffness.axis_1", *numbers, *sentences):
        assert text in page.words, text
    assert "banner" not in {attributes.get("id") for _, attributes in page.elements}


def test_the_page_names_versions_of_robid_and_its_libraries(full: str) -> None:
    from importlib import metadata

    words = Page(full).words
    for name in ("robid", "numpy", "plotly"):
        assert f"{name} {metadata.version(name)}" in words
    assert "report.html" in words


@pytest.mark.parametrize(
    "chosen",
    [
        (),
        *((name,) for name in ("frf", "fit", "record", "design", "diagnosis", "excitation")),
        ("fit", "truth"),
    ],
)
def test_any_part_makes_a_page(robot: Robot, chosen: tuple[str, ...]) -> None:
    artifacts = everything(robot)
    page = Page(page_of(robot, **{name: artifacts[name] for name in chosen}))
    assert robot.name in page.words
    # Nothing to plot, no plotting library; no angles, no robot that can be turned.
    plotted, turned = bool({"frf", "fit", "diagnosis"} & set(chosen)), bool({"frf", "record"} & set(chosen))
    assert len(page.scripts) == 3 + plotted + 2 * turned


def test_equal_inputs_give_equal_bytes(robot: Robot, full: str) -> None:
    assert page_of(robot, **everything(robot)) == full


def test_only_the_pages_own_scripts_may_run_and_nothing_is_fetched(full: str) -> None:
    page = Page(full)
    policy = next(
        attributes["content"]
        for tag, attributes in page.elements
        if tag == "meta" and attributes.get("http-equiv") == "Content-Security-Policy"
    )
    directives = dict(part.strip().split(" ", 1) for part in policy.split(";"))
    assert directives["default-src"] == "'none'"
    assert "unsafe" not in directives["script-src"]
    runnable = [text for attributes, text in page.scripts if "type" not in attributes]
    (packed,) = [text for attributes, text in page.scripts if attributes.get("id") == "library"]
    runnable.append(gzip.decompress(base64.b64decode(packed)).decode())
    allowed = set(directives["script-src"].split())
    assert {
        f"'sha256-{base64.b64encode(hashlib.sha256(t.encode()).digest()).decode()}'" for t in runnable
    } == allowed
    for tag, attributes in page.elements:
        assert tag not in {"link", "iframe", "object", "embed", "base", "img"}
        assert not {"src", "href", "action", "srcset"} & set(attributes), (tag, attributes)
        assert not [name for name in attributes if name.startswith("on")]
    style = re.search(r"<style>(.*?)</style>", full, re.S)
    assert style
    assert "url(" not in style[1]
    assert "@import" not in style[1]


def test_the_page_says_when_and_where_it_was_made_only_if_asked(robot: Robot, full: str) -> None:
    import datetime
    import platform

    assert "made on" not in Page(full).words
    page = Page(HtmlReport(date=True, host=True).run(robot, **everything(robot)).html)
    found = re.search(r"made on (\d{4}-\d\d-\d\d) at (\d\d:\d\d) UTC on (\S+)", page.words)
    assert found
    assert found[3] == platform.node()
    told = datetime.datetime.fromisoformat(f"{found[1]}T{found[2]}+00:00")
    assert abs((datetime.datetime.now(datetime.UTC) - told).total_seconds()) < 120
    assert platform.node() not in Page(HtmlReport(date=True).run(robot, **everything(robot)).html).words


def test_no_folder_of_the_machine_stands_on_the_page(robot: Robot) -> None:
    artifacts = everything(robot)
    record = artifacts["record"].replace(source="recorded (/home/anna/robots/cell 3/run_1.csv)")
    fit = artifacts["fit"].replace(status="see C:\\lab\\runs\\log.txt, N m/(rad/s) kept")
    html = page_of(robot, **{**artifacts, "record": record, "fit": fit})
    for part in ("/home", "anna", "lab\\"):
        assert part not in html
    for part in ("run_1.csv", "log.txt, N m/(rad/s) kept"):
        assert part in Page(html).words


def test_the_page_opens_with_its_policy_before_any_script(full: str) -> None:
    assert full.index("Content-Security-Policy") < full.index("<script")


PAYLOADS = (
    "<script>alert(1)</script>",
    "</script><img src=x onerror=alert(1)>",
    '"><svg onload=alert(1)>',
    "'-alert(1)-'",
    "{{ 7*7 }}{% raw %}",
    "<!--<script>",
    "\u2028]]>&lt;b&gt;",
)


def poisoned(value: Any, text: str) -> Any:
    """Replace every string in an artifact, however deep."""
    if isinstance(value, str):
        return text
    if isinstance(value, Artifact):
        return dataclasses.replace(
            value, **{f.name: poisoned(getattr(value, f.name), text) for f in dataclasses.fields(value)}
        )
    if isinstance(value, tuple):
        # Names stay different from each other, as names must.
        return tuple(
            poisoned(entry, f"{text}{index}" if isinstance(entry, str) else text)
            for index, entry in enumerate(value)
        )
    if isinstance(value, dict):
        return {f"{text}{index}": poisoned(entry, text) for index, entry in enumerate(value.values())}
    return value


def code_of(page: Page) -> list[str]:
    return [text for attributes, text in page.scripts if "type" not in attributes]


@pytest.mark.parametrize("payload", PAYLOADS)
def test_Y11_text_of_the_user_stays_text(robot: Robot, full: str, payload: str) -> None:
    artifacts = {name: poisoned(artifact, payload) for name, artifact in everything(robot).items()}
    # What the robot file names, too: the robot is not an artifact.
    axis = robot.description.axes["axis_1"].model_copy(update={"joint": "axis_1"})
    description = robot.description.model_copy(update={"name": payload, "axes": {payload: axis}})
    hostile = HtmlReport(title=payload).run(Robot(description), **artifacts).html
    page, clean = Page(hostile), Page(full)

    # The same elements with the same attributes in the same order as the harmless page; where names break is their own.
    kept, harmless = ([(t, sorted(a)) for t, a in one.elements if t != "wbr"] for one in (page, clean))
    assert kept == harmless
    assert not [a for t, a in page.elements if t == "wbr" and a]
    for tag, attributes in page.elements:
        assert not [name for name in attributes if name.startswith("on")], tag
        assert "id" not in attributes or re.fullmatch(r"[a-z]+(-[a-z0-9]+)*", attributes["id"])
    assert code_of(page) == code_of(clean)
    assert figures_of(hostile)["time"][0]["axes"][0]["name"] == f"{payload}0"
    assert single_spaced(payload) in page.words


def test_json_cannot_leave_its_script_element() -> None:
    text = str(json_for_script({"name": "</script><!--&\u2028"}))
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"name": "</script><!--&\u2028"}
    with pytest.raises(ValueError, match="Out of range"):
        json_for_script({"value": float("nan")})


def spoiled(artifacts: dict[str, Any], what: str) -> dict[str, Any]:
    fit: Fit = artifacts["fit"]
    if what == "fit":
        return {**artifacts, "fit": fit.replace(converged=False, status="gradient still 0.3 after 50 steps")}
    if what == "bound":
        return {
            **artifacts,
            "fit": fit.replace(parameters=fit.parameters.replace(at_bound=np.array([True, False]))),
        }
    if what == "blind":
        blind = fit.parameters.replace(standard_error=np.array([np.nan, 1.0]))
        return {**artifacts, "fit": fit.replace(parameters=blind)}
    if what == "lines":
        valid = np.ones((N_CONFIG, N_FREQ), dtype=bool)
        valid[1, :5] = False
        return {**artifacts, "frf": artifacts["frf"].replace(valid=valid)}
    if what == "record":
        record: Record = artifacts["record"]
        hole = record.run.valid.copy()
        hole[..., 17] = False
        return {**artifacts, "record": record.replace(runs=(record.run.replace(valid=hole),))}
    return {**artifacts, "design": artifacts["design"].replace(gap=0.2)}


@pytest.mark.parametrize(
    ("what", "told"),
    [
        ("fit", "did not converge: gradient still 0.3 after 50 steps; its numbers must not be used"),
        ("bound", "not identified: gear_stiffness.axis_1"),
        ("blind", "without a standard error: gear_stiffness.axis_1"),
        ("lines", "Configuration 2 is rejected: 25.0\u202f% of its lines"),
        ("record", "partial: 1 of 50 samples"),
        ("design", "not optimal"),
    ],
)
def test_Y13_what_is_rejected_stands_first_and_in_red(robot: Robot, what: str, told: str) -> None:
    html = page_of(robot, **spoiled(everything(robot), what))
    page = Page(html)
    body = [tag for tag, _ in page.elements].index("body")
    tag, attributes = page.elements[body + 1]
    assert (tag, attributes["id"], attributes["class"]) == ("div", "banner", "banner red")
    assert told in page.words
    assert html.index(told.split(":")[0]) < html.index("<h1>")


def test_every_doubt_about_a_fit_stands_in_the_banner_in_the_same_words_as_on_screen(robot: Robot) -> None:
    artifacts = everything(robot)
    table = MisfitTable(
        ("axis_1",), np.array([0.0, 3.0, 30.0]), np.array([[np.nan, 1.0]]), np.array([[35.2, 1.4]])
    )
    own = Doubt("mass matrix", "the <mass> matrix is not positive", "measure faster motions")
    fit = artifacts["fit"].replace(n_agree=3, misfit=2.5, misfit_table=table, stated_doubts=(own,))
    page = Page(page_of(robot, **{**artifacts, "fit": fit}))
    banner = page.words[: page.words.index("robid report")]
    assert "Do not rely on this page" in banner
    assert [doubt.kind for doubt in fit.doubts] == ["misfit", "starts", "mass matrix"]
    for doubt in fit.doubts:
        assert str(doubt) in banner
    assert "35.2 on axis_1 below 3 Hz (other bins)" in banner
    assert "axis below 3 Hz 3-30 Hz lines other lines other axis_1 – 35.2 1.00 1.40" in page.words


def test_doubts_about_a_fit_beside_that_of_the_page_stand_in_the_banner_with_its_method(robot: Robot) -> None:
    fit = everything(robot)["fit"]
    beside = fit.replace(method="prediction errors", misfit=2.5)
    page = Page(page_of(robot, fit=fit, fits=(fit, beside)))
    banner = page.words[: page.words.index("robid report")]
    (doubt,) = beside.doubts
    assert f"Fit beside it (prediction errors): {doubt}." in banner
    assert "Fit:" not in banner


def test_a_diagnosis_that_names_what_a_doubted_fit_lacks_says_whose_numbers_to_use(robot: Robot) -> None:
    artifacts = everything(robot)
    cause = stribeck("cause")
    diagnosis = artifacts["diagnosis"].replace(findings=(cause,))
    doubted = artifacts["fit"].replace(misfit=2.5)
    named = "The diagnosis names what the fitted model lacks: friction.stribeck at axis_1."
    assert named in Page(page_of(robot, fit=doubted, diagnosis=diagnosis)).words
    assert named not in Page(page_of(robot, fit=artifacts["fit"], diagnosis=diagnosis)).words
    partial = artifacts["diagnosis"].replace(findings=(stribeck("partial"),))
    assert named not in Page(page_of(robot, fit=doubted, diagnosis=partial)).words


def test_a_fit_of_torques_is_drawn_as_its_model_answers_beside_the_robot_file(robot: Robot) -> None:
    softer = robot.with_parameters({"gear_stiffness.axis_1": 3e4})
    frf = example_frf(robot)
    fit = example_fit(softer).replace(response=None)
    html = page_of(robot, frf=frf, fit=fit)
    data = figures_of(html)["response"]["rows"]["response-axes"]["data"][0]
    fitted, file = curve(data, "fitted model"), curve(data, "start")
    for drawn, one in ((fitted, softer), (file, robot)):
        damping = one.equivalent_motor_damping(frf.speed_rms, frf.slow_sine_speed, frf.frequency_hz)
        response = one.response(frf.angle, np.asarray(drawn["x"]), damping, hold=frf.torque_hold)[0, :, 0, 0]
        np.testing.assert_allclose(drawn["y"], 20 * np.log10(np.abs(response)), atol=0.05)
    assert "response-residuals" not in figures_of(html)["response"]["rows"]


def test_remarks_and_doubts_stand_in_banners_of_their_own(robot: Robot) -> None:
    artifacts = everything(robot)
    remark = Doubt("residual colour", "the residual is correlated over time", "errors count it", "remark")
    diagnosis = artifacts["diagnosis"].replace(doubts=(remark,))
    fit = artifacts["fit"].replace(stated_doubts=(remark,))
    page = Page(page_of(robot, **{**artifacts, "fit": fit, "diagnosis": diagnosis}))
    classes = [attributes.get("class") for _, attributes in page.elements if "class" in attributes]
    assert "banner amber" in classes
    assert "banner red" not in classes
    assert "Do not rely" not in page.words
    assert f"Fit: {remark}." in page.words
    assert f"Diagnosis: {remark}." in page.words
    both = fit.replace(stated_doubts=(remark, Doubt("weather", "it rained", "wait")))
    words = Page(page_of(robot, **{**artifacts, "fit": both})).words
    red, amber = words.index("Do not rely"), words.index("Note")
    assert red < words.index("it rained") < amber < words.index("the residual is correlated over time")


def test_a_misfit_that_was_tuned_is_not_shown_as_a_check(robot: Robot) -> None:
    fit = everything(robot)["fit"]
    assert "misfit 1.05 against the stated uncertainty" in Page(page_of(robot, fit=fit)).words
    words = Page(page_of(robot, fit=fit.replace(misfit=1.0, misfit_against=""))).words
    assert "checks nothing" in words
    assert "1 where model and uncertainty are right" not in words


def test_minor_findings_are_not_red(robot: Robot) -> None:
    artifacts = everything(robot)
    valid = np.ones((N_CONFIG, N_FREQ), dtype=bool)
    valid[0, 3] = False
    page = Page(page_of(robot, **{**artifacts, "frf": artifacts["frf"].replace(valid=valid)}))
    banner = next(attributes for _, attributes in page.elements if attributes.get("id") == "banner")
    assert banner["class"] == "banner amber"


def test_an_estimate_far_from_the_truth_is_told_and_the_plant_by_its_name_alone(robot: Robot) -> None:
    artifacts = everything(robot)
    truth = Truth("/home/somebody/cell/plant.yaml", ("gear_stiffness.axis_1",), np.array([7e4]))
    words = Page(page_of(robot, **{**artifacts, "truth": truth})).words
    assert "More than four standard errors from the truth: gear_stiffness.axis_1" in words
    assert "simulated (plant.yaml)" in words
    assert "somebody" not in words


def test_six_axes_fit_into_two_megabytes_and_are_drawn() -> None:
    robot = Robot.load("six_axis")
    draw = np.random.default_rng(0)
    angle, frequency = draw.uniform(-1, 1, (4, 6)), np.geomspace(4, 80, 100)
    response = robot.response(angle, frequency)
    frf = Frf(
        axis_names=robot.axis_names, estimator="test", pooling="", sample_time_s=1e-3, torque_hold="zero_order_hold",
        angle=angle, frequency_hz=frequency, response=response,
        input_gram_inverse=np.broadcast_to(np.eye(6) + 0j, response.shape).copy(),
        output_covariance=np.broadcast_to(np.eye(6) + 0j, response.shape).copy(),
    )  # fmt: skip
    html = page_of(robot, frf=frf)
    assert len(html.encode()) < 2e6
    page = Page(html)
    assert sum("stick" in attributes.get("class", "") for _, attributes in page.elements) == 8
    figures = figures_of(html)["response"]
    entry = figures["entries"]["data"]
    shown = curve(entry[2][4][1], "robot file")
    drawn = np.array(shown["x"])
    at_lines = np.abs(drawn[:, None] - frequency).argmin(axis=0)
    np.testing.assert_allclose(drawn[at_lines], frequency, atol=5.1e-5)  # six digits of the largest
    np.testing.assert_allclose(
        np.array(shown["y"])[at_lines], 20 * np.log10(np.abs(response[2, :, 4, 1])), atol=0.006
    )
    between = robot.response(angle, drawn)  # the curve is the model between the lines, too
    np.testing.assert_allclose(shown["y"], 20 * np.log10(np.abs(between[2, :, 4, 1])), atol=0.02)
    phase = curve(entry[0][0][0], "measured", phase=True)
    np.testing.assert_allclose(phase["y"], np.degrees(np.angle(response[0, :, 0, 0])), atol=0.006)
    # Unit covariances: one standard deviation is 1 (rad/s^2)/(N m), the band reaches two above; back from there.
    high = curve(entry[1][3][3], "two standard deviations")["y"][: len(frequency) - 1 : -1]
    np.testing.assert_allclose(high, 20 * np.log10(np.abs(response[1, :, 3, 3]) + 2), atol=0.006)
    # The row of all axes shows the same curves as the entries.
    own = [
        one
        for one in figures["rows"]["response-axes"]["data"][1]
        if one["name"] == "measured" and one["yaxis"] == "y4"
    ]
    assert own[0]["y"] == curve(entry[1][3][3], "measured")["y"]


def test_friction_over_speed_is_drawn_with_its_law(robot: Robot) -> None:
    speed = np.array([-3.0, -1.0, 1.0, 3.0])
    curve = FrictionCurve(
        "axis_1", "coulomb, stribeck", "rad/s", "N m", speed, 0.4 * np.sign(speed), 0.41 * np.sign(speed)
    )
    page = Page(page_of(robot, fit=everything(robot)["fit"].replace(friction=(curve,))))
    assert "friction" in [attributes.get("id") for _, attributes in page.elements]
    assert "axis_1: coulomb, stribeck" in page.words
    spoken = [attributes.get("aria-label") for _, attributes in page.elements]
    assert "friction of axis_1 over its speed" in spoken


def test_lines_that_were_not_estimated_are_not_drawn(robot: Robot) -> None:
    frf = everything(robot)["frf"]
    valid = np.ones((N_CONFIG, N_FREQ), dtype=bool)
    valid[0, 3] = False
    figures = figures_of(page_of(robot, frf=frf.replace(valid=valid)))["response"]["rows"]["response-axes"][
        "data"
    ]
    assert curve(figures[0], "measured")["y"][3] is None
    assert curve(figures[1], "measured")["y"][3] is not None


def test_a_robot_of_one_joint_is_drawn_where_its_mass_is_beside_it() -> None:
    robot = Robot.load("one_axis")
    page = HtmlReport().run(robot, frf=example_frf(robot), fit=example_fit(robot)).html
    assert 'id="body-canvas"' in page
    assert 'class="stick"' in page
    still = skeleton(robot, np.zeros((1, 1)))
    assert is_worth_drawing(still)
    assert not is_worth_drawing(dataclasses.replace(still, points=np.zeros_like(still.points)))


def test_a_standard_error_far_above_its_value_is_no_percentage(robot: Robot) -> None:
    fit = example_fit(robot)
    errors = fit.parameters.standard_error.copy()
    errors[0] = 2e5 * fit.parameters.estimate[0]
    page = (
        HtmlReport()
        .run(robot, fit=fit.replace(parameters=fit.parameters.replace(standard_error=errors)))
        .html
    )
    assert re.search(r'title="20000000\u202f%">not determined</td>', page)
    assert not re.search(r"<(td|dd)[^>]*>20000000", page)


def test_poses_without_weight_are_left_out_and_counts_have_their_number(robot: Robot) -> None:
    design = example_design(robot)
    weight, count = np.full(len(design.angle), 5e-5), np.zeros(len(design.angle), dtype=np.int64)
    weight[0], count[0] = 1.0, 2
    excitation = example_artifacts(robot)[Excitation]
    assert isinstance(excitation, Excitation)
    one = excitation.replace(reference=excitation.reference[:1, :1, :1])
    page = (
        HtmlReport().run(robot, design=design.replace(weight=weight, experiments=count), excitation=one).html
    )
    assert page.count("Measure here") == 1
    assert "Do not measure here" not in page
    assert "1 block of 1 experiment, 1 realisation<" in page


def test_the_stick_figure_of_a_turned_arm_stands_where_the_angles_say() -> None:
    robot = Robot.load("one_axis")
    body = skeleton(robot, np.array([[0.0], [0.5]]))
    # A pendulum of centre of mass (0.05, 0, 0.5) about the y axis.
    for c, angle in enumerate((0.0, 0.5)):
        x = 0.05 * np.cos(angle) + 0.5 * np.sin(angle)
        z = -0.05 * np.sin(angle) + 0.5 * np.cos(angle)
        np.testing.assert_allclose(body.points[c, -1], [x, 0.0, z], atol=1e-12)


def test_the_stage_keeps_the_contract() -> None:
    check_stage(HtmlReport, title="Example")


def test_estimate_and_truth_are_written_to_the_second_digit_of_the_error(robot: Robot) -> None:
    """That 204 986 is 1.4 errors of 10 from 205 000 is to be seen from the numbers of the row."""
    parts = everything(robot)
    table = parts["fit"].parameters.replace(
        estimate=np.array([204_986.2, 44.0]), standard_error=np.array([10.3, 3.0])
    )
    truth = Truth("one_axis_true", table.names, np.array([205_000.4, 45.0]))
    page = HtmlReport().run(robot, fit=parts["fit"].replace(parameters=table), truth=truth).html
    row = re.search(r"<tr>\s*<th scope=\"row\">gear_stiffness.<wbr>axis_1</th>(.*?)</tr>", page, re.S)
    assert row
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", row[1])
    assert cells[0] == "204\u202f986"
    assert cells[1] == "± 10"
    assert "205\u202f000" in cells
