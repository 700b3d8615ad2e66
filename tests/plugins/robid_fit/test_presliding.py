"""Friction before it slides: bristles integrated by hand are found by their stiffness and damping."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from oracles.friction_bench import context, machine, record_of, stuck

from robid_core import ConfigurationError, DataRejected, Record, Robot
from robid_core.testing import check_stage
from robid_fit.bristles import SmallMotion, bristles_of, slid_share
from robid_fit.presliding import PreslidingFit

STIFFNESS, DAMPING, VISCOUS, COULOMB = 200.0, 0.15, 2e-3, 0.3  # breaks away after 1.5 mrad
NAMES = ("effect.bristles_arm.stiffness", "effect.bristles_arm.damping")


@functools.cache
def motion(share: float) -> tuple[np.ndarray, np.ndarray]:
    """Under a torque of so much of the Coulomb level."""
    return stuck(share * COULOMB, 8.0, STIFFNESS, DAMPING, VISCOUS, COULOMB)


def recorded(share: float, seed: int = 0) -> Record:
    angle, torque = motion(share)
    noise = np.random.default_rng(seed).normal(0.0, 3e-3, len(angle))
    return record_of(machine(coulomb=COULOMB), [(angle[:, None], (torque + noise)[:, None])])


def test_stiffness_and_damping_are_those_of_the_bristles() -> None:
    fit = PreslidingFit().run(recorded(0.05), machine(coulomb=COULOMB), context())
    assert fit.converged
    assert fit.parameters.names == NAMES
    stiffness, damping = fit.parameters.estimate
    # Bristles that give way: by a part of the ratio of torque to Coulomb level, 5 % at most.
    assert stiffness == pytest.approx(STIFFNESS, rel=0.05)
    assert damping == pytest.approx(DAMPING, abs=4 * fit.parameters.standard_error[1] + 0.1 * DAMPING)
    found = Robot.of_model(fit.model)  # type: ignore[arg-type]
    assert found.description.effects["bristles_arm"].use == "friction.lugre"
    assert found.parameter("effect.bristles_arm.coulomb") == COULOMB
    assert found.parameter("friction.arm.coulomb") == 0.0


def test_the_bias_of_bristles_that_give_way_falls_with_the_motion() -> None:
    off = []
    for share in (0.6, 0.1):
        fit = PreslidingFit().run(recorded(share), machine(coulomb=COULOMB), context())
        off.append(abs(fit.parameters.estimate[0] / STIFFNESS - 1))
    assert off[1] < 0.5 * off[0], off


def test_a_motion_that_slides_is_refused_with_how_much_it_does() -> None:
    with pytest.raises(
        DataRejected, match=r"arm slides: per path it loses \d+ % of its Coulomb level of 0.3 N m"
    ):
        PreslidingFit().run(recorded(1.5), machine(coulomb=COULOMB), context())


def test_intervals_hold_the_truth_in_nineteen_of_twenty_records() -> None:
    """200 records of a linear spring and damper under noise with a memory of 5 ms: 95 % +- 1.5 %."""
    time = np.arange(6000) * 1e-3
    position = 1e-4 * (np.sin(8.0 * time) + np.sin(19.0 * time + 1.0) + np.sin(36.0 * time + 2.0))
    speed = np.gradient(position, 1e-3)
    inside = np.zeros(2)
    for seed in range(200):
        draw = np.random.default_rng(seed).normal(0.0, 0.01, len(time) + 4)
        noise = np.convolve(draw, np.ones(5), mode="valid")
        torque = STIFFNESS * position + DAMPING * speed + 0.2 + noise
        found = bristles_of([SmallMotion(position, speed, torque)])
        error = np.sqrt(np.diag(found.covariance))
        inside += np.abs([found.stiffness - STIFFNESS, found.damping - DAMPING]) < 1.96 * error
    assert (inside >= 180).all()
    assert (inside <= 198).all()


def test_a_spring_loses_nothing_and_sliding_everything() -> None:
    angle = np.sin(np.linspace(0, 20 * np.pi, 5001))
    speed = np.gradient(angle)
    assert slid_share([SmallMotion(angle, speed, 3.0 * angle)], 0.3) == pytest.approx(0.0, abs=1e-3)
    assert slid_share([SmallMotion(angle, speed, 0.3 * np.sign(speed))], 0.3) == pytest.approx(1.0, rel=1e-9)


def test_what_cannot_be_is_refused_with_what_to_do() -> None:
    with pytest.raises(ConfigurationError, match="friction.arm.coulomb is zero"):
        PreslidingFit().run(recorded(0.05), machine(coulomb=0.0), context())
    still = np.zeros((4000, 1))
    with pytest.raises(DataRejected, match="no motor moves"):
        PreslidingFit().run(record_of(machine(), [(still, still)]), machine(), context())
    with pytest.raises(DataRejected, match="shorter than 0.402 s"):
        PreslidingFit().run(record_of(machine(), [(still[:300], still[:300])]), machine(), context())


def test_the_stage_keeps_the_contract() -> None:
    """The example's robot slides: that is looked over here."""
    check_stage(PreslidingFit, for_axes=(1, 2), recovery=False, largest_slide=0.99, cutoff_hz=100.0)
