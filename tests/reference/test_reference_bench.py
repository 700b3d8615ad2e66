"""The reference bench in small: three plants, few lines, short periods; and its average against closed forms."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from reference import cache
from reference.answer import answer, load
from reference.best_linear_approximation import Batch, Moments, moments_of, motor_speeds, simulated_batch
from reference.bounds import noise_covariance, response_variance
from reference.build import main
from reference.excitation_class import SHIPPED, ExcitationClass, shipped_class
from reference.metrics import rms_log_error
from reference.plants import BASES, ReferencePlant, reference_plant, without_effects, without_sensor_errors
from reference.reference_pose import ReferencePose
from ruamel.yaml import YAML

from robid_core import Robot
from robid_core.estimation.distortion.speed import speed_levels
from robid_core.estimation.excitation.multisine import flat_torque_amplitude
from robid_core.robot.file.description import RobotDescription
from robid_excitation.multisine import Multisine

FloatArray = npt.NDArray[np.float64]

SMALL: dict[str, Any] = {"band_hz": (5.0, 60.0), "lines": 10, "period_s": 1.0}
SETTLE_S = 1.0


# Plants -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("base", BASES)
def test_a_plant_goes_to_yaml_and_loads_again_equal(base: str, tmp_path: Path) -> None:
    plant = reference_plant(1, base)
    again = Robot.load(str(plant.write(tmp_path)))
    assert again == plant.robot
    assert again.to_yaml() == plant.robot.to_yaml()
    assert again.parameters() == plant.robot.parameters()


def test_the_same_seed_gives_the_same_plant() -> None:
    once, twice, other = reference_plant(2), reference_plant(2), reference_plant(3)
    assert once.robot == twice.robot
    assert np.array_equal(once.pose, twice.pose)
    for name, value in once.robot.parameters().items():
        if once.robot.parameter_kind(name) in ("stiffness", "damping", "friction") and value:
            assert value != other.robot.parameters()[name], name
    assert not np.isclose(once.pose, other.pose).any()


def test_the_plants_of_every_claim_made_so_far_stand() -> None:
    # Numbers of plant 1 as they were drawn first: who changes them makes every earlier figure incomparable.
    plant = reference_plant(1)
    values = plant.robot.parameters()
    drawn = {
        "gear_stiffness.axis_1": 428800.6783548935,
        "friction.axis_2.coulomb": 1.3689518560114442,
        "effect.offset_ripple_axis_3.amplitude": 0.15941433163139138,
    }
    assert {name: values[name] for name in drawn} == pytest.approx(drawn, rel=1e-12)
    assert plant.robot.drives.speed_gain[3] == pytest.approx(0.02424936621575652, rel=1e-12)
    assert plant.pose[7, 5] == pytest.approx(-1.34972837648205, rel=1e-12)


@pytest.mark.parametrize("index", [1, 2, 3])
def test_a_plant_differs_from_what_its_user_believes_within_the_stated_bounds(index: int) -> None:
    plant = reference_plant(index)
    ratio = plant.stiffness / plant.nominal.spring_arrays()[0]
    assert (ratio > 0.7).all()
    assert (ratio < 1.3).all()
    assert np.ptp(ratio) > 0.1
    assert np.array_equal(plant.nominal.drives.speed_gain, plant.robot.drives.speed_gain)
    assert np.array_equal(plant.nominal.drives.position_noise, plant.robot.drives.position_noise)
    assert not plant.nominal.effects
    drives = plant.robot.drives
    assert ((plant.pose > drives.lower) & (plant.pose < drives.upper)).all()
    assert (np.abs(plant.robot.gravity_torque(plant.pose)) < 0.6 * drives.torque_limit).all()


# Excitation -------------------------------------------------------------------------------------------------------


def test_the_benchs_excitation_is_that_of_the_worked_example_in_twice_the_time() -> None:
    text = (Path(__file__).parents[2] / "pipeline.yaml").read_text(encoding="utf-8")
    stage = YAML(typ="safe", pure=True).load(text)["stages"]["excite"]
    assert stage["use"] == "excitation.multisine"
    assert Multisine.model_validate_json(json.dumps(stage["with"] | {"period_s": 8})) == Multisine(**SHIPPED)


def test_a_block_has_the_spectrum_of_its_class_and_orthogonal_experiments() -> None:
    excitation = shipped_class(reference_plant(1, "three_axis"), **SMALL)
    fast, slow = excitation.block(np.random.default_rng(0))
    spectrum = np.fft.rfft(fast, axis=1) / excitation.n_sample  # (n_exp, n_bin, n_axis)
    r = spectrum[:, excitation.line].transpose(1, 2, 0)
    gram = r @ r.conj().swapaxes(-1, -2)
    # Orthogonal experiments: R R^H = n_axis diag(A^2 / 4), to rounding.
    wanted = 3 * np.einsum("fa,ab->fab", excitation.amplitude**2 / 4, np.eye(3))
    assert abs(gram - wanted).max() < 1e-12 * wanted.max()
    spectrum[:, excitation.line] = 0
    assert abs(spectrum).max() < 1e-12 * excitation.amplitude.max()
    assert abs(np.fft.rfft(slow, axis=0)[2]) / excitation.n_sample == pytest.approx(
        excitation.sine_amplitude / 2
    )


# Best linear approximation ----------------------------------------------------------------------------------------


def slides() -> Robot:
    """Three sliding axes in directions not square to one another: linear, coupled, resonances at 15 to 40 Hz."""
    directions = np.array([[1.0, 0, 0], [0.6, 0.8, 0], [0.5, 0.3, 0.8]])
    names = [f"axis_{a + 1}" for a in range(3)]
    bodies = [
        {
            "joint": name,
            "parent": names[a - 1] if a else None,
            "type": "prismatic",
            "axis": list(directions[a] / np.linalg.norm(directions[a])),
            "mass": 12.0 - 3 * a,
            "inertia": np.eye(3).tolist(),
        }
        for a, name in enumerate(names)
    ]
    axis = {
        "gear_ratio": 200.0,
        "rotor_inertia": 5e-4,
        "torque_limit": 1e3,
        "speed_limit": 1e4,
        "gear": {"stiffness": 2e5, "damping": 200.0},
        "friction": {"coulomb": 0.0, "viscous": 1e-3},
        "sensors": {"position_noise": 2e-3, "torque_noise": 0.02},
        "controller": {"speed_gain": 0.03, "integral_gain": 0.3},
    }
    data = {"robid_robot": 1, "name": "slides", "gravity": [0, 0, 0], "bodies": bodies, "step_s": 1e-4}
    text = json.dumps({**data, "axes": dict.fromkeys(names, axis)})
    return Robot(RobotDescription.model_validate_json(text))


@pytest.fixture(scope="module")
def noisy_slides() -> tuple[Robot, ExcitationClass, Moments]:
    """Average over 64 blocks of three experiments on a linear plant whose sensors are noisy."""
    robot = slides()
    line = np.arange(5, 85, 2)
    crossover = robot.drives.speed_gain / (2 * np.pi * 1e-3)
    amplitude = flat_torque_amplitude(line.astype(float), crossover, np.full(3, 4.0))
    excitation = ExcitationClass(line, amplitude, 2, np.full(3, 2.0), 1000, 1e-3, 1)
    total = None
    for first in range(0, 64, 8):
        batch = simulated_batch(
            robot, np.zeros(3), excitation, np.random.SeedSequence(5), range(first, first + 8), settle_s=2.0,
            noise_seed=100 + first,
        )  # fmt: skip
        moments = moments_of(batch.u, batch.y, batch.r)
        total = moments if total is None else total + moments
    assert total is not None
    return robot, excitation, total


def test_the_average_of_a_linear_plant_is_its_response(
    noisy_slides: tuple[Robot, ExcitationClass, Moments],
) -> None:
    robot, excitation, moments = noisy_slides
    error = moments.response - robot.response(np.zeros((1, 3)), excitation.frequency_hz)[0]
    # With 56 complex degrees of freedom |error|^2 / variance is F(2, 112): mean 1.02, deviation 1.04. Nine entries of a
    # line may go together, 40 lines do not: the mean over lines has a deviation of 0.17 at most. Five of
    # them; the simulation's own error, 1e-5 of G at this step, is 1e-2 of the standard error.
    z = np.abs(error) ** 2 / moments.variance
    assert np.median(np.sqrt(moments.variance) / np.abs(moments.response)) > 1e-3
    assert 1.02 - 5 * 0.17 < z.mean() < 1.02 + 5 * 0.17
    # An error common to all lines (a delay, a gain) would hide in that mean: of the diagonal it is averaged out.
    diagonal = np.einsum("fii->fi", error / moments.response)
    deviation = (
        np.sqrt(np.einsum("fii->fi", moments.variance / np.abs(moments.response) ** 2).sum()) / diagonal.size
    )
    assert abs(diagonal.mean()) < 5 * deviation


def test_its_scatter_is_that_of_the_sensors_noise(
    noisy_slides: tuple[Robot, ExcitationClass, Moments],
) -> None:
    robot, excitation, moments = noisy_slides
    noise = noise_covariance(robot, moments.response, excitation.frequency_hz, excitation.n_sample)
    predicted = response_variance(moments.input_gram, noise)
    # 56 complex degrees of freedom on each of 40 lines: deviation 2.1 % if the entries of a line go together.
    assert np.mean(moments.block_variance / predicted) == pytest.approx(1, abs=5 * 0.021)
    assert np.mean(np.einsum("fii->fi", moments.distortion / noise).real) == pytest.approx(1, abs=5 * 0.021)


@pytest.fixture(scope="module")
def rubbing() -> tuple[ReferencePlant, ExcitationClass, Batch]:
    """One axis with friction and ripple, 96 realisations."""
    plant = reference_plant(1, "one_axis")
    excitation = shipped_class(plant, **SMALL)
    robot = without_sensor_errors(plant.robot)
    seed = np.random.SeedSequence(1)
    return (
        plant,
        excitation,
        simulated_batch(robot, plant.pose[0], excitation, seed, range(96), settle_s=SETTLE_S),
    )


def part(batch: Batch, which: slice) -> Moments:
    """Moments of some realisations."""
    return moments_of(batch.u[which], batch.y[which], batch.r[which])


def test_standard_error_is_the_scatter_of_averages(
    rubbing: tuple[ReferencePlant, ExcitationClass, Batch],
) -> None:
    batch = rubbing[2]
    groups = [part(batch, slice(first, first + 4)) for first in range(0, 96, 4)]
    stated = np.mean([group.variance for group in groups], axis=0)
    scatter = np.var([group.response for group in groups], axis=0, ddof=1)
    # 23 complex degrees of freedom of the scatter and 72 of the stated variance, averaged over 10 lines: 7.6 %.
    assert np.mean(scatter / stated) == pytest.approx(1.01, abs=5 * 0.076)


def test_standard_error_falls_with_the_root_of_realisations(
    rubbing: tuple[ReferencePlant, ExcitationClass, Batch],
) -> None:
    few, many = part(rubbing[2], slice(0, 12)), part(rubbing[2], slice(None))
    # 11 and 95 complex degrees of freedom, averaged over 10 lines: 10 % of the ratio of variances.
    assert np.mean(few.variance / many.variance) == pytest.approx(96 / 12, rel=5 * 0.1)


def test_with_friction_the_average_is_near_the_response_with_equivalent_damping(
    rubbing: tuple[ReferencePlant, ExcitationClass, Batch],
) -> None:
    plant, excitation, batch = rubbing
    moments = part(batch, slice(None))
    damping = plant.robot.equivalent_motor_damping(batch.speed_rms, batch.sine_speed)
    seen = np.ones(moments.response.shape, dtype=bool)
    pose, bare = plant.pose[:1], without_effects(plant.robot)
    distance = {
        name: rms_log_error(bare.response(pose, excitation.frequency_hz, extra)[0], moments.response, seen)
        for name, extra in (("viscous", None), ("equivalent", damping[None]))
    }
    own = np.sqrt(np.mean(moments.variance / np.abs(moments.response) ** 2))
    assert distance["viscous"] > 10 * own  # else nothing is shown
    assert distance["equivalent"] < 0.3 * distance["viscous"]


def test_the_motion_has_the_pose_in_its_middle(
    rubbing: tuple[ReferencePlant, ExcitationClass, Batch],
) -> None:
    _, excitation, batch = rubbing
    # A motion that began at the pose would have its middle off by an amplitude of the slow sine's travel, at ratio 100.
    travel = excitation.sine_amplitude[0] / (2 * np.pi * excitation.sine_bin) / 100
    assert batch.off_pose < 0.2 * travel


def test_motor_speeds_are_those_that_a_record_states(
    rubbing: tuple[ReferencePlant, ExcitationClass, Batch],
) -> None:
    excitation = rubbing[1].changed(sine_amplitude=np.array([60.0]))  # a record finds a sine that stands out
    fast, slow = excitation.block(np.random.default_rng(0))
    position = np.cumsum(fast + slow, axis=1) * excitation.sample_time_s
    theirs = speed_levels(position[:, None], excitation.line, excitation.sample_time_s)
    ours = motor_speeds(np.fft.rfft(position, axis=1) / excitation.n_sample, excitation)
    assert np.allclose(ours, theirs, rtol=1e-9)
    # Cumulated and differentiated in frequency: w T / 2 / sin(w T / 2), 1 % at 60 Hz and 1 kHz.
    assert ours[0] == pytest.approx(np.sqrt(np.mean(fast**2)), rel=0.02)
    assert ours[1] == pytest.approx(60.0, rel=1e-4)


# The bench --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small_bench(tmp_path_factory: pytest.TempPathFactory) -> dict[int, tuple[ReferencePlant, ReferencePose]]:
    """Three plants of six axes in one pose each."""
    folder = tmp_path_factory.mktemp("bench")
    bench = {}
    for index in (1, 2, 3):
        plant = reference_plant(index)
        excitation = shipped_class(plant, **SMALL)
        bench[index] = plant, answer(plant, 1, excitation, folder, precision=0.6, settle_s=SETTLE_S, jobs=1)
    return bench


def test_three_plants_are_averaged_to_the_precision_that_was_asked(
    small_bench: dict[int, tuple[ReferencePlant, ReferencePose]],
) -> None:
    for _, known in small_bench.values():
        # Distortion rules, so that the ratio is sqrt(4 / blocks) at most.
        n = known.moments.n_realization
        assert 0.9 * np.sqrt(4 / n) < known.precision <= min(0.6, np.sqrt(4 / n))
        assert known.saturated == 0
        assert (
            known.transient < 0.05
        )  # of the distortion; the average over 16 blocks moves by a quarter of it at most
        size = np.abs(known.response)
        assert np.median(np.einsum("fii->fi", known.standard_error / size)) < 0.05
        assert np.einsum("fii->fi", known.seen).all()


def test_the_linear_model_with_equivalent_damping_is_nearer_than_without(
    small_bench: dict[int, tuple[ReferencePlant, ReferencePose]],
) -> None:
    for plant, known in small_bench.values():
        bare = without_effects(plant.robot).response(known.angle[None], known.frequency_hz)[0]
        near = rms_log_error(known.linear_response, known.response, known.seen)
        assert near < 0.5 * rms_log_error(bare, known.response, known.seen)


def one_axis_answer(folder: Path, **options: Any) -> tuple[list[str], ReferencePose]:
    """Answer about one axis in small; also what was told."""
    plant = reference_plant(1, "one_axis")
    told: list[str] = []
    excitation = shipped_class(plant, **SMALL)
    known = answer(plant, 1, excitation, folder, settle_s=SETTLE_S, batch=4, tell=told.append, **options)
    return told, known


def only_file(folder: Path) -> Path:
    """The only file of a folder, hidden ones counted."""
    (path,) = folder.iterdir()
    return path


def test_a_finished_pose_is_read_and_not_computed(tmp_path: Path) -> None:
    told, first = one_axis_answer(tmp_path, precision=0.01, most=16)
    assert len(told) == 4
    told, again = one_axis_answer(tmp_path, precision=0.01, most=16)
    assert told == []
    assert np.array_equal(again.response, first.response)
    assert again.precision == first.precision


def test_stopping_and_going_on_gives_the_same_bytes_on_any_number_of_threads(tmp_path: Path) -> None:
    at_once, in_steps = tmp_path / "at once", tmp_path / "in steps"
    one_axis_answer(at_once, precision=0.01, most=24, jobs=2)
    for most in (8, 16, 24):
        one_axis_answer(in_steps, precision=0.01, most=most, jobs=1)
    assert only_file(at_once).name == only_file(in_steps).name
    assert only_file(at_once).read_bytes() == only_file(in_steps).read_bytes()


def test_another_question_gets_another_file(tmp_path: Path) -> None:
    one_axis_answer(tmp_path, most=8)
    plant = reference_plant(1, "one_axis")
    louder = shipped_class(plant, **SMALL, torque_share=0.4)
    answer(plant, 1, louder, tmp_path, settle_s=SETTLE_S, batch=4, most=8)
    answer(plant, 2, louder, tmp_path, settle_s=SETTLE_S, batch=4, most=8)
    assert len(list(tmp_path.iterdir())) == 3


def test_code_that_changed_without_effect_takes_the_file_over(tmp_path: Path) -> None:
    one_axis_answer(tmp_path, precision=0.01, most=16)
    path = only_file(tmp_path)
    content = path.read_bytes()
    path.replace(path.with_name(path.name.rpartition("-")[0] + "-00000000.npz"))
    told, _ = one_axis_answer(tmp_path, precision=0.01, most=16)
    assert [text for text in told if "taken over" in text] == told
    assert only_file(tmp_path) == path
    assert path.read_bytes() == content


def test_code_that_computes_something_else_builds_the_file_again(tmp_path: Path) -> None:
    one_axis_answer(tmp_path, precision=0.01, most=8)
    path = only_file(tmp_path)
    content = path.read_bytes()
    with np.load(path) as file:
        arrays = dict(file)
    arrays["first_y"] = arrays["first_y"] * (1 + 1e-6)
    path.unlink()
    with path.with_name(path.name.rpartition("-")[0] + "-00000000.npz").open("wb") as file:
        np.savez(file, **arrays)
    told, _ = one_axis_answer(tmp_path, precision=0.01, most=8)
    assert "built again" in told[0]
    assert path.read_bytes() == content


def test_comments_and_docstrings_are_not_code(tmp_path: Path) -> None:
    plain, dressed, other = (tmp_path / name for name in ("plain.py", "dressed.py", "other.py"))
    plain.write_text("def f(x):\n    return x + 1\n", encoding="utf-8")
    dressed.write_text(
        '"""What."""\n\ndef f(x):\n    """One."""\n    return (x + 1)  # why\n', encoding="utf-8"
    )
    other.write_text("def f(x):\n    return x + 2\n", encoding="utf-8")
    assert cache.syntax_of(plain) == cache.syntax_of(dressed) != cache.syntax_of(other)


def test_the_command_fills_the_cache_and_writes_its_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = "--robot three_axis --plants 1-1 --poses 1-2 --label small --most 16"
    settings = ("lines=10", "period_s=1", "band_hz=[5,60]")
    command = [*words.split(), "--cache", str(tmp_path), *(word for s in settings for word in ("--with", s))]
    main(command)
    assert "2 of 2 poses" in capsys.readouterr().out
    folder = tmp_path / "small"
    files = {path.name: path.stat().st_mtime_ns for path in folder.glob("*.npz")}
    assert len(files) == 2
    poses = (folder / "poses.csv").read_text(encoding="utf-8").splitlines()
    bounds = (folder / "bounds.csv").read_text(encoding="utf-8").splitlines()
    assert (len(poses), len(bounds)) == (4, 3)  # the command, the head, a line a pose and a line a plant
    known = load(1, 2, tmp_path, base="three_axis", label="small")
    assert known.moments.n_realization == 16
    assert np.array_equal(known.angle, reference_plant(1, "three_axis").pose[1])
    main(command)
    assert {path.name: path.stat().st_mtime_ns for path in folder.glob("*.npz")} == files
    with pytest.raises(FileNotFoundError, match=r"build\.py"):
        load(1, 3, tmp_path, base="three_axis", label="small")
