"""What an inertial unit on a link shows, against Pinocchio's frames, and its linear model against small motions."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio
import pytest
from oracles.pinocchio_robot import PinocchioChain

from robid_core.mechanics import Chain, InertialSensor
from robid_core.mechanics.feedforward import derivative

T, N = 1e-3, 2000  # one period of 2 s
POINT = np.array([0.11, -0.07, 0.23])


def rate(values: np.ndarray) -> np.ndarray:
    return derivative(values, T, 400.0, periodic=True)


def turned(generator: np.random.Generator) -> np.ndarray:
    rotation, _ = np.linalg.qr(generator.standard_normal((3, 3)))
    return rotation * np.linalg.det(rotation)


@pytest.mark.parametrize("n", [1, 3, 7])
def test_both_show_what_a_frame_of_pinocchio_does(draw_chain: Callable[..., Chain], n: int) -> None:
    """A motion of few lines, whose rates are exact: classical acceleration of the frame less gravity, and turning."""
    generator = np.random.default_rng(n)
    chain = draw_chain(generator, n, True)
    axes, oracle = turned(generator), PinocchioChain(chain)
    body = chain.names[-1]
    unit = InertialSensor(body, POINT, axes)
    time = 2 * np.pi * np.arange(N) / N
    phase, size = generator.uniform(0, 6, (3, n)), generator.uniform(0.05, 0.3, (3, n))
    joint = generator.normal(size=n) + sum(
        size[k] * np.sin((k + 1) * time[:, None] + phase[k]) for k in range(3)
    )
    acceleration, turning = unit.shown(chain, joint, rate)
    frame = oracle.model.addFrame(
        pinocchio.Frame(
            "unit", oracle.model.getJointId(body), 0, pinocchio.SE3(axes, POINT), pinocchio.FrameType.SENSOR
        )
    )
    data, speed, second = oracle.model.createData(), rate(joint), rate(rate(joint))
    for i in range(0, N, 97):
        q, v, a = (x[i][oracle.back] for x in (joint, speed, second))
        pinocchio.forwardKinematics(oracle.model, data, q, v, a)
        pinocchio.updateFramePlacements(oracle.model, data)
        of_frame = pinocchio.getFrameClassicalAcceleration(oracle.model, data, frame, pinocchio.LOCAL)
        expected = of_frame.linear - data.oMf[frame].rotation.T @ chain.gravity
        np.testing.assert_allclose(acceleration[i], expected, atol=1e-8 * (1 + np.abs(acceleration).max()))
        velocity = pinocchio.getFrameVelocity(oracle.model, data, frame, pinocchio.LOCAL)
        np.testing.assert_allclose(turning[i], velocity.angular, atol=1e-10 * (1 + np.abs(turning).max()))


@pytest.mark.parametrize("tree", [False, True])
def test_the_linear_model_is_what_small_motions_show(draw_chain: Callable[..., Chain], tree: bool) -> None:
    """Sines of 1e-5 rad at 5 Hz: what is of second order is 1e-5 of them. Gravity's part is seen apart, at rest."""
    generator = np.random.default_rng(5)
    chain = draw_chain(generator, 4, tree)
    unit = InertialSensor(chain.names[-1], POINT, turned(generator))
    rest, line, size = generator.normal(size=4), 10, 1e-5
    omega = np.array([2 * np.pi * line / (N * T)])
    linear = unit.linear(chain, rest[None], omega)[0, 0]
    still = unit.linear(chain, rest[None], np.zeros(1))[0, 0]
    assert np.abs(still[:3]).max() > 1.0  # m/s^2 per rad: tilting in gravity
    assert np.abs(still[3:]).max() == 0.0
    for j in range(4):
        joint = np.tile(rest, (N, 1))
        joint[:, j] += size * np.sin(2 * np.pi * line * np.arange(N) / N)
        shown = np.concatenate(unit.shown(chain, joint, rate), axis=-1)
        spectrum = np.fft.rfft(shown, axis=0)[line] / (N / 2) / (-1j * size)
        np.testing.assert_allclose(spectrum, linear[:, j], atol=1e-4 * np.abs(linear).max())
