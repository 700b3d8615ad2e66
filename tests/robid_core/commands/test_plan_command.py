"""`robid plan` with advice: every item, from the run's own seeds; a plan that breaks a limit does not run."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from robid_core.commands import main
from robid_core.commands.plan import predictions
from robid_core.pipeline import Pipeline
from robid_core.run.rehearsal import rehearsable

ROOT = Path(__file__).parents[3]
ONE_AXIS = """\
robid: 1
name: example
seed: 1
robot: one_axis
drives: {use: simulated, with: {plant: one_axis_true}}
stages:
  where: {use: design.candidates, with: {count: 2}}
  excite: {use: excitation.multisine, with: {band_hz: [4, 60], lines: 20, period_s: 2, slow_sine_rad_s: 9}}
  acquire: {use: acquisition.drives, with: {periods: 2, settle_periods: 1}}
"""
TOO_MUCH = ONE_AXIS.replace("slow_sine_rad_s: 9", "slow_sine_rad_s: 9, speed_rms_rad_s: 60")


class Done(NamedTuple):
    """How a command ended."""

    code: int
    out: str
    err: str


Robid = Callable[..., Done]


@pytest.fixture
def robid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Robid:
    """Return a function that runs a command line in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> Done:
        with pytest.raises(SystemExit) as ended:
            main(words)
        out, err = capsys.readouterr()
        return Done(int(ended.value.code or 0), out, err)

    return run


def advice_of(text: str) -> list[str]:
    """Return the lines from the first to the last of the advice, without what stands before them."""
    lines = [line.strip() for line in text.splitlines()]
    first = next(i for i, line in enumerate(lines) if line.startswith("predicted by"))
    last = next(i for i, line in enumerate(lines) if line.startswith("experiment time"))
    return [" ".join(line.split()) for line in lines[first : last + 1]]


def test_the_worked_example_gets_every_item_of_advice(robid: Robid, tmp_path: Path) -> None:
    shutil.copy(ROOT / "pipeline.yaml", tmp_path)
    done = robid("plan")
    assert done.code == 0, done.err
    text = advice_of(done.out)
    assert text[0] == "predicted by 48 simulated experiments of the nominal robot, worst of 4 configurations:"
    assert text[1] == "axis torque excited friction gear load travel speed near"
    assert text[2] == (
        "peak N m limit rms N m N m peak N m of motor's rad peak rad/s 10% 50% 90% 99% standstill"
    )
    limits = [32, 36, 22, 6.5, 6, 4.5]
    for row, limit in zip(text[3:9], limits, strict=True):
        name, torque, allowed, rms, friction, load, share, travel, peak, *speeds, standstill = row.split()
        assert name.startswith("axis_")
        assert float(allowed) == limit
        assert float(friction) < float(rms) < float(torque) < 0.9 * limit
        assert float(load) > 0
        assert 0 < float(share.rstrip("%")) < 100
        assert (
            float(travel) > 2.5
        )  # two amplitudes of 9 rad/s at 0.5 Hz make 2 * 9 / (2 pi 0.5) / 2 = 2.9 rad to a side
        assert 0 < float(speeds[0]) < float(speeds[1]) < float(speeds[2]) < float(speeds[3]) < float(peak)
        assert float(standstill.rstrip("%")) < 10
    assert text[9] == "response std median noise alone largest at Hz lines above 50%"
    for row in text[10:16]:
        _, median, noise, worst, hertz, _, of, lines = row.split()
        assert float(noise.rstrip("%")) < float(median.rstrip("%")) < float(worst.rstrip("%"))
        assert 4 <= float(hertz) <= 80
        assert (of, lines) == ("of", "100")
    assert text[-1].startswith(
        "experiment time: 4 configurations x 2 blocks x 6 experiments x 4 s = 192 s with one period each"
    )
    assert list(tmp_path.iterdir()) == [tmp_path / "pipeline.yaml"]  # nothing was written


def test_show_tells_after_the_run_what_plan_told_before(robid: Robid, tmp_path: Path) -> None:
    (tmp_path / "pipeline.yaml").write_text(ONE_AXIS)
    before = advice_of(robid("plan").out)
    assert robid("run", "--until", "excite", "--quiet").code == 0
    assert advice_of(robid("show", "excite").out) == before


def test_a_plan_that_breaks_a_limit_is_refused_and_does_not_run(
    robid: Robid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def moved(*_: Any, **__: Any) -> None:
        raise AssertionError("a motor moved")

    monkeypatch.setattr("robid_acquisition.simulated.OpenSimulatedDrives.perform", moved)
    (tmp_path / "pipeline.yaml").write_text(TOO_MUCH)
    planned = robid("plan")
    assert planned.code == 3
    assert "excite   excitation.multisine" in planned.out  # the wiring is shown all the same
    assert "stage excite: in configuration" in planned.err
    assert "axis_1 would reach a motor torque of 20 N m, 18 N m are allowed" in planned.err
    assert "nothing has moved; speed_rms_rad_s: " in planned.err
    assert not (tmp_path / "runs").exists()
    run = robid("run", "--quiet")
    assert run.code == 3
    assert run.err.splitlines()[-1] == planned.err.splitlines()[-1]
    assert not (tmp_path / "runs/example/artifacts/acquire.h5").exists()
    # What was advised does fit, in the plan and in the run up to the motion.
    advised = planned.err.split("speed_rms_rad_s: ")[1].split()[0]
    fits = robid("plan", "--set", f"stages.excite.with.speed_rms_rad_s={advised}")
    assert fits.code == 0, fits.err


def test_wiring_alone_and_diagrams_simulate_nothing(
    robid: Robid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def simulated(*_: Any, **__: Any) -> None:
        raise AssertionError("something was simulated")

    monkeypatch.setattr("robid_core.run.rehearsal.rehearse", simulated)
    (tmp_path / "pipeline.yaml").write_text(TOO_MUCH)
    for option in ("--dry", "--mermaid"):
        done = robid("plan", option)
        assert done.code == 0, done.err
        assert "predicted" not in done.out
    assert "2 configurations x 2 blocks x 1 experiment" in robid("plan", "--dry").out


def test_warnings_of_a_stage_stand_below_it(robid: Robid, tmp_path: Path) -> None:
    (tmp_path / "pipeline.yaml").write_text(ONE_AXIS.replace("lines: 20", "lines: 6"))
    done = robid("plan")
    assert done.code == 0, done.err
    (warning,) = [line.strip() for line in done.out.splitlines() if "may fall between the lines" in line]
    assert warning.startswith("! ")
    assert "may fall between" not in done.err


def test_progress_is_told_and_the_table_stays_alone_on_stdout(robid: Robid, tmp_path: Path) -> None:
    (tmp_path / "pipeline.yaml").write_text(ONE_AXIS)
    done = robid("plan")
    assert "excite: made in" in done.err
    assert "made in" not in done.out


def test_an_excitation_that_waits_for_a_measurement_is_not_simulated(tmp_path: Path) -> None:
    (tmp_path / "pipeline.yaml").write_text(
        ONE_AXIS
        + "  frf: {use: frf.h1}\n"
        + "  fit: {use: fit.log_response}\n"
        + "  choose: {use: design.optimal, with: {candidates: 20, experiments: 2}}\n"
        + "  again: {use: excitation.multisine, inputs: {configurations: choose}, "
        + "with: {band_hz: [4, 60], lines: 20, period_s: 2, slow_sine_rad_s: 9}}\n"
    )
    text = (tmp_path / "pipeline.yaml").read_text()
    inputs = {
        "excite": "{configurations: where}",
        "acquire": "{configurations: where, excitation: excite}",
        "choose": "{excitation: excite}",
    }
    for name, given in inputs.items():
        text = text.replace(f"  {name}: {{use: ", f"  {name}: {{inputs: {given}, use: ")
    (tmp_path / "pipeline.yaml").write_text(text)
    pipeline = Pipeline.load(tmp_path / "pipeline.yaml")
    assert [node.name for node in rehearsable(pipeline)] == ["where", "excite"]
    advice = predictions(pipeline)
    assert advice["excite"][0].startswith("predicted by")
    assert advice["again"] == [
        f"not simulated: it needs what only a run finds out; robid show {tmp_path}/runs/example again shows the "
        "advice afterwards"
    ]
