"""The contract kit passes effects that keep the contract and names the clause that another one breaks."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import pytest
from numba.extending import overload

from robid_core import (
    ConfigurationError,
    Equivalent,
    ForceEffect,
    Motion,
    Parameter,
    Place,
    Robot,
    SignalEffect,
    StructureEffect,
    TestValue,
)
from robid_core.mechanics import ForceTerm, kernel
from robid_core.testing import ContractBroken, check_effect, example_place

SIZE = Parameter("size", "N m", 0.3, 0.0, 50.0, "torque at 1 rad/s")
HELD = TestValue({"velocity": -2.0, "size": 0.5}, {"force": -2.0, "slope_velocity": 2.0}, "by hand: 0.5 * 4")


@kernel
def drag_law(position, velocity, load, state, next_state, parameters, step):
    return parameters[0] * velocity * abs(velocity), 0.0 * position, 2.0 * parameters[0] * abs(velocity)


class Drag(ForceEffect):
    """Torque that grows with the square of the speed."""

    source = "Definition"
    sides = ("motor",)
    parameters = (SIZE,)
    law = staticmethod(drag_law)
    test_values = (HELD,)

    @classmethod
    def linearize(cls, parameters, place, motion):
        """E|v| of Gaussian and sine: by the core's quadrature, as a closed form would."""
        return super().linearize(parameters, place, motion)

    @classmethod
    def regressor(cls, position, velocity, load, parameters, place):
        """Torque per unit of size."""
        return {"size": velocity * np.abs(velocity)}


@kernel
def relaxing_law(position, velocity, load, state, next_state, parameters, step):
    """A spring of 3 N m/rad behind a dashpot with a time of `size`; backward Euler."""
    fading = 1.0 / (1.0 + step / parameters[0])
    next_state[0] = (state[0] + 3.0 * velocity * step) * fading
    half = 1.0 / (1.0 + 0.5 * step / parameters[0])
    return (state[0] + 1.5 * velocity * step) * half, 0.0 * position, 1.5 * step * half


class Relaxing(ForceEffect):
    """A law with a state."""

    source = "Definition"
    sides = ("motor", "gear")
    parameters = (Parameter("size", "s", 0.1, 1e-3, 10.0, "time of relaxation"),)
    law = staticmethod(relaxing_law)
    n_state = 1
    test_values = (
        TestValue({"step": 0.1, "state": (2.0,)}, {"next_state": (1.0,)}, "by hand: half is left"),
    )


@kernel
def louder_law(signal, angle, speed, state, next_state, parameters, step):
    return signal + parameters[0] * signal


class Louder(SignalEffect):
    """A gain that is off."""

    source = "Definition"
    channels = ("torque", "torque_measurement")
    parameters = (Parameter("size", "1", 0.1, -0.9, 9.0, "relative error"),)
    law = staticmethod(louder_law)
    test_values = (TestValue({"signal": 2.0}, {"signal": 2.2}, "definition"),)

    @classmethod
    def gain(cls, parameters, place, omega, motion):
        """1 + size."""
        return np.full(np.shape(omega), 1 + parameters[0], dtype=complex)

    @classmethod
    def regressor(cls, signal, angle, speed, parameters, place):
        """Change per unit of size."""
        return {"size": signal}


class Heavier(StructureEffect):
    """Every body's mass is off by a factor."""

    source = "Definition"
    places = ("base",)
    parameters = (Parameter("size", "1", 1.1, 0.5, 2.0, "true over nominal mass"),)

    @classmethod
    def apply(cls, robot, parameters, on, label):
        """Return the robot with other masses; raises ConfigurationError on anything but the base."""
        if on not in (None, "base"):
            raise ConfigurationError(f"effects.{label}: acts on the whole robot, not on '{on}'")
        masses = {name: value for name, value in robot.parameters().items() if name.startswith("mass.")}
        return robot.with_parameters({name: parameters[0] * value for name, value in masses.items()})


@pytest.mark.parametrize("effect", [Drag, Relaxing, Louder, Heavier])
def test_an_effect_that_keeps_the_contract_passes_without_a_warning(effect: Any) -> None:
    check_effect(effect)


def test_other_parameters_than_the_defaults_can_be_tried() -> None:
    check_effect(Louder, size=-0.5)
    with pytest.raises(TypeError, match="Louder has no parameter loudness"):
        check_effect(Louder, loudness=1.0)


def changed(base: Any, **members: Any) -> Any:
    """A class that differs from another in some members."""
    functions = {
        name: classmethod(member) if name in ("bind", "linearize", "regressor", "draw", "gain", "apply", "arguments")
        else member
        for name, member in members.items()
    }  # fmt: skip
    return type(base.__name__, (base,), {"__doc__": "Broken somewhere.", **functions})


@pytest.mark.parametrize(
    ("members", "clause"),
    [
        ({"__doc__": None}, "has no docstring"),
        ({"source": " "}, "has no source"),
        ({"sides": ()}, r"sides is \(\)"),
        ({"sides": ("arm", "wheel")}, "give at least one of motor, gear, arm, bearing"),
        ({"parameters": [SIZE]}, "give a tuple of Parameter"),
        ({"parameters": (SIZE, SIZE)}, "parameter 'size' stands in the table twice"),
        ({"parameters": (Parameter("a-b", "1", 0, -1, 1, "x"),)}, "'a-b' is no name"),
        ({"parameters": (Parameter("load", "1", 0, -1, 1, "x"),)}, "the name of an argument of the law"),
        ({"parameters": (Parameter("size", "", 0, -1, 1, "x"),)}, "lacks a unit"),
        ({"parameters": (Parameter("size", "1", 2, -1, 1, "x"),)}, "default 2 is not within its bounds -1 to 1"),
        ({"parameters": (Parameter("size", "1", 0, 0, math.inf, "x"),)}, "not within its bounds 0 to inf"),
        ({"parameters": (Parameter("size", "1", 1, 1, 1, "x"),)}, "can only be 1; make it a constant"),
        ({"smoothest": {"softness": 0.5}}, "smoothest has softness = 0.5; give a parameter of the table"),
        ({"law": None}, "has no law"),
        ({"law": drag_law.py_func}, "law is called with itself"),
        ({"test_values": ()}, "has no test_values"),
        ({"test_values": (TestValue({"speed": 1.0}, {"force": 0.0}, "x"),)}, "a test value speaks of speed"),
        ({"test_values": (TestValue({}, {}, "x"),)}, "expects nothing"),
        ({"test_values": (TestValue({"velocity": 1.0}, {"force": 0.31}, "x"),)}, r"force is 0\.3, expected 0\.31"),
    ],
)  # fmt: skip
def test_what_is_missing_in_the_declaration_is_named(members: dict[str, Any], clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_effect(changed(Drag, **members))


def test_what_is_no_effect_is_told() -> None:
    with pytest.raises(ContractBroken, match="int is no effect"):
        check_effect(int)  # type: ignore[arg-type]
    with pytest.raises(ContractBroken, match="SignalEffect leaves out gain"):
        check_effect(SignalEffect)


@kernel
def wrong_slope_law(position, velocity, load, state, next_state, parameters, step):
    return parameters[0] * velocity * abs(velocity), 0.0 * position, parameters[0] * abs(velocity)


@kernel
def forgets_position_law(position, velocity, load, state, next_state, parameters, step):
    return parameters[0] * position * velocity, 0.0 * position, parameters[0] * position


@kernel
def unguarded_law(position, velocity, load, state, next_state, parameters, step):
    return parameters[0] * velocity / max(velocity - 0.01, 0.0), 0.0 * position, 0.0 * position


@kernel
def reads_beyond_law(position, velocity, load, state, next_state, parameters, step):
    return parameters[1] * velocity, 0.0 * position, parameters[1]


@kernel
def scribbles_on_parameters_law(position, velocity, load, state, next_state, parameters, step):
    parameters[0] = 2.0
    return parameters[0] * velocity, 0.0 * position, parameters[0]


@kernel
def only_where_it_is_large_law(position, velocity, load, state, next_state, parameters, step):
    return velocity / (50.0 - parameters[0]), 0.0 * position, 1.0 / (50.0 - parameters[0])


@numba.njit
def does_not_compile_law(position, velocity, load, state, next_state, parameters, step):
    return no_such_function(velocity)  # noqa: F821


@kernel
def pushes_law(position, velocity, load, state, next_state, parameters, step):
    return -parameters[0] * velocity, 0.0 * position, -parameters[0]


@pytest.mark.parametrize(
    ("law", "clause"),
    [
        (pushes_law, "pushes with the motion: .* of the work through it"),
        (wrong_slope_law, "slope_velocity is .* differences of the force are"),
        (forgets_position_law, "slope_position is 0, differences of the force are"),
        (unguarded_law, "guard divisions"),
        (reads_beyond_law, "read no parameter or state that is not there"),
        (scribbles_on_parameters_law, "the law writes `parameters`"),
        (only_where_it_is_large_law, "with size 50: the law gives force"),
        (does_not_compile_law, "its law does not compile"),
    ],
)
def test_a_law_that_is_wrong_is_found(law: Any, clause: str) -> None:
    nothing = (TestValue({}, {"slope_position": 0.0}, "nothing moves"),)
    effect = changed(Drag, law=staticmethod(law), test_values=nothing, regressor=lambda *_: {})
    with pytest.raises(ContractBroken, match=clause):
        check_effect(effect)


@kernel
def writes_state_law(position, velocity, load, state, next_state, parameters, step):
    next_state[0] = state[0] + step * velocity
    state[0] = 0.5 * velocity
    return 0.0 * velocity, 0.0 * velocity, 0.0 * velocity


@kernel
def leaves_state_law(position, velocity, load, state, next_state, parameters, step):
    return state[0] + 1.5 * step * velocity, 0.0 * velocity, 1.5 * step


@kernel
def writes_beyond_law(position, velocity, load, state, next_state, parameters, step):
    next_state[0] = next_state[1] = state[0]
    return 0.0 * velocity, 0.0 * velocity, 0.0 * velocity


@kernel
def moves_at_rest_law(position, velocity, load, state, next_state, parameters, step):
    next_state[0] = state[0] + 1.0
    return 0.0 * velocity, 0.0 * velocity, 0.0 * velocity


@kernel
def explicit_slope_law(position, velocity, load, state, next_state, parameters, step):
    """The slope forgets what the velocity does to the state within half a step."""
    next_state[0] = state[0] + 3.0 * step * velocity
    return state[0] + 1.5 * step * velocity, 0.0 * velocity, 0.0 * velocity


@kernel
def explodes_law(position, velocity, load, state, next_state, parameters, step):
    """Forward Euler of a time constant: stable for short steps only."""
    next_state[0] = state[0] + step * (velocity - state[0]) / parameters[0] * abs(state[0] + velocity)
    return 0.0 * velocity, 0.0 * velocity, 0.0 * velocity


@pytest.mark.parametrize(
    ("law", "clause"),
    [
        (writes_state_law, "the law writes `state`"),
        (leaves_state_law, r"next_state\[0\] is not written"),
        (writes_beyond_law, r"writes next_state\[1\] and n_state is 1"),
        (moves_at_rest_law, "with step 0 the state changes"),
        (explicit_slope_law, "what the velocity does to the state within half a step"),
        (explodes_law, "stays finite at any step"),
    ],
)
def test_a_law_that_handles_its_state_wrong_is_found(law: Any, clause: str) -> None:
    nothing = (TestValue({}, {"slope_position": 0.0}, "nothing moves"),)
    with pytest.raises(ContractBroken, match=clause):
        check_effect(changed(Relaxing, law=staticmethod(law), test_values=nothing, sides=("motor",)))


@numba.njit
def branching_law(position, velocity, load, state, next_state, parameters, step):
    if velocity > 0.0:
        return parameters[0] * velocity**2, 0.0, 2.0 * parameters[0] * velocity
    return -parameters[0] * velocity**2, 0.0, -2.0 * parameters[0] * velocity


def test_a_law_with_branches_passes_with_a_note() -> None:
    with pytest.warns(UserWarning, match="Drag: its law runs lane after lane"):
        check_effect(changed(Drag, law=staticmethod(branching_law)))


def threefold(x: Any) -> Any:
    """Means one thing on a number and another on lanes."""
    raise NotImplementedError


@overload(threefold)
def _threefold(x):
    return (lambda x: 3.0 * x) if isinstance(x, numba.types.Float) else (lambda x: 0.3 * x * 10.0)


@kernel
def otherwise_on_lanes_law(position, velocity, load, state, next_state, parameters, step):
    return threefold(velocity), 0.0 * position, 3.0


def test_a_law_that_gives_other_numbers_on_lanes_is_found() -> None:
    nothing = (TestValue({}, {"force": 0.0}, "nothing moves"),)
    effect = changed(
        Drag, law=staticmethod(otherwise_on_lanes_law), test_values=nothing, regressor=lambda *_: {}
    )
    with pytest.raises(ContractBroken, match=r"on all lanes .*robid_core\.mechanics\.kernel"):
        check_effect(effect)


def test_a_linearisation_that_is_not_that_of_the_law_is_found() -> None:
    def doubled(cls: Any, parameters: Any, place: Place, motion: Motion) -> Equivalent:
        gain = ForceEffect.linearize.__func__(Drag, parameters, place, motion)  # type: ignore[attr-defined]
        return Equivalent(gain.stiffness, 1.03 * gain.damping)

    with pytest.raises(ContractBroken, match="linearize gives stiffness .* the law itself has"):
        check_effect(changed(Drag, linearize=doubled))


def test_a_linearisation_that_does_not_broadcast_is_found() -> None:
    def flat(cls: Any, parameters: Any, place: Place, motion: Motion) -> Equivalent:
        return Equivalent(np.zeros(4), np.zeros(4))

    with pytest.raises(ContractBroken, match=r"a stiffness of shape \(4,\) for motions of shape \(2, 3\)"):
        check_effect(changed(Drag, linearize=flat))


@pytest.mark.parametrize(
    ("regressor", "clause"),
    [
        (lambda cls, x, v, load, p, place: {"size": v * v}, "the regressor says"),
        (lambda cls, x, v, load, p, place: {"mass": v}, "regressor speaks of mass"),
        (lambda cls, x, v, load, p, place: {"size": v[:3]}, r"has shape \(3,\)"),
    ],
)
def test_a_regressor_that_is_not_that_of_the_law_is_found(regressor: Any, clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_effect(changed(Drag, regressor=regressor))


def test_arguments_that_are_not_finite_are_found() -> None:
    def arguments(cls: Any, parameters: Any, place: Place) -> Any:
        return np.array([math.inf])

    with pytest.raises(ContractBroken, match="arguments gives"):
        check_effect(changed(Louder, arguments=arguments, test_values=(), draw=lambda *_: None))


def test_a_table_whose_defaults_are_refused_is_found() -> None:
    def arguments(cls: Any, parameters: Any, place: Place) -> Any:
        raise ConfigurationError("no")

    with pytest.raises(ContractBroken, match="refuses the defaults of its own table"):
        check_effect(changed(Drag, arguments=arguments))


def test_terms_that_do_not_fit_the_robot_are_found() -> None:
    def short(cls: Any, parameters: Any, place: Place) -> Any:
        row = place.direction[:1]
        return (ForceTerm(cls.law, np.array(parameters), row, row, place.load, 0, place.label),)

    with pytest.raises(ContractBroken, match="expected 2 finite numbers"):
        check_effect(changed(Drag, bind=short))


@kernel
def repelling_law(position, velocity, load, state, next_state, parameters, step):
    """A spring that repels: no work in a cycle."""
    return -1e4 * parameters[0] * position, -1e4 * parameters[0] + 0.0 * position, 0.0 * velocity


def test_a_force_that_makes_a_robot_run_away_is_found() -> None:
    nothing = (TestValue({}, {"force": 0.0}, "nothing bends"),)
    effect = changed(Drag, law=staticmethod(repelling_law), test_values=nothing, regressor=lambda *_: {})
    with pytest.raises(
        ContractBroken, match="a motor of one_axis is asked for 20 rad/s|does not stay in bounds"
    ):
        check_effect(effect)


@pytest.mark.parametrize(
    ("member", "function", "clause"),
    [
        ("gain", lambda cls, p, place, w, motion: 1 / w + 0j, "finite complex numbers are expected"),
        ("gain", lambda cls, p, place, w, motion: np.ones(4), "complex numbers are expected"),
        ("gain", lambda cls, p, place, w, motion: np.full(np.shape(w), 1 + 0.1j), "a constant has no phase"),
        ("draw", lambda cls, p, place, shape, g: g.standard_normal(shape[::-1]), "draw gives shape"),
        ("draw", lambda cls, p, place, shape, g: np.random.default_rng().standard_normal(shape), "same seed"),
        ("draw", lambda cls, p, place, shape, g: np.tile(g.standard_normal(50), (3, 1)), "another lane"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_a_signal_effect_that_is_wrong_is_found(member: str, function: Any, clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_effect(changed(Louder, **{member: function}))


def nothing(cls: Any, robot: Robot, parameters: Any, on: str | None, label: str) -> Robot:
    return robot


def careless(cls: Any, robot: Robot, parameters: Any, on: str | None, label: str) -> Robot:
    return robot.with_parameters({"mass.axis_1": 2 * robot.parameters()["mass.axis_1"]})


def untold(cls: Any, robot: Robot, parameters: Any, on: str | None, label: str) -> Robot:
    return careless(cls, robot, parameters, on, label) if on == "base" else {"base": robot}[str(on)]


@pytest.mark.parametrize(
    ("apply", "clause"),
    [
        (nothing, "stays as it was"),
        (careless, "acts on 'no_such_place'"),
        (untold, "fails with KeyError"),
    ],
)
def test_a_structure_effect_that_is_wrong_is_found(apply: Any, clause: str) -> None:
    with pytest.raises(ContractBroken, match=clause):
        check_effect(changed(Heavier, apply=apply))


def test_a_place_for_tests_takes_other_numbers() -> None:
    place = example_place("gear", stiffness=1e5)
    assert (place.side, place.stiffness, place.damping) == ("gear", 1e5, 0.0)
