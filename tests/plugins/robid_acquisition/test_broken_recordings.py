"""Fifteen broken recordings of one robot: each is refused, told of, or read right; none gives a number in silence."""

from __future__ import annotations

import json
import logging
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_acquisition.recorded import RecordedAcquisition
from robid_acquisition.suspect_signals import doubts_of_limits
from robid_core import Context, FloatArray, Record, RobidError, Robot
from robid_core.stage import map_in_process
from robid_fit.rigid import RigidBodyFit

ROBOT = Robot.load("six_axis")
STEP, N_PERIOD, N_SAMPLE = ROBOT.sample_time_s, 4, 1000
LINES = [3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47]
AXES = [f"{k}" for k in range(1, 7)]


@pytest.fixture(scope="module")
def sound() -> dict[str, FloatArray]:
    """Angles and torques of multisines on slow sines, settled: four periods of a second."""
    draw = np.random.default_rng(0)
    time = np.arange((N_PERIOD + 2) * N_SAMPLE) / N_SAMPLE
    phase = draw.uniform(0, 2 * np.pi, (6, len(LINES), 1))
    waves = np.cos(2 * np.pi * np.array(LINES)[:, None] * time + phase).sum(axis=1)
    slow = np.sin(2 * np.pi * time + draw.uniform(0, 2 * np.pi, (6, 1)))
    reference = (4 * waves / waves.std() + 30 * slow).T
    done = ROBOT.simulate(reference[None], draw.uniform(-0.6, 0.6, (1, 6)), seed=3)
    return {"q": done.position[0], "tau": done.torque[0]}


class Lab:
    """A folder with recordings, and what reading one says."""

    def __init__(self, folder: Path, caplog: pytest.LogCaptureFixture) -> None:
        self.folder, self.caplog = folder, caplog

    def read(self, file: str, channels: dict[str, Any] | None = None, **settings: Any) -> Record:
        usual = {
            "motor_position": {"column": "q", "unit": "rad"},
            "motor_torque": {"column": "tau", "unit": "N m"},
        }
        words = {"path": file, "channels": usual | (channels or {}), **settings}
        words.setdefault("sample_time_s", STEP)
        words = {key: value for key, value in words.items() if value is not None}
        stage = RecordedAcquisition.model_validate_json(json.dumps(words), strict=True)
        context = Context(
            np.random.default_rng(0),
            map_in_process,
            lambda *_, **__: None,
            logging.getLogger("lab"),
            self.folder,
        )
        return stage.run(ROBOT, context)

    def told(self, file: str, *args: Any, **settings: Any) -> str:
        """All that is said of a recording, refusals among it."""
        with self.caplog.at_level(logging.WARNING, logger="lab"):
            try:
                self.read(file, *args, **settings)
            except RobidError as refusal:
                return f"refused: {refusal}"
        return "\n".join(self.caplog.messages)


@pytest.fixture
def lab(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> Lab:
    return Lab(tmp_path, caplog)


def settled(sound: dict[str, FloatArray]) -> dict[str, FloatArray]:
    return {name: values[2 * N_SAMPLE :].copy() for name, values in sound.items()}


PERIODIC = {"period_s": N_SAMPLE * STEP, "lines": LINES}


def test_the_sound_one_is_read_without_a_word(lab: Lab, sound: dict[str, FloatArray]) -> None:
    np.savez(lab.folder / "run.npz", **settled(sound))
    assert lab.told("run.npz", torque_hold="zero_order_hold", **PERIODIC) == ""


@pytest.mark.full
def test_a_turned_sign(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    run["tau"][:, 1] *= -1
    np.savez(lab.folder / "run.npz", **run)
    assert "torque of axis_2 has the opposite sign" in lab.told("run.npz")


@pytest.mark.full
def test_degrees(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    np.savez(lab.folder / "run.npz", q=np.degrees(run["q"]), tau=run["tau"])
    assert "angles look like degrees" in lab.told("run.npz")


def test_a_wrong_hold(lab: Lab, sound: dict[str, FloatArray]) -> None:
    np.savez(lab.folder / "run.npz", **settled(sound))
    assert "torque_hold is missing" in str(_refusal(lab, "run.npz", **PERIODIC))
    told = lab.told("run.npz", torque_hold="continuous", **PERIODIC)
    assert "continuous is stated" in told
    assert "as with zero_order_hold" in told


def _refusal(lab: Lab, file: str, **settings: Any) -> Exception:
    with pytest.raises((RobidError, ValueError)) as refused:
        lab.read(file, **settings)
    return refused.value


def test_a_delay(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    np.savez(lab.folder / "run.npz", q=run["q"][1:], tau=run["tau"][:-1])
    assert "lag the angles by 0.9" in lab.told("run.npz", torque_hold="zero_order_hold")


def test_a_wrong_period(lab: Lab, sound: dict[str, FloatArray]) -> None:
    np.savez(lab.folder / "run.npz", **settled(sound))
    told = lab.told("run.npz", torque_hold="zero_order_hold", period_s=0.99, lines=LINES)
    assert "repeats every 1 s" in told
    assert "correct period_s" in told


def test_a_transient(lab: Lab, sound: dict[str, FloatArray]) -> None:
    np.savez(lab.folder / "run.npz", **sound)
    told = lab.told("run.npz", torque_hold="zero_order_hold", **PERIODIC)
    assert "the motion has not settled; stages that follow leave such periods out" in told


def test_a_missing_experiment(lab: Lab, sound: dict[str, FloatArray]) -> None:
    for k, name in enumerate(("c1_e1", "c1_e2", "c2_e1")):
        save_again(lab, name, sound, k)
    told = lab.told(None, pattern="c{config}_e{exp}.npz")  # type: ignore[arg-type]
    assert "configuration 2, block 1 lacks experiment 2" in told


def save_again(lab: Lab, name: str, sound: dict[str, FloatArray], seed: int, **changes: Any) -> None:
    """Save the sound recording with noise of its own, and what each channel is to be multiplied by."""
    draw, run = np.random.default_rng(seed), settled(sound)
    run["tau"] += 1e-3 * run["tau"].std(axis=0) * draw.standard_normal(run["tau"].shape)
    np.savez(lab.folder / f"{name}.npz", **{key: one * changes.get(key, 1.0) for key, one in run.items()})


def test_a_file_that_was_copied(lab: Lab, sound: dict[str, FloatArray]) -> None:
    """Noise that counts twice looked like causes, with p < 0.001, and standard errors shrank."""
    for k, name in enumerate(("e1", "e2", "e3")):
        save_again(lab, name, sound, k)
    (lab.folder / "e4.npz").write_bytes((lab.folder / "e2.npz").read_bytes())
    told = lab.told(None, pattern="e{exp}.npz")  # type: ignore[arg-type]
    assert told.startswith(
        "refused: e{exp}.npz: e4.npz holds the samples of e2.npz to the last digit; leave copies"
    )
    assert lab.read(None, pattern="e{exp}.npz", plausibility="warn").run.valid.shape[2] == 4  # type: ignore[arg-type]


def test_a_file_that_holds_a_part_of_another_one(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    for name, kept in (("e1", slice(0, 3000)), ("e2", slice(700, 3700))):
        np.savez(lab.folder / f"{name}.npz", **{key: values[kept] for key, values in run.items()})
    told = lab.told(None, pattern="e{exp}.npz")  # type: ignore[arg-type]
    assert "e2.npz holds a part of e1.npz to the last digit, moved by 700 samples; cut one" in told


def test_an_angle_that_was_rounded(lab: Lab, sound: dict[str, FloatArray]) -> None:
    """0.1 degrees at joints are 0.17 rad and more at motors whose gears turn a hundredfold."""
    run = settled(sound)
    step = np.radians(0.1) / np.abs(np.diag(ROBOT.drives.gear))
    np.savez(lab.folder / "run.npz", q=np.round(run["q"] / step) * step, tau=run["tau"])
    told = lab.told("run.npz", torque_hold="zero_order_hold")
    assert "motor_position of axis_1 comes in steps of" in told
    assert "0.1 degrees at the joint: was it rounded when it was saved?" in told


def test_an_angle_that_stands_in_each_file(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    for k in range(4):
        own = {key: values[700 * k : 700 * k + 650].copy() for key, values in run.items()}
        own["q"][:, 2] = own["q"][0, 2]
        np.savez(lab.folder / f"e{k + 1}.npz", **own)
    told = lab.told(None, pattern="e{exp}.npz")  # type: ignore[arg-type]
    assert "motor_position of axis_3 has one value only in each experiment while its torque changes" in told


@pytest.mark.parametrize(("given", "unit"), [(1000.0, "a rate in Hz"), (1.0, "ms")])
def test_a_sampling_time_in_another_unit(
    lab: Lab, sound: dict[str, FloatArray], given: float, unit: str
) -> None:
    np.savez(lab.folder / "run.npz", **settled(sound))
    told = str(_refusal(lab, "run.npz", sample_time_s=given))
    assert f"it looks like {unit}; write sample_time_s: 0.001" in told


TURNED = np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        pytest.param(
            {"tau": TURNED},
            "refused: e{exp}.npz: e3.npz: .*the torque of axis_3 has the opposite sign",
            marks=pytest.mark.full,
        ),
        pytest.param(
            {"q": np.pi / 180},
            "refused: e{exp}.npz: e3.npz: .*the angles look like radians that were taken for degrees",
            marks=pytest.mark.full,
        ),
        ({"tau": 1 + 0.7 * (TURNED < 0)}, "e3.npz is not like the others: .* of the torque of axis_3 there"),
    ],
    ids=["sign", "unit", "scale"],
)
def test_one_file_of_four_that_is_not_like_the_others(
    lab: Lab, sound: dict[str, FloatArray], change: dict[str, Any], told: str
) -> None:
    """All four together it made unlike the robot without a slip that mends all."""
    for k, name in enumerate(("e1", "e2", "e3", "e4")):
        save_again(lab, name, sound, k, **(change if name == "e3" else {}))
    found = lab.told(None, pattern="e{exp}.npz")  # type: ignore[arg-type]
    assert re.search(told.replace("{", r"\{").replace("}", r"\}"), found), found


def test_absolute_values_of_a_torque(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    run["tau"][:, 5] = abs(run["tau"][:, 5])
    np.savez(lab.folder / "run.npz", **run)
    told = lab.told("run.npz")
    assert "the torque of axis_6 is never negative, and the motion asks for both signs" in told
    assert told.startswith("refused: ")


def test_a_clock_in_milliseconds(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    np.savez(lab.folder / "run.npz", t=1000 * STEP * np.arange(len(run["q"])), **run)
    told = lab.told("run.npz", time_column="t", sample_time_s=None)
    assert told.startswith("refused: ")
    assert "t goes by 1 s from sample to sample, and the drives of six_axis are sampled every 0.001 s" in told
    assert "set time_unit: ms" in told
    settings = {"time_column": "t", "sample_time_s": None, "period_s": 1.0, "lines": "auto"}
    settings["torque_hold"] = "zero_order_hold"
    assert lab.told("run.npz", **settings, time_unit="ms") == ""  # type: ignore[arg-type]


def table(run: dict[str, FloatArray], separator: str, comma: bool, head: str = "") -> str:
    rows = [separator.join([*(f"q{a}" for a in AXES), *(f"tau{a}" for a in AXES)])]
    for row in np.concatenate((run["q"], run["tau"]), axis=1)[:2000]:
        rows.append(separator.join(f"{value:.9f}" for value in row))
    text = "\n".join(rows)
    return head + (text.replace(".", ",") if comma else text) + "\n"


COLUMNS = {
    "motor_position": {"column": [f"q{a}" for a in AXES], "unit": "rad"},
    "motor_torque": {"column": [f"tau{a}" for a in AXES], "unit": "N m"},
}


def test_a_file_of_two_rows(lab: Lab, sound: dict[str, FloatArray]) -> None:
    short = {name: values[:2] for name, values in settled(sound).items()}
    (lab.folder / "run.csv").write_text(table(short, ",", comma=False))
    told = str(_refusal(lab, "run.csv", channels=COLUMNS))
    assert told.startswith("2 samples only, where a motion needs 10 and more; was the file cut")


def test_decimal_commas_and_another_encoding(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    (lab.folder / "comma.csv").write_text(table(run, ";", comma=True))
    (lab.folder / "latin.csv").write_bytes(
        table(run, ",", comma=False, head="# Prüfstand 3, 21 °C\n").encode("latin-1")
    )
    for file in ("comma.csv", "latin.csv"):
        torque = lab.read(file, COLUMNS).run.values("motor_torque")
        np.testing.assert_allclose(torque[0, 0, 0, 0], run["tau"][:2000], atol=1e-9)


def test_an_uneven_clock(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    time = STEP * (np.arange(len(run["q"])) + np.random.default_rng(1).uniform(-0.3, 0.3, len(run["q"])))
    np.savez(lab.folder / "run.npz", t=time, **run)
    told = lab.told("run.npz", sample_time_s=None, time_column="t")
    assert told.startswith("refused")
    assert "resample" in told


def test_a_computed_channel(lab: Lab, sound: dict[str, FloatArray]) -> None:
    np.savez(lab.folder / "run.npz", **settled(sound))
    computed = {"motor_torque": {"column": "tau", "unit": "N m", "computed": True}}
    with pytest.raises((RobidError, ValueError), match="computed"):
        lab.read("run.npz", computed)


@pytest.mark.full
def test_exchanged_axes(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    run["tau"] = run["tau"][:, [1, 0, 2, 3, 4, 5]]
    np.savez(lab.folder / "run.npz", **run)
    told = lab.told("run.npz")
    assert told.startswith("refused")
    assert "axis_1 and axis_2" in told


def test_a_torque_that_a_limit_cut_off(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    limit = 0.7 * np.abs(run["tau"][:, 2]).max()
    run["tau"][:, 2] = np.clip(run["tau"][:, 2], -limit, limit)
    np.savez(lab.folder / "run.npz", **run)
    assert "motor_torque of axis_3 stays at its largest value" in lab.told("run.npz")


def test_a_coarse_torque_that_no_limit_cut_off_is_not_taken_for_one(
    lab: Lab, sound: dict[str, FloatArray]
) -> None:
    run = settled(sound)
    step = np.ptp(run["tau"], axis=0) / 60
    np.savez(lab.folder / "run.npz", q=run["q"], tau=step * np.round(run["tau"] / step))
    assert list(doubts_of_limits(lab.read("run.npz"))) == []


@pytest.mark.parametrize(
    ("axis", "off"),
    [(1, 0.4), *(pytest.param(*case, marks=pytest.mark.full) for case in ((2, -0.5), (1, np.pi / 2)))],
)
def test_a_zero_that_is_told_wrong(lab: Lab, sound: dict[str, FloatArray], axis: int, off: float) -> None:
    """The joint's angle is recorded from another zero; what gravity then pulls at is told with its size."""
    run = settled(sound)
    run["q"] += np.linalg.solve(ROBOT.drives.gear, off * np.eye(6)[axis])
    np.savez(lab.folder / "run.npz", **run)
    told = lab.told("run.npz")
    size = re.search(rf"the angle of axis_{axis + 1} is off by (\S+) rad", told)
    assert size is not None, told
    # Friction that the rigid model smooths, and springs that sag, leave a hundredth of the weight.
    assert float(size.group(1)) == pytest.approx(off, abs=0.02)


def test_an_offset_of_the_torque_is_estimated_as_one(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    run["tau"][:, 0] += 0.4
    np.savez(lab.folder / "run.npz", **run)
    table = RigidBodyFit(cutoff_hz=20.0, decimation=20).run((lab.read("run.npz"),), ROBOT).parameters
    row = table.names.index("friction.axis_1.offset")
    assert table.estimate[row] == pytest.approx(0.4, abs=4 * table.standard_error[row])


def test_counts_that_wrap(lab: Lab, sound: dict[str, FloatArray]) -> None:
    run = settled(sound)
    wrapped = np.mod(run["q"], 2 * np.pi)
    assert (np.abs(np.diff(wrapped, axis=0)) > 6).any()
    np.savez(lab.folder / "run.npz", q=wrapped, tau=run["tau"])
    told = lab.told("run.npz")
    assert told.startswith("refused")
    assert "wraps" in told
    mended = {"motor_position": {"column": "q", "unit": "rad", "wrap": 2 * np.pi}}
    position = lab.read("run.npz", mended).run.values("motor_position")[0, 0, 0, 0]
    np.testing.assert_allclose(np.diff(position, axis=0), np.diff(run["q"], axis=0), atol=1e-9)
