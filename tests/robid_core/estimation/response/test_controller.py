"""The controller's frequency response against simulated drives, and its parts against closed forms."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from robid_core import Robot
from robid_core.estimation.response.controller import (
    controller_response,
    drive_signal,
    feedback_from_acceleration,
)

N_SAMPLE, LINE = 500, np.arange(3, 60, 4)


def quiet_robot(position_gain: float, feedforward: float) -> Robot:
    """One axis without friction, gear steps and sensor noise, with a position loop or without."""
    plain = Robot.load("one_axis")
    axes = dict(plain.description.axes)
    name = plain.axis_names[0]
    controller = axes[name].controller.model_copy(
        update={"position_gain": position_gain, "speed_feedforward": feedforward, "integral_gain": 2.0}
    )
    friction = axes[name].friction.model_copy(update={"coulomb": 0.0})
    sensors = axes[name].sensors.model_copy(update={"encoder_counts": 0.0})
    axes[name] = axes[name].model_copy(
        update={"controller": controller, "friction": friction, "sensors": sensors}
    )
    return Robot(plain.description.model_copy(update={"axes": axes}))


@pytest.mark.parametrize(("position_gain", "feedforward"), [(0.0, 1.0), (10.0, 1.0), (10.0, 0.4)])
@pytest.mark.parametrize("own_position", [False, True])
def test_simulated_drives_ask_for_the_torque_that_the_response_says(
    position_gain: float, feedforward: float, own_position: bool
) -> None:
    robot = quiet_robot(position_gain, feedforward)
    step, d = robot.sample_time_s, robot.drives
    generator = np.random.default_rng(0)
    spectrum = np.zeros((2, N_SAMPLE // 2 + 1, 1), dtype=complex)
    spectrum[:, LINE, 0] = np.exp(2j * np.pi * generator.random((2, len(LINE)))) / LINE
    speed, position = np.fft.irfft(spectrum, N_SAMPLE, axis=1) * N_SAMPLE
    periods = 16
    lanes = np.tile(speed[None], (1, periods, 1))
    start = np.array([[0.3]])
    aim = np.tile(0.02 * position[None], (1, periods, 1)) + robot.motor_angle(start)[:, None]
    moved = robot.simulate(lanes, start, position_reference=aim if own_position else None)
    q, u = (np.asarray(x)[0].reshape(periods, N_SAMPLE)[-2:] for x in (moved.position, moved.torque))
    w, p = lanes[0].reshape(periods, N_SAMPLE)[-1], aim[0].reshape(periods, N_SAMPLE)[-1]
    transform = [np.fft.rfft(x)[LINE] / N_SAMPLE for x in (u[-1], q[-1], w, p)]
    response = controller_response(d, step, LINE / (N_SAMPLE * step))
    drive = drive_signal(
        response,
        transform[2][:, None, None],
        transform[3][:, None, None] if own_position else None,
    )[:, 0, 0]
    asked = drive - response.from_angle[:, 0] * transform[1]
    # The drives' sums run over a period that does not quite close: with d(x) what x gains in a period, the
    # transform of x one sample earlier is z^-1 X - d(x) / N, so that e is wrong by d(q) / (T N), and the
    # integral by (K_i T e - d(I) / N) / (1 - z^-1), where d(I) = d(u) - K d(e), |d(e)| <= (k_p + 2 / T) |d(q)|.
    # The reference closes. Twice the bound, plus rounding of sums of a thousand terms.
    gain_q, gain_u = np.abs(q[1] - q[0]).max(), np.abs(u[1] - u[0]).max()
    z = np.exp(2j * np.pi * LINE / N_SAMPLE)
    law = np.abs(d.speed_gain[0] + d.integral_gain[0] * step * z / (z - 1))
    gain_e = (position_gain + 2 / step) * gain_q
    bound = law * gain_q / (step * N_SAMPLE)
    bound += (gain_u + d.speed_gain[0] * gain_e) / (N_SAMPLE * np.abs(1 - 1 / z))
    scale = np.abs(transform[0]).max()
    tolerance = 2 * bound + 1e-12 * scale + 1e-15 * law / step * np.abs(q).max()
    assert tolerance.max() < 1e-4 * np.abs(transform[0]).min()
    assert (np.abs(asked - transform[0]) < tolerance).all()


def test_parts_of_the_controller_in_closed_form() -> None:
    gains: Any = SimpleNamespace(
        speed_gain=np.array([2.0]),
        integral_gain=np.array([3.0]),
        position_gain=np.array([5.0]),
        speed_feedforward=np.array([0.5]),
    )
    # Far below the sampling rate the cascade is the continuous one: (K + K_i / s) (k_f + k_p / s) and (... )(k_p + s).
    f = np.array([0.5, 2.0])
    s, step = 2j * np.pi * f, 1e-6
    found = controller_response(gains, step, f)
    law = 2.0 + 3.0 / s
    assert found.from_speed[:, 0] == pytest.approx(0.5 * law, rel=1e-4)
    assert found.from_position[:, 0] == pytest.approx(5.0 * law, rel=1e-4)
    assert found.from_speed_alone[:, 0] == pytest.approx((0.5 + 5.0 / s) * law, rel=1e-4)
    assert found.from_angle[:, 0] == pytest.approx((5.0 + s) * law, rel=1e-4)
    assert feedback_from_acceleration(found, f)[:, 0] == pytest.approx((5.0 + s) * law / s**2, rel=1e-4)
