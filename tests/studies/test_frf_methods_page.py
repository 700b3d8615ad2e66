"""The page of the study of response estimators: what it shows is what was measured, and its bytes are settled."""

from __future__ import annotations

import base64
import json
import math
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2]))
from studies.frf_methods import (
    figures_accuracy,
    figures_style,
    figures_tables,
    figures_variants,
    figures_window,
    page,
)
from studies.frf_methods.figures_signals import (
    NOTHING,
    TOP,
    Shown,
    amplitude_db,
    envelope,
    measured,
    packed,
    signals,
)
from studies.frf_methods.measurement import ExcitationClass, chance
from studies.frf_methods.methods import METHODS

from reference.plants import reference_plant  # isort: skip

N_SAMPLE, STEP_S = 2000, 0.001
LINE = np.arange(9, 121, 2)  # odd bins of 2 s: 4.5 to 59.5 Hz
SINE_BIN, SPEED, SLOW = 2, 4.0, 9.0


@pytest.fixture(scope="module")
def shown() -> Shown:
    """Four blocks of three experiments on a three-axis plant of the bench, 2 s a period."""
    plant = reference_plant(1, "three_axis")
    excitation = ExcitationClass(
        LINE, np.full((len(LINE), 3), SPEED), SINE_BIN, np.full(3, SLOW), N_SAMPLE, STEP_S, 1
    )
    return measured(plant.robot, plant.nominal, plant.pose[0], excitation, chance(1, 1, 0))


def rows(**columns: list[str]) -> list[dict[str, str]]:
    return [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]


ACCURACY = rows(
    method=["H1", "LOG", "LRM MIMO", "LRM MIMO", "LRM MIMO, friction removed"],
    experiments=["24", "24", "24", "6", "24"],
    error=["0.3", "0.2", "0.1", "0.15", "0.05"],
    low=["0.2", "0.15", "0.08", "0.1", "0.04"],
    high=["0.4", "0.25", "0.12", "0.2", "0.06"],
    bias=["0.2", "0.01", "0", "0.1", "0.01"],
    scatter=["0.1", "0.19", "0.1", "0.1", "0.05"],
    error_4_8_hz=["0.5", "0.4", "0.3", "0.3", "0.1"],
)
COVERAGE = rows(
    method=["LOG", "LRM MIMO"],
    own_mean=["0.95", "0.94"],
    own_low=["0.94", "0.93"],
    own_high=["0.96", "0.95"],
    g_bla=["0.90", "0.60"],
    g_bla_low=["0.89", "0.58"],
    g_bla_high=["0.91", "0.62"],
    size=["0.2", "0.1"],
)
STIFFNESS = rows(
    method=["LOG", "model error (floor)"],
    experiments=["24", ""],
    rms_error=["0.02", "0.005"],
    low=["0.01", ""],
    high=["0.03", ""],
)
VARIANTS = rows(
    variant=["as shipped", "without friction and ripple", "all odd bins excited", "n + 1 experiments"],
    method=["H1 <weak>"] * 4,
    experiments=["6", "24", "6", "7"],
    error=["0.2", "0.1", "0.15", "0.18"],
)
AMPLITUDE = rows(
    springs=["linear springs", "linear springs", "stiffening gears", "stiffening gears"],
    torque_share=["0.1", "0.4", "0.1", "0.4"],
    axis=["axis_1"] * 4,
    resonance_hz=["8.1", "8.0", "8.0", "8.4"],
    antiresonance_hz=["5.1", "5.0", "5.0", "5.3"],
)
TABLES = {
    "accuracy": ACCURACY,
    "iterations": ACCURACY,
    "coverage": COVERAGE,
    "stiffness": STIFFNESS,
    "variants": VARIANTS,
    "amplitude": AMPLITUDE,
}


@pytest.fixture(scope="module")
def text(shown: Shown, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page with all tables."""
    path = tmp_path_factory.mktemp("page") / "page.html"
    return page.write_page(path, shown, TABLES, truth=truth_of(shown)).read_text(encoding="utf-8")


def truth_of(shown: Shown) -> np.ndarray:
    return figures_window.spectra(shown.record, 12).raw


def data_of(text: str) -> Any:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    return json.loads(found.group(1))


def unpacked(entry: Any) -> np.ndarray:
    """What the page's script makes of a packed signal."""
    data = np.frombuffer(base64.b64decode(entry["data"]), dtype="<i2")
    values = np.where(data == NOTHING, np.nan, data * entry["unit"])
    return values.reshape(4, 3, 3, entry["length"])  # blocks, experiments, axes


def test_the_page_holds_every_figure_opens_without_network_and_has_settled_bytes(
    shown: Shown, text: str, tmp_path: Path
) -> None:
    data = data_of(text)
    expected = {"reference-time", "reference-spectrum", "torque-time", "torque-spectrum"}
    expected |= {"ranking", "bands", "coverage", "sizes", "stiffness", "smooth", "excitations", "amplitude"}
    expected |= {f"efficiency-{name}" for name in figures_style.FAMILIES}
    assert set(data["figures"]) == expected
    assert set(data["windows"]) == {"window-12", "window-3", "window-1"}
    for name in (*expected, *data["windows"]):
        assert text.count(f'id="figure-{name}"') == 1
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=", text)
    again = page.write_page(tmp_path / "again.html", shown, TABLES, truth=truth_of(shown))
    assert again.read_text(encoding="utf-8") == text


def test_tables_stand_on_the_page_as_text_and_missing_ones_are_named(
    shown: Shown, text: str, tmp_path: Path
) -> None:
    assert "H1 &lt;weak&gt;" in text
    assert "There is no table" not in text
    bare = page.write_page(tmp_path / "bare.html", shown, {}).read_text(encoding="utf-8")
    for name in page.TABLES:
        assert f"python -m studies.frf_methods.run {name}" in bare
    assert "ranking" not in data_of(bare)["figures"]


def test_a_table_without_the_columns_of_a_figure_is_shown_as_a_table_only(
    shown: Shown, tmp_path: Path
) -> None:
    strange = {name: rows(method=["one"], other=["1"]) for name in page.TABLES}
    written = page.write_page(tmp_path / "strange.html", shown, strange).read_text(encoding="utf-8")
    assert "no rows that this figure could show" in written
    assert written.count("<td>one</td>") == len(page.TABLES)


def test_a_scene_of_the_study_is_measured_and_named(
    shown: Shown, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page, "measured", lambda *arguments: shown)
    monkeypatch.setattr(page, "present_tables", lambda: {"coverage": COVERAGE})
    fields = dict.fromkeys(("robot", "nominal", "angle", "excitation"))
    truth = SimpleNamespace(response=truth_of(shown))
    scene = SimpleNamespace(**fields, plant=7, pose=2, truth=truth)
    written = page.study_page(tmp_path / "deep" / "page.html", scene).read_text(encoding="utf-8")
    assert "plant 7 of the reference bench, configuration 2" in written
    assert set(data_of(written)["figures"]) >= {"coverage", "sizes"}


def test_the_spectrum_shows_the_amplitudes_that_were_asked_for_and_nothing_between(shown: Shown) -> None:
    found = signals(shown)
    decibel = unpacked(found["reference_spectrum"])
    kind, frequency = np.array(found["kind"]), np.array(found["frequency"])
    np.testing.assert_allclose(frequency[kind == 0], LINE / (N_SAMPLE * STEP_S))
    # Integers round by half a unit, which is a fraction 1 / TOP of the largest, below 120 dB + 20 log10(SLOW).
    rounding = 0.5 * 140 / TOP
    np.testing.assert_allclose(decibel[..., kind == 0], 20 * math.log10(SPEED), atol=rounding)
    np.testing.assert_allclose(decibel[..., SINE_BIN - 1], 20 * math.log10(SLOW), atol=rounding)
    silent = kind != 0
    silent[SINE_BIN - 1] = False
    assert np.isnan(decibel[..., silent]).all()
    assert np.isfinite(unpacked(found["torque_spectrum"])).all()  # noise and distortion are everywhere


def test_the_torque_over_time_begins_before_the_record_and_goes_on_as_recorded(shown: Shown) -> None:
    """Smallest and largest values are kept, the first period is the transient that the record left out."""
    found = signals(shown)
    drawn = unpacked(found["torque"])
    assert found["periods"] == 3
    assert found["settling"] == 1
    recorded = shown.record.run.values("motor_torque")[0]
    kept = drawn.reshape(*drawn.shape[:3], 3, -1)[:, :, :, 1:]
    rounding = 0.5 * found["torque"]["unit"] * (1 + 1e-3)  # TOP units of nine digits
    np.testing.assert_allclose(kept.max(axis=-1), np.moveaxis(recorded.max(axis=3), -1, 2), atol=rounding)
    np.testing.assert_allclose(kept.min(axis=-1), np.moveaxis(recorded.min(axis=3), -1, 2), atol=rounding)
    # From rest: the first sample of the transient holds gravity, the periodic motion is somewhere else by then.
    start = drawn[..., :4].mean(axis=-1)
    assert np.abs(start - kept[:, :, :, 0, :4].mean(axis=-1)).max() > 10 * rounding


def test_an_envelope_keeps_the_extremes_in_their_order() -> None:
    values = np.array([0.0, 3, -1, 2, 5, 4, 9, 8, -7, 1, 1, 1])
    np.testing.assert_array_equal(envelope(values, 3), [3, -1, 4, 9, -7, 1])
    np.testing.assert_array_equal(envelope(values, 6), values)  # two samples a stretch: nothing to leave out


def test_what_is_packed_comes_back_within_half_a_unit() -> None:
    values = np.random.default_rng(1).normal(size=(4, 3, 3, 7))
    values[0, 0, 0, 0] = np.nan
    entry = packed(values)
    found = unpacked(entry)
    assert np.isnan(found[0, 0, 0, 0])
    largest = np.nanmax(np.abs(values))
    assert np.nanmax(np.abs(found - values)) <= largest * (0.5 / TOP + 1e-6)


def test_amplitudes_are_those_of_cosines() -> None:
    time = np.arange(64) / 64
    wave = 3 * np.cos(2 * np.pi * 5 * time + 0.4) + 0.5
    found = amplitude_db(wave, np.array([4, 5]))
    assert found[1] == pytest.approx(20 * math.log10(3))
    assert np.isnan(found[0])


# Windows ----------------------------------------------------------------------------------------------------------


def test_windows_show_what_the_local_fits_found(shown: Shown) -> None:
    """The curve of each parametrisation spans its window; its error at the line is that of the stated response."""
    data = figures_window.spectra(shown.record, 3)
    fits = figures_window.local_fits(data)
    assert set(fits) == {"scalar", "miso", "mimo"}
    truth = 2 * data.raw
    case = figures_window.Case("any", "any", 20, 1, 0)
    figure = figures_window.window_figure(case, data, fits, truth)
    for name, fit in fits.items():
        mine = [
            trace
            for trace in figure.data
            if figures_style.FITS[name] in (trace.line.color, trace.marker.color)
        ]
        curve = next(trace for trace in mine if trace.yaxis == "y2")
        edges = data.frequency_hz[[fit.first[20], fit.last[20]]]
        np.testing.assert_allclose([curve.x[0], curve.x[-1]], edges, rtol=1e-4)
        diamond = next(trace for trace in mine if trace.mode == "markers")
        off = 100 * abs(fit.response[20, 1, 0] / truth[20, 1, 0] - 1)
        assert diamond.y[0] == pytest.approx(off, rel=1e-4)
    assert len(figure.layout.shapes) == 2


def test_instructive_lines_are_found_where_they_are() -> None:
    """A diagonal with one dip in axis 1, one peak in axis 2, and a coupling that peaks elsewhere."""
    frequency = np.arange(1.0, 41.0)
    response = np.zeros((40, 2, 2), dtype=complex)
    response[:, 0, 0] = response[:, 1, 1] = np.exp(0.1 * np.sin(frequency))
    response[:, 1, 0], response[:, 0, 1] = 0.1, 0.3
    response[12, 0, 0], response[25, 1, 1], response[30, 0, 1] = 0.01, 100.0, 0.6
    found = {case.key: case for case in figures_window.cases(frequency, response)}
    assert (found["dip"].line, found["dip"].output) == (12, 0)
    assert (found["peak"].line, found["peak"].output) == (25, 1)
    assert (found["coupling"].line, found["coupling"].output, found["coupling"].input) == (30, 0, 1)


def test_one_experiment_is_shown_as_a_plain_ratio(shown: Shown) -> None:
    data = figures_window.spectra(shown.record, 1)
    u, y = shown.record.spectra()
    np.testing.assert_allclose(data.raw[7, 2, 1], y[0, 0, 7, 2, 0] / u[0, 0, 7, 1, 0])


# Tables -----------------------------------------------------------------------------------------------------------


def test_the_ranking_puts_the_nearest_on_top_beside_its_published_place() -> None:
    figure = figures_accuracy.ranking(ACCURACY)
    labels = figure.layout.yaxis.ticktext
    assert [one.split(" <b>")[0].split(",")[0] for one in labels] == ["H1", "LOG", "LRM MIMO", "LRM MIMO"]
    assert "(1)" in labels[1]
    assert "(4)" in labels[0]
    best = [trace for trace in figure.data if trace.y == (3,) and trace.error_x.array is not None]
    assert best[0].x[0] == pytest.approx(5.0)
    assert best[0].error_x.array[0] == pytest.approx(1.0)


def test_efficiency_is_drawn_by_family_over_the_level_of_the_judge() -> None:
    figures = figures_accuracy.efficiency_figures(ACCURACY, 24.0)
    local = figures["efficiency-local"]
    assert [list(trace.x) for trace in local.data] == [[6, 24]]
    np.testing.assert_allclose(local.data[0].y, [15, 10])
    assert {shape.y0 for shape in local.layout.shapes} == {20.0, 1.1 * 20.0}
    assert local.layout.annotations[0].y == pytest.approx(math.log10(20))
    assert "2.4 min" in "".join(local.layout.xaxis.ticktext)
    assert len({figure.layout.yaxis.range for figure in figures.values()}) == 1


def test_levels_of_the_stiffness_table_are_lines_and_no_methods() -> None:
    figure = figures_tables.stiffness(STIFFNESS)
    assert figure is not None
    assert len(figure.layout.yaxis.ticktext) == 1
    assert figure.layout.shapes[0].x0 == pytest.approx(0.5)
    low, high = figure.layout.xaxis.range
    assert low < math.log10(0.5) < high


def test_coverage_is_drawn_in_percent_with_its_interval() -> None:
    figure = figures_tables.coverage(COVERAGE)
    assert figure is not None
    own = next(trace for trace in figure.data if trace.x == (94.0,))
    assert own.error_x.array[0] == pytest.approx(1.0)
    assert figure.layout.xaxis.range[0] < 58


def test_excitations_stand_side_by_side_by_method_and_experiments() -> None:
    figure = figures_variants.other_excitations(VARIANTS)
    assert figure is not None
    assert [point.x[0] for point in figure.data if point.x[0] is not None] == pytest.approx([20, 15, 18])
    assert figure.layout.yaxis.ticktext == ("H1 <weak> · 6 or 7",)
    assert figures_variants.other_excitations(VARIANTS[:1]) is None


def test_amplitude_shows_shifts_against_linear_springs_at_the_strongest() -> None:
    figure = figures_variants.amplitude(AMPLITUDE)
    assert figure is not None
    shifts = {line.name: list(line.y) for line in figure.data}
    assert shifts["resonance, linear springs"] == pytest.approx([1.25, 0.0])
    assert shifts["resonance, stiffening gears"] == pytest.approx([0.0, 5.0])
    assert list(figure.data[0].x) == pytest.approx([10, 40])


def test_every_method_of_the_study_has_the_colour_of_its_family() -> None:
    for method in METHODS.values():
        local = method.use in ("frf.lrm", "frf.lpm")
        expected = "compensated" if method.before else "local" if local else "averaging"
        assert figures_style.family(method.title) == expected


def test_logarithmic_axes_carry_plain_numbers_inside_their_range() -> None:
    axis = figures_style.plain_ticks([0.7, 30.0])
    assert axis["ticktext"] == ["1", "2", "5", "10", "20"]
    assert axis["range"][0] < math.log10(0.7)
    assert axis["range"][1] > math.log10(30)
