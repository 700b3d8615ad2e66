"""Friction that falls while a drive warms up, from experiment to experiment: no law of one experiment can tell it."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from robid_core import Context, Record, Robot
from robid_core.stage import map_in_process
from robid_diagnosis.ceilings import SESSION
from robid_diagnosis.effects import Effects

COLD, WARMS_IN = 0.3, 2.5  # of the plant's viscous friction, before the first experiment; experiments


def warming(record: Record) -> Record:
    """The same motions with more viscous friction the earlier they were: what the motor adds for it is that torque."""
    run = record.run
    angle, torque = run.values("motor_position"), run.values("motor_torque")
    n_config, n_block, n_exp, _, n_sample, _ = angle.shape
    omega = 2 * np.pi * np.fft.rfftfreq(n_sample, run.sample_time_s)
    speed = np.fft.irfft(1j * omega[:, None] * np.fft.rfft(angle, axis=4), n_sample, axis=4)
    number = np.arange(n_config * n_block * n_exp).reshape(n_config, n_block, n_exp, 1, 1, 1)
    more = COLD * 2.5e-3 * np.exp(-number / WARMS_IN)
    assert record.line is not None
    return Record.from_arrays(
        motor_position=angle, motor_torque=torque + more * speed, sample_time_s=run.sample_time_s,
        axes="n_config n_block n_exp n_period n_sample n_axis", axis_names=record.axis_names, angle=record.angle,
        excited_hz=record.line / (n_sample * run.sample_time_s), torque_hold="zero_order_hold",
    )  # fmt: skip


def test_friction_that_changes_over_the_session_is_told_as_that(
    told: Robot, plant_of: Callable[[Robot, int], Robot], measured: Callable[..., Record]
) -> None:
    record = warming(measured(plant_of(told, 3), 4))
    context = Context(np.random.default_rng(0), map_in_process, lambda *_: None, logging.getLogger("test"))
    tried = ("friction.viscous", "friction.load_dependent", "friction.angle_dependent")
    stage = Effects.model_validate({"separate": False, "response_check": (), "only": tried})
    found = stage.run((record,), told, context)
    assert [(one.kind, one.effect) for one in found.findings] == [("unknown", f"a function of {SESSION}")]
