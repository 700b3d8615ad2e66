"""The torque residual finds springs, bodies and effects of simulated plants, and states how sure it is."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy
from oracles.multisine import T, context, record_of

from robid_core import (
    Channel,
    ConfigurationError,
    DataRejected,
    DenseRun,
    FreeParameters,
    Record,
    Robot,
    chosen_names,
)
from robid_core.residual import passes
from robid_fit.torque_residual import TorqueResidualFit, lag_words

BODIES = ("mass.*", "centre_of_mass.*", "inertia.*", "rotor_inertia.*")


POSES = np.array([[0.3, 0.4, -0.3, 0.5, 0.6, 0.2], [-0.7, -0.2, 0.5, -0.9, -0.5, 1.0]])


@pytest.fixture(scope="module")
def nominal() -> Robot:
    return Robot.load("six_axis")


@pytest.fixture(scope="module")
def plant(nominal: Robot) -> Robot:
    """Springs, dampers and friction up to 30 % off, bodies by a percent."""
    generator = np.random.default_rng(8)
    kinds = ("stiffness", "damping", "friction")
    moved = {
        name: value * (1 + generator.uniform(-0.3, 0.3))
        for name, value in nominal.parameters().items()
        if nominal.parameter_kind(name) in kinds and not name.endswith(".speed")
    }
    names = chosen_names(list(nominal.layout), BODIES)
    free = FreeParameters.of_robot(nominal.with_parameters(moved), names)
    return free.robot_at(0.01 * generator.standard_normal(len(names)))


@pytest.fixture(scope="module")
def six(plant: Robot, nominal: Robot) -> Record:
    return record_of(plant, nominal, POSES, 3)


def test_springs_of_a_plant_with_other_bodies_and_friction_are_found(
    plant: Robot, nominal: Robot, six: Record
) -> None:
    fit = TorqueResidualFit(passes=4).run((six,), nominal, context())
    table, true = fit.parameters, plant.parameters()
    index = [table.names.index(name) for name in nominal.stiffness_names]
    error = table.estimate[index] / np.array([true[n] for n in nominal.stiffness_names]) - 1
    # From starts up to 30 % off, with bodies told a percent wrong: two poses of 4 s leave some springs at 0.3 %.
    assert np.sqrt((error**2).mean()) < 5e-3
    deviations = error * table.estimate[index] / table.standard_error[index]
    assert np.sqrt((deviations**2).mean()) < 2.5
    assert fit.model is not None
    found = Robot.of_model(fit.model)
    assert found.parameter("gear_stiffness.axis_1") == table.value("gear_stiffness.axis_1")
    errors = fit.model.standard_errors()
    own = [i for i, group in enumerate(table.groups) if group not in ("nuisance", "friction")]
    np.testing.assert_allclose([errors[table.names[i]] for i in own], table.standard_error[own], rtol=1e-9)
    # Functions of speed beside a viscous part say together what the file's three numbers are.
    rubbing = [n for n in plant.layout if n.startswith("friction.") and not n.endswith(".speed")]
    off = np.array([(found.parameter(n) - true[n]) / errors[n] for n in rubbing])
    assert np.sqrt((off**2).mean()) < 2.5
    levels = [n for n in rubbing if n.endswith((".coulomb", ".viscous"))]
    assert max(abs(found.parameter(n) / true[n] - 1) for n in levels) < 0.1
    assert max(abs(nominal.parameter(n) / true[n] - 1) for n in levels) > 0.2
    # Four passes do not converge, and say how far they were; the plant has no lag, and none is told.
    assert re.match(r"4 passes did not suffice; the last one changed .* standard errors", fit.status)
    assert "torque lags" not in fit.status
    # 2 x 6 experiments tell the noise of each bin from 204 differences: 0.95 to 1.05 in all, bands scatter by more.
    assert fit.misfit == pytest.approx(1.0, abs=0.05)
    assert fit.misfit_table is not None
    assert np.nanmax(fit.misfit_table.lines) < 1.5
    assert np.nanmax(fit.misfit_table.other) < 1.3
    assert set(table.groups) >= {"stiffness", "damping", "inertia", "nuisance"}


def test_a_hidden_effect_is_found_where_the_file_frees_it(tmp_path: Path) -> None:
    """A gear that stiffens: the file states the law with the wrong size; nothing but its name is given to the fit."""

    def robot(cubic: float, name: str) -> Robot:
        path = tmp_path / f"{name}.yaml"
        path.write_text(
            f"robid_robot: 1\nname: {name}\nbase: one_axis\n"
            f"effects:\n  hard: {{use: transmission.stiffening, on: axis_1, with: {{cubic: {cubic}}}}}\n"
        )
        return Robot.load(str(path))

    told, true = 6e8, 1.2e9  # at the torque here the gear is a quarter stiffer than its spring
    nominal = robot(told, "told")
    record = record_of(robot(true, "hidden"), nominal, np.array([[0.4], [-0.8], [1.5]]), 5, blocks=2)
    stage = TorqueResidualFit(free=("gear_*", "friction.*.viscous", "effect.hard.cubic"), passes=12)
    fit = stage.run((record,), nominal, context())
    found, error = (
        fit.parameters.value("effect.hard.cubic"),
        fit.parameters.standard_error[fit.parameters.names.index("effect.hard.cubic")],
    )
    assert error < 1e-3 * true
    assert abs(found - true) < 4 * error
    assert "converged" in fit.status
    assert fit.model is not None
    fitted = Robot.of_model(fit.model)
    assert fitted.parameter("effect.hard.cubic") == found
    reference = (30 * np.sin(2 * np.pi * 8 * np.arange(500) * 0.001))[None, :, None]
    ours, right, before = (
        r.simulate(reference, np.array([[0.4]])).torque for r in (fitted, robot(true, "hidden"), nominal)
    )
    assert np.abs(ours - right).max() < 0.1 * np.abs(before - right).max()
    spring = fit.parameters.value("gear_stiffness.axis_1")
    assert spring == pytest.approx(robot(true, "hidden").parameter("gear_stiffness.axis_1"), rel=1e-3)


@pytest.mark.full
def test_a_cut_that_does_not_repeat_is_fitted_as_well(plant: Robot, nominal: Robot, six: Record) -> None:
    """2.7 s from the middle of each experiment, told without lines: what swung at its start is unknown."""
    run = six.run
    first, last = 1300, 4000
    channels = {}
    for name, channel in run.channels.items():
        joined = channel.values.reshape(2, 1, 6, 1, -1, 6)[:, :, :, :, first:last]
        channels[name] = Channel(channel.side, channel.unit, joined)
    time = T * np.arange(last - first)
    cut = DenseRun(T, channels, time, np.ones((2, 1, 6, 1, last - first), dtype=bool))
    fit = TorqueResidualFit().run((six.replace(runs=(cut,), line=None),), nominal, context())
    assert fit.converged
    table, true = fit.parameters, plant.parameters()
    index = [table.names.index(name) for name in nominal.stiffness_names]
    springs = np.array([true[name] for name in nominal.stiffness_names])
    error = table.estimate[index] - springs
    assert np.sqrt(((error / springs) ** 2).mean()) < 1e-3
    stated = error / table.standard_error[index]
    assert (stated**2).sum() < scipy.stats.chi2.isf(1e-3, len(index))


def test_ripple_that_nobody_told_is_seen_and_bins_that_hold_it_count_less(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A cogging of 0.5 % of the limit: the misfit tells it; weights by what is left make the interval half as wide."""
    nominal, spring = Robot.load("one_axis"), "gear_stiffness.axis_1"
    plant = nominal.with_parameters({spring: 1.3 * nominal.parameter(spring)})
    size = {"amplitude": 0.005 * float(nominal.drives.torque_limit[0]), "order": 2.0}
    wavy = plant.with_effect("wave", "drive.cogging", on="axis_1", values=size)
    record = record_of(wavy, nominal, np.array([[0.4], [-0.8]]), 7, blocks=2)
    stated = []
    for doubtful in (np.inf, passes.DOUBTFUL):
        monkeypatch.setattr(passes, "DOUBTFUL", doubtful)
        fit = TorqueResidualFit().run((record,), nominal, context())
        stated.append(fit.parameters.standard_error[fit.parameters.names.index(spring)])
        assert abs(fit.parameters.value(spring) - plant.parameter(spring)) < 3 * stated[-1]
        assert fit.misfit > 1.5
        assert any(doubt.kind == "misfit" for doubt in fit.doubts)
    assert stated[1] < 0.6 * stated[0]


def test_laws_on_signals_are_known_to_the_fit_and_their_sizes_are_found() -> None:
    """Ripple and a resolver's wave, told half as large; a torque that is reported 2 % too large, a lag of the current.

    Sizes are found within three standard errors, and what is left is noise. Without these laws it is not.
    """
    bare = Robot.load("one_axis")
    limit = float(bare.drives.torque_limit[0])

    def with_laws(share: float) -> Robot:
        robot = bare
        for label, use, side, values in (
            ("ripple", "drive.torque_ripple", "torque", {"amplitude": 0.02 * limit * share, "order": 6.0}),
            ("wave", "sensing.resolver_ripple", "position", {"amplitude": 1e-3 * share, "order": 2.0}),
            ("much", "sensing.gain_error", "torque_measurement", {"error": 0.02}),
            ("lag", "drive.current_loop", "torque", {"time_constant": 4e-4}),
        ):
            robot = robot.with_effect(label, use, "axis_1", side, values)
        return robot

    spring = "gear_stiffness.axis_1"
    plant, told = with_laws(1.0).with_parameters({spring: 1.3 * bare.parameter(spring)}), with_laws(0.5)
    record = record_of(plant, bare, np.array([[0.4], [-0.8]]), 7, blocks=2)
    names = ("effect.ripple.amplitude", "effect.wave.amplitude")
    fit = TorqueResidualFit(free=("gear_*", "friction.*.viscous", *names)).run((record,), told, context())
    table = fit.parameters
    for name in (spring, *names):
        error = table.standard_error[table.names.index(name)]
        assert error < 0.05 * plant.parameter(name)
        assert abs(table.value(name) - plant.parameter(name)) < 3 * error, name
    assert fit.misfit == pytest.approx(1.0, abs=0.1)
    assert TorqueResidualFit(free=("gear_*", "friction.*.viscous")).run((record,), told, context()).misfit > 2


def test_two_payloads_share_the_springs(tmp_path: Path, plant: Robot, nominal: Robot) -> None:
    """One pose without and one with 8 kg at the flange: each robot has its bodies, both have the same springs.

    The bodies are those of the drawing and held: that they can be free is shown above.
    """
    bodies = chosen_names(list(nominal.layout), BODIES)
    plant = plant.with_parameters({name: nominal.parameter(name) for name in bodies})
    load = "effects:\n  load: {use: load.payload, on: axis_6, with: {mass: 8.0, z: 0.1}}\n"
    path = tmp_path / "loaded.yaml"
    path.write_text(f"robid_robot: 1\nname: loaded\nbase: six_axis\n{load}")
    loaded = plant.with_effect("load", "load.payload", on="axis_6", values={"mass": 8.0, "z": 0.1})
    parts = [record_of(robot, nominal, POSES[[k]], 3 + k) for k, robot in enumerate((plant, loaded))]
    channels = {
        name: Channel(one.side, one.unit, np.concatenate([part.run.values(name) for part in parts]))
        for name, one in parts[0].run.channels.items()
    }
    valid = np.concatenate([part.run.valid for part in parts])
    both = parts[0].replace(
        runs=(DenseRun(T, channels, parts[0].run.time_s, valid),), angle=POSES, variants=("bare", "loaded")
    )
    fit = TorqueResidualFit(robots={"loaded": str(path)}, fixed=BODIES).run((both,), nominal, context())
    table, true = fit.parameters, plant.parameters()
    index = [table.names.index(name) for name in nominal.stiffness_names]
    error = table.estimate[index] / np.array([true[n] for n in nominal.stiffness_names]) - 1
    assert np.sqrt((error**2).mean()) < 1e-3
    assert fit.misfit == pytest.approx(1.0, abs=0.05)
    with pytest.raises(ConfigurationError, match="give the robot of each that is not the nominal one"):
        TorqueResidualFit().run((both,), nominal, context())
    with pytest.raises(ConfigurationError, match="nothing was measured as 'heavy'"):
        TorqueResidualFit(robots={"heavy": str(path)}).run((both,), nominal, context())


def test_cuts_of_different_lengths_are_fitted_together() -> None:
    """Recordings of 3.5 s, 6 s and 5 s in three poses: as one record of as many would be, nearer than each alone."""
    nominal = Robot.load("one_axis")
    (name,) = nominal.stiffness_names
    plant = nominal.with_parameters({name: 0.8 * nominal.parameter(name), "friction.axis_1.coulomb": 0.4})
    records = []
    for number, (pose, last) in enumerate(((0.3, 3500), (-0.8, 6000), (0.9, 5000))):
        whole = record_of(plant, nominal, np.array([[pose]]), 40 + number)
        channels = {
            own: Channel(one.side, one.unit, one.values.reshape(1, 1, 1, 1, -1, 1)[:, :, :, :, :last])
            for own, one in whole.run.channels.items()
        }
        run = DenseRun(T, channels, T * np.arange(last), np.ones((1, 1, 1, 1, last), dtype=bool))
        records.append(whole.replace(runs=(run,), line=None))
    together, *alone = [
        TorqueResidualFit().run(own, nominal, context()).parameters
        for own in (tuple(records), *((one,) for one in records))
    ]
    error = [table.standard_error[table.names.index(name)] for table in (together, *alone)]
    assert abs(together.value(name) - plant.parameter(name)) < 4 * error[0]
    # Independent recordings: what each tells of the spring adds up, times what three groups make of it (a jackknife).
    assert error[0] == pytest.approx(np.sum(1 / np.square(error[1:])) ** -0.5, rel=0.5)


@pytest.mark.parametrize(
    ("settings", "error", "told"),
    [
        ({"free": ("gear_stifness.*",)}, ConfigurationError, "did you mean 'gear_stiffness"),
        ({"free": ("controller.*",)}, ConfigurationError, "the torque residual does not depend on it"),
        ({"free": ("friction.*",)}, ConfigurationError, "free functions of speed stand in its place"),
        ({"prior": {"torque_limit.*": 0.1}}, ConfigurationError, "held fixed"),
        ({"discard": 1}, DataRejected, "two are needed to estimate the noise"),
        ({"highest_hz": 2000.0}, DataRejected, "a band up to 2000 Hz"),
    ],
)
def test_what_cannot_be_fitted_is_refused_with_the_reason(
    nominal: Robot, six: Record, settings: dict[str, Any], error: type[Exception], told: str
) -> None:
    with pytest.raises(error, match=told):
        TorqueResidualFit(**settings).run((six,), nominal, context())


def test_a_record_and_a_robot_file_that_are_sampled_otherwise_are_refused(
    nominal: Robot, six: Record
) -> None:
    (run,) = six.runs
    slower = six.replace(runs=(run.replace(sample_time_s=2 * run.sample_time_s, time_s=2 * run.time_s),))
    with pytest.raises(ConfigurationError, match="set sample_time_s in the robot file"):
        TorqueResidualFit().run((slower,), nominal, context())


@pytest.mark.parametrize(("late", "doubted"), [(1, False), (5, True), (20, True)])
def test_channels_that_are_samples_apart_are_doubted(late: int, doubted: bool) -> None:
    """One sample is fitted exactly; more than drives differ by is told as what it is, not as a misfit alone."""
    nominal, plant = Robot.load("one_axis"), Robot.load("one_axis_true")
    record = record_of(plant, nominal, np.array([[0.3], [-0.8]]), 3)
    run, torque = record.run, record.run.channels["motor_torque"]
    moved = Channel(torque.side, torque.unit, np.roll(torque.values, late, axis=4))
    runs = (DenseRun(T, {**run.channels, "motor_torque": moved}, run.time_s, run.valid),)
    fit = TorqueResidualFit().run((record.replace(runs=runs),), nominal, context())
    (name,) = nominal.stiffness_names
    if not doubted:
        assert fit.parameters.value("torque_delay") == pytest.approx(late * T, abs=0.01 * T)
        assert fit.parameters.value(name) == pytest.approx(plant.parameter(name), rel=1e-3)
    (said,) = [doubt for doubt in fit.doubts if doubt.kind == "timing"]
    assert said.is_remark != doubted
    assert f"the torque lags the angles by {'1.00' if late == 1 else ''}" in said.sentence
    assert doubted or "motor_torque: delay_s: 0.001" in said.remedy


def test_a_fit_that_leads_nowhere_from_the_nominal_robot_begins_anew_from_several_starts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first search is made to end at half the stiffness, unsettled, as one does that took a resonance for another.

    Asked for one start, or where passes settle, there is no second search.
    """
    robot = Robot.load("one_axis")
    record = record_of(robot, robot, np.array([[0.2], [-0.5]]), 3)
    searches: list[int] = []
    settled = passes.solve

    def astray(problem: Any, limit: int, error: float, progress: Any, starts: Any = (), **more: Any) -> Any:
        solution = settled(problem, limit, error, progress, starts, **more)
        searches.append(1 + len(starts))
        if starts or "begin" in more:
            return solution
        point = solution.point.copy()
        point[problem.free.names.index("gear_stiffness.axis_1")] -= np.log(2.0)
        return dataclasses.replace(solution, point=point, converged=False)

    fit = TorqueResidualFit().run((record,), robot, context())
    assert (fit.n_starts, fit.converged) == (1, True)
    monkeypatch.setattr("robid_fit.torque_residual.solve", astray)
    fit = TorqueResidualFit(friction_widths=(0.5, 5.0)).run((record,), robot, context())
    assert (searches, fit.n_starts, fit.converged) == ([1, 8], 8, True)
    assert fit.parameters.value("gear_stiffness.axis_1") == pytest.approx(
        robot.parameter("gear_stiffness.axis_1"), rel=1e-2
    )
    searches.clear()
    fit = TorqueResidualFit(friction_widths=(0.5, 5.0), starts=1).run((record,), robot, context())
    assert (searches, fit.n_starts, fit.converged) == ([1], 1, False)


def test_starts_stay_where_a_robot_can_be() -> None:
    """Friction of a nominal robot without any is drawn around nothing, and never below."""
    robot = Robot.load("one_axis").with_parameters({"friction.axis_1.viscous": 0.0})
    record = record_of(robot, robot, np.array([[0.2], [-0.5]]), 3)
    fit = TorqueResidualFit(starts=6).run((record,), robot, context())
    assert fit.converged
    assert fit.n_starts == 6


@pytest.mark.parametrize(
    ("lag", "error", "told"),
    [
        ([-8.3e-9], [5e-9], ""),
        ([5e-4], [1e-6], "; torque lags by 500 ± 1 us"),
        ([5e-4, 1e-9], [1e-6, 1e-6], "; torque lags by 500 ± 1, 0.001 ± 1 us"),
    ],
)
def test_a_lag_below_its_error_is_not_told(lag: list[float], error: list[float], told: str) -> None:
    assert lag_words(np.array(lag), np.array(error)) == told
