"""Free parameters: chosen by patterns, moved in natural scales, never to a body that cannot be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from robid_core import ConfigurationError, FreeParameters, Robot, chosen_names
from robid_core.residual import effect_class

SIX = Robot.load("six_axis")
NAMES = list(SIX.layout)
BODIES = chosen_names(NAMES, ["mass.*", "centre_of_mass.*", "inertia.*", "rotor_inertia.*"])


def test_patterns_choose_in_the_order_of_the_robot_and_fixed_wins() -> None:
    names = chosen_names(NAMES, ["bearing_stiffness.*", "gear_stiffness.axis_[12]"], ["*.axis_1"])
    assert names == ("gear_stiffness.axis_2", *(n for n in NAMES if n.startswith("bearing_stiffness.")))


@pytest.mark.parametrize(
    ("free", "fixed", "told"),
    [
        (["gear_stifness.*"], [], r"no parameter 'gear_stifness.\*'; did you mean 'gear_stiffness.\*'\?"),
        (["effect.grease.*"], [], "no parameter 'effect.grease"),
        (["mass.*"], ["mass.*"], "no parameter is left free"),
    ],
)
def test_a_pattern_that_means_nothing_is_told_with_what_comes_near(
    free: list[str], fixed: list[str], told: str
) -> None:
    with pytest.raises(ConfigurationError, match=told):
        chosen_names(NAMES, free, fixed)


def test_a_prior_on_what_is_held_is_told() -> None:
    with pytest.raises(ConfigurationError, match=r"prior 'mass.\*': what it means is held fixed"):
        FreeParameters.of_robot(SIX, ["gear_stiffness.axis_1"], {"mass.*": 0.1})
    free = FreeParameters.of_robot(SIX, BODIES, {"mass.*": 0.1, "mass.axis_3": 0.2})
    prior = dict(zip(free.names, free.prior, strict=True))
    assert prior["mass.axis_2"] == 0.1
    assert prior["mass.axis_3"] == 0.2
    assert prior["inertia.axis_3.xy"] == 0.01


def test_moments_are_free_together_or_not_at_all() -> None:
    with pytest.raises(ConfigurationError, match=r"free inertia.axis_2.\*"):
        FreeParameters.of_robot(SIX, ["inertia.axis_2.xx", "inertia.axis_2.zz"])


def test_zero_is_the_nominal_robot() -> None:
    free = FreeParameters.of_robot(
        SIX, NAMES_FREE := chosen_names(NAMES, ["*"], ["controller.*", "sensors.*"])
    )
    values = free.values(np.zeros(len(NAMES_FREE)))
    for name, value in values.items():
        # The root of the second moments squared; flat bodies get a millionth of their largest moment.
        assert value == pytest.approx(SIX.parameter(name), rel=2e-6, abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.sampled_from([0.01, 0.3, 2.0]))
def test_no_vector_leads_to_a_body_that_cannot_be(seed: int, size: float) -> None:
    free = FreeParameters.of_robot(SIX, BODIES)
    point = size * np.random.default_rng(seed).standard_normal(len(BODIES))
    robot = free.robot_at(np.clip(point, free.lower, free.upper))  # the description checks every body
    for body in robot.description.bodies:
        inertia = np.array(body.inertia)
        assert np.linalg.eigvalsh(np.trace(inertia) / 2 * np.eye(3) - inertia)[0] >= -1e-9 * np.trace(inertia)


def test_a_hundredth_of_a_moment_is_a_percent_of_the_body() -> None:
    """All diagonal moments up by x: second moments by exp(x), so the inertia too."""
    free = FreeParameters.of_robot(SIX, [f"inertia.axis_2.{m}" for m in ("xx", "yy", "zz", "xy", "xz", "yz")])
    inertia = np.array(SIX.description.bodies[1].inertia)
    changed = np.array(free.robot_at(np.array([0.01, 0.01, 0.01, 0, 0, 0])).description.bodies[1].inertia)
    np.testing.assert_allclose(changed, np.exp(0.01) * inertia, rtol=1e-5, atol=1e-9)


def test_the_jacobian_is_the_derivative_of_the_values() -> None:
    names = chosen_names(
        NAMES, ["gear_stiffness.*", "mass.axis_2", "centre_of_mass.axis_2.*", "inertia.axis_2.*"]
    )
    free = FreeParameters.of_robot(SIX, names)
    generator = np.random.default_rng(3)
    point, way = 0.1 * generator.standard_normal(len(names)), generator.standard_normal(len(names))
    h = 1e-5
    ahead, behind = (np.array(list(free.values(point + s * h * way).values())) for s in (1, -1))
    # Central differences: third derivatives times h^2 / 6, 1e-10 of the value.
    np.testing.assert_allclose(free.jacobian(point) @ way, (ahead - behind) / (2 * h), rtol=1e-6, atol=1e-6)


def test_parameters_of_effects_stay_within_their_tables() -> None:
    """A sharpness of at least one and a share of at most one; what begins at a bound may only leave it inwards."""
    robot = Robot.load("one_axis").with_effect(
        "worn", "transmission.bouc_wen", "axis_1", values={"sharpness": 1.5, "share": 0.5}
    )
    names = ["effect.worn.sharpness", "effect.worn.share", "gear_stiffness.axis_1"]
    free = FreeParameters.of_robot(robot, names)
    for end in (free.lower, free.upper):
        free.robot_at(end)  # the description checks every bound
    rows = {row.name: row for row in effect_class("transmission.bouc_wen").parameters}
    lowest, highest = free.values(free.lower), free.values(free.upper)
    assert lowest[names[0]] == pytest.approx(rows["sharpness"].lower, rel=0.01)
    assert highest[names[1]] == pytest.approx(rows["share"].upper, rel=0.01)
    assert highest[names[2]] > 10 * robot.parameter(names[2])
    at_end = FreeParameters.of_robot(robot.with_parameters({names[0]: rows["sharpness"].lower}), names)
    assert at_end.lower[0] == 0.0


def test_friction_that_is_told_as_zero_never_becomes_negative() -> None:
    """What drives a motion is no friction; a fit may only go up from there, an offset either way."""
    names = ["friction.axis_1.viscous", "friction.axis_2.viscous", "friction.axis_1.offset"]
    robot = SIX.with_parameters({names[0]: 0.0, names[2]: 0.0})
    free = FreeParameters.of_robot(robot, names)
    assert free.lower[0] == 0.0
    assert (free.lower[1:] < 0).all()
    assert free.robot_at(np.maximum(np.full(3, -0.1), free.lower)).is_possible
