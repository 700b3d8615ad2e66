"""Output error finds what a simulated plant has, over whole runs and over horizons, and states how sure it is."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robid_core import (
    Channel,
    ConfigurationError,
    Context,
    DataRejected,
    DenseRun,
    Record,
    Robot,
    simulate_record,
)
from robid_core.mechanics import SimulationDiverged
from robid_core.stage import map_in_process
from robid_fit import output_error
from robid_fit.time_domain import TimeDomainFit

T = 2e-3
TEXT = """\
robid_robot: 1
name: pendulum
sample_time_s: 0.002
step_s: 0.001
bodies:
  - {joint: swing, axis: [0.0, 1.0, 0.0], mass: 2.0, centre_of_mass: [0.0, 0.0, -0.3],
     inertia: [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.001]]}
axes:
  swing:
    rotor_inertia: 0.01
    torque_limit: 40
    speed_limit: 20
    friction: {coulomb: 0.3, viscous: 0.08, speed: 0.05}
    sensors: {position_noise: POSITION, torque_noise: TORQUE}
    controller: {speed_gain: 2.0, integral_gain: INTEGRAL, position_gain: 8.0}
"""
NAMES = ("friction.swing.coulomb", "friction.swing.viscous", "mass.swing")
FREE = {"free": NAMES, "prior": {"mass.*": 1.0}}


def context(seed: int = 1) -> Context:
    return Context(
        np.random.default_rng(seed), map_in_process, lambda *a, **k: None, logging.getLogger("test")
    )


def pendulum(folder: Path, position: float = 2e-4, torque: float = 0.02, integral: float = 0.0) -> Robot:
    text = TEXT.replace("POSITION", str(position)).replace("TORQUE", str(torque))
    path = folder / f"pendulum_{integral:g}.yaml"
    path.write_text(text.replace("INTEGRAL", str(integral)), encoding="utf-8")
    return Robot.load(str(path))


def record_of(
    plant: Robot, seconds: float = 2.0, seed: int | None = None, n_exp: int = 1, **left_out: Any
) -> Record:
    """Waves from rest, one experiment a phase."""
    time = T * np.arange(round(seconds / T))
    phase = np.arange(n_exp)[:, None, None] * 1.3
    wanted = sum(
        a * (1 - np.cos(2 * np.pi * f * time[:, None] + phase) - (1 - np.cos(phase)))
        for a, f in ((0.5, 0.4), (0.15, 1.7), (0.04, 4.1))
    )
    speed = np.gradient(wanted, T, axis=1)
    done = plant.simulate(speed, np.zeros((n_exp, 1)), seed=seed, position_reference=wanted)
    shape = (1, 1, n_exp, 1, len(time), 1)
    channels = {
        "motor_position": Channel("motor", "rad", done.position.reshape(shape)),
        "motor_torque": Channel("motor", "N m", done.torque.reshape(shape)),
        "position_reference": Channel("motor", "rad", wanted.reshape(shape)),
        "speed_reference": Channel("motor", "rad/s", speed.reshape(shape)),
    }
    for name in left_out.get("without", ()):
        del channels[name]
    run = DenseRun(T, channels, time, np.ones(shape[:-1], dtype=bool))
    return Record(("swing",), "simulated", "zero_order_hold", (run,), np.zeros((1, 1)))


def wrong(plant: Robot) -> Robot:
    """The same robot with a mass, a level and a coefficient that are 20 to 40 % off."""
    factors = dict(zip(NAMES, (1.4, 0.7, 0.8), strict=True))
    return plant.with_parameters({name: plant.parameter(name) * factor for name, factor in factors.items()})


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"outputs": ("motor_position",)},
        {"outputs": ("motor_torque",), "skip_s": 0.2},
        {"horizon_s": 0.3},
        {"horizon_s": 0.3, "outputs": ("motor_position",)},
    ],
)
def test_a_plant_without_noise_is_found(tmp_path: Path, settings: dict[str, Any]) -> None:
    plant = pendulum(tmp_path)
    fit = TimeDomainFit(**FREE, **settings).run((record_of(plant),), wrong(plant), context())
    assert fit.converged
    # Whole runs begin where the plant did: what is left is the tolerance. A window begins at what parabolas through
    # eleven samples tell: of a wave at 4.1 Hz (w 5 T)^2 / 10 = 0.7 % less speed, 0.007 rad/s, and the damping of the
    # loop, 2.08 N m s/rad, takes that for as much less friction: 0.014 N m, 5 % of it, in a part of the windows.
    allowed = 5e-2 if "horizon_s" in settings else 1e-4
    true = np.array([plant.parameter(name) for name in NAMES])
    np.testing.assert_allclose(fit.parameters.estimate, true, rtol=allowed)
    assert fit.model is not None
    assert Robot.of_model(fit.model).parameter("mass.swing") == fit.parameters.value("mass.swing")


def test_where_one_side_of_a_difference_leaves_all_bounds_the_other_one_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ended a fit; where both sides do, the parameter is left alone."""
    plant = pendulum(tmp_path)
    problem = TimeDomainFit(**FREE).problem((record_of(plant),), plant, np.random.default_rng(0))
    point = np.zeros(len(NAMES))
    (central,) = problem.derivatives(point)
    simulate, limit = output_error.simulate_records, plant.parameter(NAMES[0])
    least = 0.0

    def bounded(robot: Robot, *arguments: Any, **options: Any) -> list[Record]:
        if not least <= robot.parameter(NAMES[0]) <= limit:
            raise SimulationDiverged("left all bounds", None)  # type: ignore[arg-type]
        return simulate(robot, *arguments, **options)

    monkeypatch.setattr(output_error, "simulate_records", bounded)
    again = TimeDomainFit(**FREE).problem((record_of(plant),), plant, np.random.default_rng(0))
    (one_sided,) = again.derivatives(point)
    np.testing.assert_array_equal(one_sided[..., 1:], central[..., 1:])
    # A difference to one side errs by half its step of 1e-3 times a second derivative of the slope's own size.
    assert abs(one_sided[..., 0] - central[..., 0]).max() < 2e-3 * abs(central[..., 0]).max()
    assert (one_sided[..., 0] != central[..., 0]).any()
    least = limit
    held = TimeDomainFit(**FREE).problem((record_of(plant),), plant, np.random.default_rng(0))
    (alone,) = held.derivatives(point)
    assert not alone[..., 0].any()


def test_a_torque_that_was_not_recorded_is_not_needed(tmp_path: Path) -> None:
    plant = pendulum(tmp_path)
    record = record_of(plant, without=("motor_torque", "speed_reference"))
    for settings in ({}, {"horizon_s": 0.3}):
        fit = TimeDomainFit(**FREE, outputs=("motor_position",), **settings).run(
            (record,), wrong(plant), context()
        )
        # The speed reference is not in this control law but for its derivative of the position reference: 2nd order.
        assert fit.parameters.value("mass.swing") == pytest.approx(2.0, rel=1e-2)


def test_stated_errors_cover_under_noise_that_the_loop_colours(tmp_path: Path) -> None:
    """Noise of the encoder acts through the controller: residuals are correlated, and count for less than they are."""
    plant = pendulum(tmp_path, position=5e-5, torque=0.05)
    true = np.array([plant.parameter(name) for name in NAMES])
    deviations, fit = [], TimeDomainFit(**FREE)  # type: ignore[arg-type]
    for seed in range(16):
        found = fit.run(
            (record_of(plant, seed=seed),), wrong(plant) if seed < 1 else plant, context()
        ).parameters
        deviations.append((found.estimate - true) / found.standard_error)
    power = (np.array(deviations) ** 2).mean(axis=0)
    # A mean of 16 squares scatters by sqrt(2 / 16) = 0.35, stated variances by sqrt(2 / 41) = 0.22: two of both.
    assert ((power > 1 / 2.2) & (power < 2.2)).all()


def test_the_misfit_is_one_where_noise_is_told_and_more_where_the_model_is_wrong(tmp_path: Path) -> None:
    plant = pendulum(tmp_path)
    fit = TimeDomainFit(**FREE, weights="noise")
    right = fit.run((record_of(plant, seed=5),), plant, context())
    # The noise of the weights is one draw of 1500 correlated samples.
    assert right.misfit == pytest.approx(1.0, abs=0.25)
    other = TimeDomainFit(free=NAMES, fixed=("mass.*",), weights="noise")
    assert other.run((record_of(plant, seed=5),), wrong(plant), context()).misfit > 3


def test_a_horizon_forgives_what_builds_up(tmp_path: Path) -> None:
    """A robot that is wrong leaves less over 0.1 s from measured states than over the whole run."""
    plant = pendulum(tmp_path, integral=5.0)
    record, robot = record_of(plant), wrong(plant)
    position = record.run.values("motor_position")

    def error(horizon_s: float | None) -> float:
        again = simulate_record(robot, record, horizon_s=horizon_s).run.values("motor_position")
        return float(np.sqrt(((again - position) ** 2).mean()))

    assert error(0.04) < 0.3 * error(None)
    exact = simulate_record(plant, record, horizon_s=0.04).run.values("motor_position")
    # What parabolas leave of the state (1 % of the speed at 4 Hz), over 0.04 s.
    assert np.sqrt(((exact - position) ** 2).mean()) < 0.01 * 1.0 * 0.04


def test_records_of_several_variants_share_what_is_free(tmp_path: Path) -> None:
    """Two records of other lengths, the second of the same pendulum under another controller."""
    plant, other = pendulum(tmp_path), pendulum(tmp_path, integral=5.0)
    second = record_of(other, seconds=1.0).replace(variants=("integrating",))
    path = tmp_path / "pendulum_5.yaml"
    start = wrong(plant)
    path.write_text(start.to_yaml().replace("integral_gain: 0.0", "integral_gain: 5.0"), encoding="utf-8")
    assert Robot.load(str(path)).drives.integral_gain[0] == 5.0
    fit = TimeDomainFit(**FREE, robots={"integrating": str(path)}).run(
        (record_of(plant), second), start, context()
    )
    true = np.array([plant.parameter(name) for name in NAMES])
    np.testing.assert_allclose(fit.parameters.estimate, true, rtol=1e-4)
    assert len(fit.time[0].time_s) == 1500
    with pytest.raises(ConfigurationError, match="nothing was measured as 'loaded'"):
        TimeDomainFit(**FREE, robots={"loaded": str(path)}).run((record_of(plant),), start, context())


def test_what_a_simulation_does_not_depend_on_is_refused(tmp_path: Path) -> None:
    plant = pendulum(tmp_path, integral=5.0)
    told = TimeDomainFit(free=("mass.*", "sensors.*")).problems_with(plant)
    assert "a simulation without noise does not depend on it" in told[("free", 1)]
    record = record_of(plant, without=("motor_torque",))
    with pytest.raises(DataRejected, match="the record has no channel motor_torque"):
        TimeDomainFit(**FREE).run((record,), plant, context())
    with pytest.raises(DataRejected, match="initial state of the drives. integrators"):
        TimeDomainFit(**FREE, outputs=("motor_position",), horizon_s=0.3).run((record,), plant, context())
    with pytest.raises(ConfigurationError, match="less than three samples"):
        TimeDomainFit(**FREE, horizon_s=0.002).run((record_of(plant),), plant, context())
    silent = pendulum(tmp_path, 0.0, 0.0)
    with pytest.raises(ConfigurationError, match="states no noise that reaches every output"):
        TimeDomainFit(**FREE, weights="noise").run((record_of(silent),), silent, context())


SERVO = """\
robid_robot: 1
name: servo
sample_time_s: 0.002
step_s: 0.001
bodies:
  - {joint: swing, axis: [0.0, 1.0, 0.0], mass: 0.5, centre_of_mass: [0.0, 0.0, -0.1],
     inertia: [[0, 0, 0], [0, 0, 0], [0, 0, 0]]}
axes:
  swing:
    rotor_inertia: 0.001
    torque_constant: 0.4
    torque_limit: 40
    speed_limit: 20
    friction: {coulomb: 0.03, viscous: 0.01, speed: 0.1}
    sensors: {position_noise: 1.0e-3}
    servo: {duty_gain: 1.2, supply_voltage: 7.4, resistance: 3.2}
"""


def test_motor_and_friction_of_a_servo_are_found_from_its_angle_alone(tmp_path: Path) -> None:
    """Where it is switched off the pendulum swings by itself: friction apart from what the winding brakes."""
    (tmp_path / "servo.yaml").write_text(SERVO, encoding="utf-8")
    plant = Robot.load(str(tmp_path / "servo.yaml"))
    time = T * np.arange(1500)
    shape = (1, 1, 1, 1, len(time), 1)
    channels = {
        "motor_position": Channel("motor", "rad", np.zeros(shape)),
        "position_reference": Channel("motor", "rad", (1.2 * np.sin(9 * time)).reshape(shape)),
        "drive_enabled": Channel("motor", "1", np.where((time > 1) & (time < 1.8), 0.0, 1.0).reshape(shape)),
    }
    run = DenseRun(T, channels, time, np.ones(shape[:-1], dtype=bool))
    record = Record(("swing",), "simulated", "continuous", (run,), np.zeros((1, 1)))
    names = (
        "torque_constant.swing",
        "friction.swing.coulomb",
        "friction.swing.viscous",
        "servo.swing.resistance",
    )
    true = np.array([plant.parameter(name) for name in names])
    start = plant.with_parameters(dict(zip(names, true * (1.3, 0.6, 1.5, 0.8), strict=True)))
    fit = TimeDomainFit(free=names, outputs=("motor_position",)).run(
        (simulate_record(plant, record, seed=3),), start, context()
    )
    assert fit.converged
    assert fit.parameters.names == names
    assert (np.abs(fit.parameters.estimate - true) < 4 * fit.parameters.standard_error).all()
    assert (fit.parameters.standard_error < 0.05 * true).all()
