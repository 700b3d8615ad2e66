"""Derivatives by automatic differentiation: those of the kernel, in batches of any size, and fits that end alike."""

from __future__ import annotations

import logging
from functools import cache

import numpy as np
import pytest

from robid_core import (
    ComplexArray,
    Context,
    FloatArray,
    FreeParameters,
    Frf,
    Robot,
    chosen_names,
    mechanics,
    mechanism_change,
)
from robid_core.estimation.torque.periodic import periodic_motion_of
from robid_core.estimation.torque.speed_functions import SpeedFunctions
from robid_core.mechanics import SecondOrderSlopes
from robid_core.residual import PeriodicBlock, TorqueProblem
from robid_core.robot.batched_dynamics import BatchedDynamics
from robid_core.stage import map_in_process
from robid_fit.log_response import LogResponseFit

torch = pytest.importorskip("torch")

from robid_torch.batches import PROCESSOR, TorchDynamics  # noqa: E402
from robid_torch.lines import bytes_per_line  # noqa: E402

OMEGA = 2 * np.pi * np.geomspace(4, 80, 9)
KINDS = ("inertia", "stiffness", "damping", "gear")
CLOSE = 1e-9  # of the largest derivative by a parameter


@cache
def robot(n_axis: int) -> Robot:
    """One or six axes as packaged; two are the first two of the six, all else that the robot has left out."""
    if n_axis != 2:
        return Robot.load("one_axis" if n_axis == 1 else "six_axis")
    whole = Robot.load("six_axis").description
    axes = dict(list(whole.axes.items())[:2])
    joints = set(axes)
    return Robot(
        whole.model_copy(
            update={
                "axes": axes,
                "bodies": tuple(body for body in whole.bodies if body.joint in joints),
                "bearings": {name: b for name, b in whole.bearings.items() if b.joint in joints},
                "coupling": None,
            }
        )
    )


def derivatives(
    batches: BatchedDynamics, n_axis: int, names: tuple[str, ...] | None = None
) -> tuple[tuple[str, ...], SecondOrderSlopes, ComplexArray, ComplexArray]:
    """Names, slopes of the matrices, of the response and of the torque, at three random poses."""
    rng, whole = np.random.default_rng(n_axis), robot(n_axis)
    if names is None:
        names = tuple(n for n in whole.layout if whole.parameter_kind(n) in KINDS or n.endswith(".viscous"))
    free = FreeParameters.of_robot(whole, names)
    point = 0.05 * rng.standard_normal(len(names))
    here = free.set_on(whole, point)
    angle: FloatArray = rng.uniform(0.8 * whole.drives.lower, 0.8 * whole.drives.upper, (3, n_axis))
    impedance, swing = (
        rng.standard_normal((*shape, 2)) @ (0.1, 0.1j) for shape in ((3, 9, n_axis), (3, 9, 2, n_axis))
    )
    change = mechanism_change(free, whole, point, range(len(names)))
    rest, model = here.equilibrium(angle).position, here.second_order(angle)
    slopes = batches.second_order_slopes(here.mechanism, *here.spring_arrays(), rest, change)
    return (
        names,
        slopes,
        batches.response_slopes(model, slopes, OMEGA, 1e-3, impedance),
        batches.torque_slopes(model, slopes, OMEGA, swing),
    )


@pytest.mark.parametrize("n_axis", [1, 2, 6])
def test_derivatives_by_torch_are_those_of_the_kernel(n_axis: int) -> None:
    """Bodies, rotors, gears, springs, dampers and viscous friction, the arm sagging.

    What is zero but for rounding, such as the torque that holds a vertical axis, is left over from springs' torques of
    some 1e5 N m, or from the largest derivative.
    """
    names, expected, *kernel = derivatives(mechanics, n_axis)
    _, found, *ours = derivatives(PROCESSOR, n_axis)
    fields = ("mass", "damping", "stiffness", "torque")
    pairs = [(getattr(found, field), getattr(expected, field)) for field in fields]
    pairs += zip(ours, kernel, strict=True)
    for number, name in enumerate(names):
        for place, (got, wanted) in enumerate(pairs):
            off = np.abs(got[..., number] - wanted[..., number]).max()
            rounding = 1e-11 if place == fields.index("torque") else 1e-13 * np.abs(wanted).max()
            assert off <= CLOSE * np.abs(wanted[..., number]).max() + rounding, (name, place)
    seen = np.abs(kernel[0]).max(axis=(0, 1, 2, 3)) > 0  # of a body's moments one axis sees one
    assert all(
        seen[i] for i, name in enumerate(names) if not name.startswith(("inertia.", "centre_of_mass."))
    )


@pytest.mark.parametrize("n_config", [0, 2])
def test_a_batch_cut_to_fit_a_small_memory_gives_the_same_derivatives(n_config: int) -> None:
    """A line and a few parameters at a time, or two configurations of three: the same operations on fewer rows."""
    whole = derivatives(PROCESSOR, 6)
    n_line = n_config * len(OMEGA)
    enough = n_line * (1 + len(whole[0])) * bytes_per_line(robot(6).mechanism.n_coordinate, 6)
    small = derivatives(TorchDynamics(memory_bytes=max(4_000_000, enough)), 6)
    for got, wanted in zip((small[1].mass, *small[2:]), (whole[1].mass, *whole[2:]), strict=True):
        np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-13 * np.abs(wanted).max())


def test_parameters_that_change_no_body_need_no_automatic_derivative() -> None:
    names, slopes, response, _ = derivatives(
        PROCESSOR, 1, ("gear_stiffness.axis_1", "friction.axis_1.viscous")
    )
    assert not slopes.mass.any()
    assert np.abs(response).max(axis=(0, 1, 2, 3)).min() > 0
    assert response.shape[-1] == len(names)


def measured(true: Robot, angle: FloatArray) -> Frf:
    """Response of a linear robot with a percent of noise."""
    frequency = np.geomspace(4, 80, 8)
    response = true.response(angle, frequency)
    n_config, n_freq, n, _ = response.shape
    noise = np.random.default_rng(2).standard_normal((*response.shape, 2)) @ (1, 1j) / np.sqrt(2)
    size = 0.01 * np.abs(response).max(axis=3)
    identity = np.broadcast_to(np.eye(n, dtype=complex), (n_config, n_freq, n, n))
    return Frf(
        axis_names=true.axis_names, estimator="synthetic", pooling="known", sample_time_s=true.sample_time_s,
        torque_hold="zero_order_hold", angle=angle, frequency_hz=frequency, response=response + noise * size[..., None],
        input_gram_inverse=identity, output_covariance=(size**2)[..., None] * identity,
        degrees_of_freedom=np.full((n_config, n_freq), 1e6),
    )  # fmt: skip


def test_a_fit_ends_at_the_same_estimates_with_either() -> None:
    """Springs, dampers and bodies free, noise in the data: derivatives that differ would lead elsewhere."""
    angle = np.random.default_rng(1).uniform(-1, 1, (2, 2))
    told, wrong = robot(2), {"gear_stiffness.axis_1": 1.3, "gear_stiffness.axis_2": 0.8, "mass.axis_2": 1.02}
    frf = measured(told.with_parameters({n: size * told.parameter(n) for n, size in wrong.items()}), angle)
    patterns = (
        "gear_stiffness.*",
        "gear_damping.*",
        "mass.axis_2",
        "inertia.axis_2.*",
        "rotor_inertia.axis_2",
    )
    estimates = []
    for name in ("kernel", "torch"):
        context = Context(
            np.random.default_rng(0),
            map_in_process,
            lambda done, total, note="": None,
            logging.getLogger("test"),
        )
        fit = LogResponseFit(starts=1, free=patterns).run(frf, Robot(told.description, name), context)
        assert fit.converged
        estimates.append(fit.parameters.estimate)
        for parameter, size in wrong.items():
            index = fit.parameters.names.index(parameter)
            assert fit.parameters.estimate[index] / told.parameter(parameter) == pytest.approx(size, rel=0.05)
    np.testing.assert_allclose(estimates[1], estimates[0], rtol=1e-8, atol=1e-8)


def test_the_torque_residual_has_the_same_normal_equations_with_either() -> None:
    matrices = []
    for name in ("kernel", "torch"):
        nominal = Robot.load("six_axis", dynamics=name)
        plain = nominal.with_parameters(
            {n: 0.0 for n in nominal.layout if n.endswith((".coulomb", ".offset"))}
        )
        rng, time = np.random.default_rng(3), 1e-3 * np.arange(1000)
        wave = sum(np.sin(2 * np.pi * (b * time[:, None] + rng.uniform(size=6))) / b for b in (5, 21, 60))
        angle = plain.motor_angle(np.array([0.3, 0.4, -0.3, 0.5, 0.6, 0.2])) + np.array([wave, wave])
        torque = rng.standard_normal(angle.shape)
        shaped = (part[None, None, None] for part in (angle, torque))
        motion = periodic_motion_of(*shaped, 1e-3, np.array([5, 21, 60]), 80.0)
        laws = SpeedFunctions.of_widths((0.5,), 6)
        patterns = (
            "*_stiffness.*",
            "*_damping.*",
            "friction.*.viscous",
            "mass.*",
            "inertia.axis_2.*",
            "rotor_inertia.*",
        )
        free = FreeParameters.of_robot(plain, chosen_names(list(plain.layout), patterns))
        block = PeriodicBlock.of_record(plain, motion, laws)
        problem = TorqueProblem(free, (block,), laws.names)
        point = np.zeros(problem.n_unknown)
        n_bin = block.remainder.shape[2]
        weights = problem.weightings(point, [np.broadcast_to(np.eye(6, dtype=complex), (n_bin, 6, 6))])
        matrices.append(problem.linearise(point, weights).matrices[0])
    scale = np.sqrt(np.diag(matrices[0]))
    assert (scale[: problem.n_free] > 0).all()
    np.testing.assert_allclose(
        matrices[1] / np.outer(scale, scale), matrices[0] / np.outer(scale, scale), atol=1e-9
    )
