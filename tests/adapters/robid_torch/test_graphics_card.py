"""Everything that torch computes, on a graphics card against the compiled kernels; skipped where there is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core import FreeParameters, Robot, mechanics, mechanism_change
from robid_core.robot.batched_dynamics import BatchedDynamics

torch = pytest.importorskip("torch")

from robid_torch.batches import GRAPHICS_CARD, TorchDynamics  # noqa: E402

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="no graphics card")

OMEGA = 2 * np.pi * np.geomspace(4, 80, 9)
KINDS = ("inertia", "stiffness", "damping", "gear")
CLOSE = 1e-9  # of the largest number of an array: two eliminations lose three digits each at a resonance
SMALL = TorchDynamics("cuda", 4_000_000)  # some configurations, lines and changes at a time


def everything(batches: BatchedDynamics, name: str, n_config: int = 20) -> dict[str, Any]:
    """Return rest, matrices, responses, their derivatives, torques' derivatives and a pose."""
    robot, rng = Robot.load(name), np.random.default_rng(5)
    angle = rng.uniform(0.8 * robot.drives.lower, 0.8 * robot.drives.upper, (n_config, robot.n_axis))
    names = tuple(n for n in robot.layout if robot.parameter_kind(n) in KINDS)
    change = mechanism_change(
        FreeParameters.of_robot(robot, names), robot, np.zeros(len(names)), range(len(names))
    )
    impedance, swing = (
        rng.standard_normal((*shape, 2)) @ (0.1, 0.1j)
        for shape in ((n_config, 9, robot.n_axis), (n_config, 9, 2, robot.n_axis))
    )
    springs = robot.spring_arrays()
    rest = batches.solve_equilibrium(robot.mechanism, springs[0], robot.motor_angle(angle))
    model = batches.second_order_model(robot.mechanism, *springs, rest.position)
    slopes = batches.second_order_slopes(robot.mechanism, *springs, rest.position, change)
    response = batches.response_with_gradient(model, OMEGA, 1e-3)
    pose = batches.pose_of(robot.chain, rest.joint, robot.chain.names[-1], (0.05, -0.1, 0.2))
    parts = {
        "rest": (rest, ("position", "joint")),
        "model": (model, ("mass", "damping", "stiffness")),
        "slopes": (slopes, ("mass", "damping", "stiffness")),
        "response": (response, ("response", "spring_vectors", "motor_vectors")),
        "pose": (pose, ("rotation", "position", "jacobian")),
    }
    found = {
        f"{part}.{field}": getattr(whole, field)
        for part, (whole, fields) in parts.items()
        for field in fields
    }
    found["response by parameter"] = batches.response_slopes(model, slopes, OMEGA, 1e-3, impedance)
    found["torque by parameter"] = batches.torque_slopes(model, slopes, OMEGA, swing)
    return found


@pytest.mark.parametrize("batches", [GRAPHICS_CARD, SMALL], ids=["whole", "cut"])
@pytest.mark.parametrize("name", ["one_axis", "six_axis", "six_axis_flex"])
def test_a_graphics_card_finds_what_the_kernel_finds(name: str, batches: TorchDynamics) -> None:
    expected, got = everything(mechanics, name), everything(batches, name)
    for field, wanted in expected.items():
        np.testing.assert_allclose(
            got[field], wanted, rtol=0, atol=CLOSE * np.abs(wanted).max(initial=0), err_msg=field
        )


def test_a_robot_on_the_card_responds_like_one_on_the_processor() -> None:
    kernel, card = Robot.load("six_axis"), Robot.load("six_axis", dynamics="torch.cuda")
    angle = np.random.default_rng(3).uniform(kernel.drives.lower, kernel.drives.upper, (12, 6))
    expected, got = (robot.response(angle, OMEGA / (2 * np.pi)) for robot in (kernel, card))
    np.testing.assert_allclose(got, expected, rtol=0, atol=CLOSE * np.abs(expected).max())
    assert not np.array_equal(got, expected), "the card was not asked"
