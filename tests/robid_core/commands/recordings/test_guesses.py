"""Guesses from names and from behaviour, on signals whose meaning is known because they were made so."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.commands.recordings.behaviour import clock_of, derivative_factor, leads
from robid_core.commands.recordings.guesses import Guess, guess_channels
from robid_core.commands.recordings.names import said_by

N = 4000
TIME = np.arange(N) * 0.001
RANDOM = np.random.default_rng(5)


def motion(n_axis: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Angle in rad and speed in rad/s of three sines an axis, (N, n_axis)."""
    frequency = 2 * np.pi * np.array([0.7, 1.9, 3.1])[:, None, None]
    phase = RANDOM.uniform(0, 6, (3, 1, n_axis))
    at = frequency * TIME[None, :, None] + phase
    return np.sum(0.3 * np.sin(at), axis=0), np.sum(0.3 * frequency * np.cos(at), axis=0)


def by_label(columns: dict[str, np.ndarray], **more: object) -> dict[str, Guess]:
    return {one.label: one for one in guess_channels(columns, **more).channels}  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "quantity", "side", "reference", "unit"),
    [
        ("rec.act_vel_mot_deg_per_s", "speed", "motor", False, "deg/s"),
        ("rec.act_pos_se_deg", "position", "joint", False, "deg"),
        ("act_torque_abs_nm", "torque", "", False, "N m"),
        ("goal_position", "position", "", True, ""),
        ("TorqueCur", "torque", "", False, ""),
        ("Cur", "current", "", False, ""),
        ("q_soll [rad]", "position", "", True, "rad"),
        ("SetPos_J1_deg", "position", "", True, "deg"),
        ("qref", "position", "", True, ""),
        ("taucmd_1", "torque", "", True, ""),
        ("qmeas", "position", "", False, ""),
        ("iq", "current", "", False, ""),
        ("pos_sp", "position", "", True, ""),
        ("Sollwert Winkel", "position", "", True, ""),
        ("input_volts", "voltage", "", False, ""),
        ("temp", "temperature", "", False, ""),
        ("Temps (s)", "time", "", False, "s"),
        ("Temps [degC]", "temperature", "", False, "degC"),
        ("Couple axe 1 (N.m)", "torque", "", False, "N m"),
        ("Tiempo (ms)", "time", "", False, "ms"),
        ("Drehzahl [1/min]", "speed", "", False, "rpm"),
        ("timestamp_ms", "time", "", False, "ms"),
        ("Tick_ms", "time", "", False, "ms"),
        ("/joint_states.position", "position", "joint", False, ""),
        ("motor_current_mA", "current", "motor", False, "mA"),
        ("vir", "", "", False, ""),
    ],
)
def test_a_name_says_quantity_side_reference_and_unit(
    name: str, quantity: str, side: str, reference: bool, unit: str
) -> None:
    said = said_by(name)
    assert (said.quantity, said.side, said.reference, said.unit) == (quantity, side, reference, unit)


def test_columns_of_several_axes_are_one_channel() -> None:
    position, _ = motion(3)
    columns = {"t": TIME} | {f"Position{i + 1}": position[:, i] for i in range(3)}
    (guess,) = guess_channels(columns).chosen
    assert guess.columns == ("Position1", "Position2", "Position3")
    assert guess.meaning == "motor_position"
    assert guess.n_axis == 3


def test_columns_that_are_called_by_axis_mean_what_the_file_is_called() -> None:
    position, _ = motion(2)
    columns = {"Joint_1": position[:, 0], "Joint_2": position[:, 1]}
    assert by_label(columns, hint="motor_torque")["Joint_"].meaning == "motor_torque"
    assert by_label(columns)["Joint_"].meaning == ""


def test_the_time_is_found_by_its_behaviour() -> None:
    position, _ = motion()
    guesses = guess_channels(
        {"a": position[:, 0], "b": TIME + 5e-5 * RANDOM.uniform(-1, 1, N), "q": position[:, 0]}
    )
    assert guesses.clock is not None
    assert guesses.clock.name == "b"
    assert guesses.clock.step_s == pytest.approx(0.001, rel=0.02)


def test_gaps_and_steps_back_are_counted() -> None:
    times = TIME.copy()
    times[1000:] += 0.5
    times[2000:] -= 0.0015
    clock = clock_of("t", times)
    assert clock is not None
    assert (clock.n_gap, clock.n_back, clock.even) == (1, 1, False)
    assert clock.greatest_s == pytest.approx(0.501)


@pytest.mark.parametrize(
    ("factor", "offset", "unit"),
    [
        (1.0, 0.0, "s"),
        (1e3, 0.0, "ms"),
        (1e6, 0.0, "us"),
        (1e9, 1.7e18, "ns"),
        (1.0, 1.7e9, "s"),
        (1e3, 1.7e12, "ms"),
    ],
)
def test_the_unit_of_a_clock_follows_from_its_size(factor: float, offset: float, unit: str) -> None:
    clock = clock_of("t", TIME * factor + offset)
    assert clock is not None
    assert clock.unit == unit
    assert clock.step_s == pytest.approx(0.001, rel=1e-3)


def test_a_column_that_counts_samples_is_no_time() -> None:
    position, _ = motion()
    guesses = guess_channels({"Time": np.arange(float(N)), "q": position[:, 0]})
    assert guesses.clock is not None
    assert guesses.clock.counts


@pytest.mark.parametrize(("scale", "unit"), [(1.0, "rad/s"), (180 / np.pi, "deg/s"), (30 / np.pi, "rpm")])
def test_a_derivative_is_the_speed_and_tells_its_unit(scale: float, unit: str) -> None:
    position, speed = motion()
    noisy = scale * speed[:, 0] + 0.01 * scale * RANDOM.normal(size=N)
    found = by_label({"t": TIME, "angle [rad]": position[:, 0], "x7a": noisy})["x7a"]
    assert found.meaning == "motor_speed"
    assert found.unit == unit
    factor = derivative_factor(position[:, 0], noisy, TIME)
    assert factor == pytest.approx(scale, rel=0.01)


def test_what_a_position_follows_with_a_delay_is_its_reference() -> None:
    time = np.arange(-50, N) * 0.001
    reference = np.sin(2 * np.pi * time) + 0.3 * np.sin(9 * time)
    measured = reference[40:-10] + 1e-4 * RANDOM.normal(size=N)  # 10 ms late
    ahead = reference[50:]
    assert leads(measured, ahead)
    assert not leads(ahead, measured)
    found = by_label({"t": TIME, "qm": measured, "zz": ahead})
    assert found["zz"].meaning == "position_reference"
    assert found["qm"].meaning == "motor_position"


def test_ranges_tell_degrees_and_counts() -> None:
    position, _ = motion()
    angle = position[:, 0]
    assert by_label({"joint_angle": np.rad2deg(angle)})["joint_angle"].unit == "deg"
    assert by_label({"joint_angle": angle})["joint_angle"].unit == "rad"
    assert by_label({"motor_angle": 100 * angle})["motor_angle"].unit == "rad"
    counts = by_label({"encoder": np.round(4096 * angle)})["encoder"]
    assert counts.unit == "count"
    assert any("counts of an encoder" in reason for reason in counts.reasons)


def test_noise_is_recognised_as_nothing() -> None:
    columns = {name: RANDOM.normal(size=N) for name in ("alpha_7", "b", "zz")}
    guesses = guess_channels(columns)
    assert [one.meaning for one in guesses.channels] == ["", "", ""]
    assert guesses.clock is None


def test_holes_and_constant_columns_are_told() -> None:
    position, _ = motion(2)
    position[5, 0] = np.nan
    position[:, 1] = 3.0
    (guess,) = guess_channels(
        {"pos1": position[:, 0], "pos2": position[:, 1], "gain": np.array(2.5)}
    ).channels
    assert guess.n_missing == 1
    assert guess.constant == ("pos2",)
    assert guess_channels({"gain": np.array(2.5)}).constants == {"gain": 2.5}


def test_columns_of_nothing_but_holes_are_told_and_harm_nobody() -> None:
    position, _ = motion(2)
    found = by_label({"q": position, "vel": np.full((N, 2), np.nan), "big": 1e300 * position[:, 0]})
    assert found["vel"].n_missing == 2 * N
    assert found["vel"].constant == ()
    assert found["q"].first


def test_of_several_torques_the_measured_one_is_taken() -> None:
    tables = {
        name: RANDOM.normal(size=(N, 6)) for name in ("tau_model", "tau_filtered_all", "rec.act_torque")
    }
    assert [one.label for one in guess_channels({"rec.q": motion(6)[0], **tables}).chosen] == [
        "rec.q",
        "rec.act_torque",
    ]


def test_the_derivative_of_an_angle_that_is_called_a_reference_is_one() -> None:
    time = np.arange(2000) * 1e-3
    angle = np.sin(5 * time)
    columns = {"t": time, "q": angle, "vref": 5 * np.cos(5 * time)}
    assert [one.meaning for one in guess_channels(columns).channels] == [
        "time",
        "motor_position",
        "speed_reference",
    ]


def test_a_torque_of_the_current_is_taken_before_one_whose_name_does_not_say_where_it_is_from() -> None:
    tables = {name: RANDOM.normal(size=(N, 6)) for name in ("Torque", "TorqueCur", "torque_current [A]")}
    found = {one.label: one for one in guess_channels({"q": motion(6)[0], **tables}).channels}
    assert found["TorqueCur"].first
    assert "of the motor's current" in found["TorqueCur"].reasons
    assert not found["Torque"].first
    assert found["torque_current [A]"].meaning == "motor_current"


def test_a_column_of_ones_and_zeros_says_when_a_drive_was_enabled() -> None:
    half = (np.arange(N) < N / 2).astype(float)
    position = motion(2)[0]
    found = by_label(
        {"q": position, "drive_enabled": half, "enable_mode": 3 * half, "enabled_never": 0 * half}
    )
    assert found["drive_enabled"].meaning == "enable"
    assert found["drive_enabled"].reasons == ("name", "1 in 50 % of the samples")
    assert not found["drive_enabled"].first  # a setting of a channel, and none of its own
    assert found["enable_mode"].meaning == found["enabled_never"].meaning == ""
