"""The contract of effects, as one function that a plugin's test calls.

The table is complete; the law holds its test values, says its own slopes and gives on eight lanes what it gives on
one; its linearisation, regressor and noise fit to it; and robots of one and six axes run with it. A clause that is
broken is a ContractBroken whose message says which.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.compiled.telling import compilation_told
from robid_core.effect import Effect, ForceEffect, Place, SignalEffect, TestValue
from robid_core.errors import ConfigurationError
from robid_core.mechanics.terms import CHANNELS, ForceTerm, SignalTerm
from robid_core.robot import Robot
from robid_core.robot.structure_effect import StructureEffect
from robid_core.testing.broken import ContractBroken
from robid_core.testing.laws import (
    OUTPUTS,
    STEP,
    Point,
    TriedLaw,
    check_lanes,
    check_numbers,
    check_rest,
    check_slopes,
    check_work,
    random_path,
)
from robid_core.testing.linearisations import check_equivalent, check_gain, check_noise
from robid_core.testing.places import PLACE_NUMBERS, example_place, places, with_effect
from robid_core.testing.structures import check_motion, check_structure
from robid_core.testing.tables import LawEffect, check_table, overrides

N_AT_BOUND = 12  # points at which a law is tried with a parameter at its bound
LINEARISED = ("motor", "arm")  # sides whose laws the linear model takes under a motion
EXACT = 1e-9  # relative, of what is the same number computed in another way


def check_effect(effect: type[Effect], /, **parameters: float) -> None:
    """Check that an effect keeps the contract.

    Test values are tried at `example_place`, where no spring is; one that needs a spring names the place's stiffness
    or another of its numbers beside its own arguments. A law that cannot run on all lanes at once causes a warning.

    Parameters
    ----------
    effect
        The effect; it need not be registered.
    parameters
        Values in place of the table's defaults, for an effect whose defaults do little.

    Raises
    ------
    ContractBroken
        With the clause that is broken.
    """
    check_table(effect)
    unknown = set(parameters) - {row.name for row in effect.parameters}
    if unknown:
        raise TypeError(f"{effect.__name__} has no parameter {', '.join(sorted(unknown))}")
    values = np.array([parameters.get(row.name, row.default) for row in effect.parameters], dtype=np.float64)
    with compilation_told():
        if issubclass(effect, StructureEffect):
            check_structure(effect, values)
        elif issubclass(effect, ForceEffect | SignalEffect):
            _check_law_effect(effect, values)


def _check_law_effect(effect: LawEffect, values: FloatArray) -> None:
    for value in effect.test_values:
        _check_test_value(effect, value)
    sides = effect.sides if issubclass(effect, ForceEffect) else effect.channels
    on_lanes = True
    for side in sides:
        name = f"{effect.__name__} on {side}"
        examples = list(places(side))
        if not examples:
            raise ContractBroken(f"{name}: no example robot has such a place")
        for robot, place in examples:
            terms = _terms(name, effect, values, place)
            _check_terms(name, terms, robot, place)
        last = place
        laws = [TriedLaw(name, term) for term in terms]
        for law in laws:
            _check_law(law)
        for robot, place in examples:  # a law that is wrong is told better by its own numbers
            check_motion(name, with_effect(robot, effect, values, place))
        on_lanes = on_lanes and all(law.vectorized for law in laws)
        for parameters in _at_bounds(effect, values):
            _check_at_bound(name, effect, parameters, last)
        _check_regressor(name, effect, values, last)
        if issubclass(effect, ForceEffect):
            elsewhere = any(
                isinstance(term, ForceTerm) and not np.array_equal(term.coordinate, last.direction)
                for term in terms
            )
            compare = overrides(effect, "linearize") and not elsewhere
            if side in LINEARISED:
                check_equivalent(name, effect, values, last, compare)
        else:
            check_gain(name, effect, values, last)
            check_noise(name, effect, values, last)
    if not on_lanes:
        warnings.warn(
            f"{effect.__name__}: its law runs lane after lane, slower than it could; with where, min, max, abs and the "
            "functions of robid_core.mechanics in place of branches and library functions it runs on all at once",
            stacklevel=3,
        )


# Terms and laws ----------------------------------------------------------------------------------------------


def _terms(
    name: str, effect: LawEffect, values: FloatArray, place: Place
) -> tuple[ForceTerm, ...] | tuple[SignalTerm, ...]:
    try:
        terms = effect.bind(values.copy(), place)
    except ConfigurationError as error:
        raise ContractBroken(f"{name}: refuses the defaults of its own table: {error}") from error
    kind = ForceTerm if issubclass(effect, ForceEffect) else SignalTerm
    if not isinstance(terms, tuple) or not terms or not all(isinstance(term, kind) for term in terms):
        raise ContractBroken(f"{name}: bind gives {terms!r}, not a tuple of {kind.__name__}")
    return terms


def _check_terms(
    name: str, terms: tuple[ForceTerm, ...] | tuple[SignalTerm, ...], robot: Robot, place: Place
) -> None:
    """Check that terms fit the robot."""
    n = robot.mechanism.n_coordinate
    for term in terms:
        arguments = np.asarray(term.arguments)
        if arguments.ndim != 1 or arguments.dtype != np.float64 or not np.isfinite(arguments).all():
            raise ContractBroken(
                f"{name}: arguments gives {arguments!r}; a law takes one row of finite float64 numbers"
            )
        if term.label != place.label:
            raise ContractBroken(f"{name}: a term is called '{term.label}', its place '{place.label}'")
        if isinstance(term, SignalTerm):
            if term.channel not in CHANNELS or term.axis != place.axis:
                raise ContractBroken(
                    f"{name}: a term is on channel '{term.channel}' of axis {term.axis}, its place on axis {place.axis}"
                )
            continue
        for row, size in ((term.direction, n), (term.coordinate, n), (term.load, robot.n_axis)):
            if np.shape(row) != (size,) or not np.isfinite(row).all():
                raise ContractBroken(f"{name}: a term has a row {row!r}, expected {size} finite numbers")


def _check_law(law: TriedLaw) -> None:
    check_numbers(law)
    check_lanes(law)
    if law.is_force:
        check_rest(law)
        check_slopes(law)
        check_work(law)


def _check_test_value(effect: LawEffect, value: TestValue) -> None:
    """Check what a law gives for stated arguments against what is known."""
    sides = effect.sides if issubclass(effect, ForceEffect) else effect.channels
    name, given = f"{effect.__name__}: test value ({value.origin})", value.arguments
    values = np.array([given.get(row.name, row.default) for row in effect.parameters], dtype=np.float64)
    own = {row.name for row in effect.parameters}
    there = {key: float(given[key]) for key in PLACE_NUMBERS if key in given and key not in own}
    term = _terms(name, effect, values, example_place(sides[0], **there))[0]
    law = TriedLaw(name, term)
    state = np.array(given.get("state", law.initial), dtype=np.float64)
    if state.shape != (law.n_state,):
        raise ContractBroken(f"{name}: a state of {state.size} numbers, n_state is {law.n_state}")
    point = Point(np.array([float(given.get(key, 0.0)) for key in law.inputs]), state)
    outputs, following = law(point, float(given.get("step", 0.0)))
    names = OUTPUTS if law.is_force else ("signal",)
    found: dict[str, FloatArray] = dict(zip(names, outputs, strict=True)) | {"next_state": following}
    for key, expected in value.expected.items():
        wanted = np.asarray(expected, dtype=np.float64)
        size = max(1.0, float(np.max(np.abs(wanted), initial=0.0)))
        if (
            np.shape(found[key]) != wanted.shape
            or not (np.abs(found[key] - wanted) <= value.tolerance * size).all()
        ):
            raise ContractBroken(f"{name}: {key} is {found[key]}, expected {wanted}")


# Parameters ------------------------------------------------------------------------------------------------------


def _at_bounds(effect: LawEffect, values: FloatArray) -> Iterator[FloatArray]:
    """Yield parameters with one of them at its lower or upper bound: a robot file may say so."""
    for index, row in enumerate(effect.parameters):
        for bound in (row.lower, row.upper):
            changed = values.copy()
            changed[index] = bound
            yield changed


def _check_at_bound(name: str, effect: LawEffect, parameters: FloatArray, place: Place) -> None:
    """Check that a law is finite at the bounds of its table, or that they are refused in words."""
    told = ", ".join(
        f"{row.name} {value:g}" for row, value in zip(effect.parameters, parameters, strict=True)
    )
    try:
        terms = effect.bind(parameters, place)
    except ConfigurationError:
        return
    for term in terms:
        law = TriedLaw(f"{name} with {told}", term)
        for step in (STEP, 0.1):
            for point in random_path(law, N_AT_BOUND, step):
                law(point, step)


def _check_regressor(name: str, effect: LawEffect, values: FloatArray, place: Place) -> None:
    """Check that the force (or the change of a signal) follows each parameter as the regressor says."""
    law = TriedLaw(name, _terms(name, effect, values, place)[0])
    points = list(random_path(law, 40, STEP))
    columns = np.stack([point.inputs for point in points], axis=-1)
    unit = effect.regressor(columns[0], columns[1], columns[2], values, place)
    own = [row.name for row in effect.parameters]
    if set(unit) - set(own):
        raise ContractBroken(f"{name}: regressor speaks of {', '.join(sorted(set(unit) - set(own)))}")
    if unit and law.n_state:
        raise ContractBroken(f"{name}: a law with a state has no regressor in the motion alone; give {{}}")
    before = np.array([law(point, 0.0)[0][0] for point in points])
    for key, column in unit.items():
        if np.shape(column) != before.shape or not np.isfinite(column).all():
            raise ContractBroken(
                f"{name}: regressor '{key}' has shape {np.shape(column)} for motions of {before.shape}, "
                "or is not finite"
            )
        changed = _other_value(effect, values, own.index(key), place)
        other = TriedLaw(name, _terms(name, effect, changed, place)[0])
        after = np.array([other(point, 0.0)[0][0] for point in points])
        change = column * (changed - values)[own.index(key)]
        size = np.maximum(np.abs(before), np.abs(after)).max()
        if not (np.abs(after - before - change) <= EXACT * size).all():
            worst = int(np.argmax(np.abs(after - before - change)))
            raise ContractBroken(
                f"{name}: with {key} {changed[own.index(key)]:g} in place of {values[own.index(key)]:g} the law "
                f"changes by {after[worst] - before[worst]:.6g}, the regressor says {change[worst]:.6g} at "
                f"{law.where(points[worst], 0.0)}"
            )


def _other_value(effect: LawEffect, values: FloatArray, index: int, place: Place) -> FloatArray:
    """Return parameters of which one is half as much again, or half, or well within its bounds, as they allow."""
    row = effect.parameters[index]
    for value in (1.5 * values[index], 0.5 * values[index], 0.6 * row.lower + 0.4 * row.upper):
        changed = values.copy()
        changed[index] = value
        if row.lower <= value <= row.upper and value != values[index]:
            try:
                effect.bind(changed, place)
            except ConfigurationError:
                continue
            return changed
    raise ContractBroken(f"{effect.__name__}: parameter '{row.name}' has a regressor, but cannot be changed")
