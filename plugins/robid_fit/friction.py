"""Friction of each motor from motion at constant speeds: plateaus found in the record, the smallest law they ask for.

Torque at constant speed is friction and what the rigid robot needs (gravity, and what other axes do): the latter is
taken off by the robot's own model (Armstrong-Helouvry, Dupont and Canudas de Wit 1994, section 5). Laws are nested, and
tested on means over plateaus (`friction_law`); what is beyond the friction under `axes` becomes effects of the robot
(`friction_effects`).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat

from robid_core import (
    Context,
    DataRejected,
    Doubt,
    Estimator,
    Fit,
    FloatArray,
    FrictionCurve,
    ParameterTable,
    Record,
    Robot,
)
from robid_core.residual import leading_periods
from robid_fit.friction_effects import (
    AxisFriction,
    curve_of,
    possible,
    refuse_other_laws,
    with_law,
    without_friction_effects,
)
from robid_fit.friction_law import SPARE, FrictionFit, choose
from robid_fit.friction_terms import EXTRAS, Extra, base_names, reference_temperature
from robid_fit.plateau_torques import AxisPlateaus, Reading, plateaus_of_record
from robid_fit.plateaus import Evenness

BELOW_SMOOTHING = 2.0  # times the robot's friction.speed: slower, its smooth sign is less than 0.96
NUISANCE = "gravity"


@dataclass(frozen=True, eq=False)
class AxisResult:
    """What was found of one axis."""

    axis: str
    table: AxisPlateaus
    fit: FrictionFit
    law: AxisFriction

    @property
    def words(self) -> str:
        """Say which terms the law has."""
        terms = [name for name in ("coulomb", "viscous", "offset") if name in self.fit.names]
        return ", ".join((*terms, *self.fit.extras))


class FrictionFromPlateaus(Estimator):
    """Friction over speed from a record with stretches of constant speed, `excitation.constant_velocity` or any other.

    Always estimated: friction.<axis>.coulomb, .viscous and .offset. Where the data show it, an effect is added that
    holds what comes on top: friction.stribeck, .asymmetric (viscous; a Coulomb level that differs by direction is an
    offset at constant speed), .load_dependent, and .temperature, which takes level and coefficient over, where a
    channel or constant `temperature` was recorded. Effects of friction that the robot had on these axes are replaced.
    An error of the robot's gravity that shows is estimated beside them, and doubted. Errors come from the scatter
    between plateaus; they are so widened for few plateaus that 1.96 of them hold 95 %.

        friction:
          use: fit.friction
          with: {significance: 0.01}
    """

    extras: tuple[Extra, ...] = EXTRAS
    """Terms beyond Coulomb, viscous and offset that are taken where the data show them."""
    significance: float = Field(default=0.01, gt=0, lt=1)
    """Probability of any false one of these terms on an axis, by F tests."""
    exponent: Annotated[float, Field(ge=0.5, le=4)] = 2.0
    """Of the Stribeck curve's exp(-|v / v_S|^n)."""
    tolerance: Annotated[float, Field(gt=0, lt=1)] = 0.05
    """How far the speed may be from the middle of a plateau, as a share of it."""
    shortest_s: PositiveFloat = 0.2
    """Shortest plateau, once `settle_s` is cut off at both ends."""
    settle_s: NonNegativeFloat = 0.1
    """Left out at both ends of a plateau, s; at least a period of `cutoff_hz`, for which the low-pass remembers."""
    cutoff_hz: PositiveFloat = 20.0
    """Edge of the low-pass on the measured angle."""
    slowest_rad_s: PositiveFloat | None = None
    """Least speed of a plateau, at the motor; null: twice the robot's `friction.*.speed`, below which the robot's
    smooth sign hides the friction."""
    others_at_rest: bool = False
    """Whether plateaus are left out during which another axis moves."""
    discard: NonNegativeInt | None = None
    """Leading periods left out of a periodic record; null: decided from the data, as many as differ from those after
    them."""

    def uses(self) -> list[tuple[str, str]]:
        """Effects that may come into the robot."""
        names = {"load": "load_dependent"}
        return [("robid.effects", f"friction.{names.get(e, e)}") for e in self.extras if e != NUISANCE]

    def run(self, record: Record, robot: Robot, context: Context) -> Fit:
        """Find the plateaus, choose a law for each axis, put it into the robot."""
        tables = self.plateaus(record, robot, context.log)
        seen = {axis: one for axis, one in zip(robot.axis_names, tables, strict=True) if one.n_plateau}
        if not seen:
            raise DataRejected(
                f"fit.friction: no axis keeps its speed within {100 * self.tolerance:g} % for {self.shortest_s:g} s; "
                "measure with excitation.constant_velocity, or lower shortest_s, settle_s or slowest_rad_s"
            )
        found_in, (plain, replaced) = robot, without_friction_effects(robot, tuple(seen))
        refuse_other_laws(plain, "fit.friction")
        if replaced:
            context.log.info("replaced: %s", ", ".join(replaced))
        results, extended = [], replace(plain, base=robot.base or robot.description)
        for axis, table in seen.items():
            base, fit = self._fitted(axis, table, found_in)
            law = with_law(extended, axis, fit, reference_temperature(table))
            extended = law.robot
            results.append(AxisResult(axis, table, fit, law))
            held = [name for name in ("viscous", "offset") if name not in base]
            context.log.info(
                "%s: %d plateaus from %.4g to %.4g rad/s; %s%s",
                axis,
                table.n_plateau,
                np.abs(table.speed).min(),
                np.abs(table.speed).max(),
                results[-1].words,
                f"; held: {', '.join(held)}" if held else "",
            )
        silent = [axis for axis in robot.axis_names if axis not in seen]
        if silent:
            context.log.warning("no plateau, friction is left as in the robot file: %s", ", ".join(silent))
        return _result(found_in, extended, results)

    def plateaus(
        self, record: Record, robot: Robot, log: logging.Logger | None = None
    ) -> tuple[AxisPlateaus, ...]:
        """Return what the record tells of each axis."""
        slowest = BELOW_SMOOTHING * robot.drives.friction_speed
        if self.slowest_rad_s is not None:
            slowest = np.full(robot.n_axis, self.slowest_rad_s)
        evenness = Evenness(self.tolerance, self.shortest_s, max(self.settle_s, 1.0 / self.cutoff_hz))
        discard = leading_periods((record,), self.discard, log)
        reading = Reading(evenness, self.cutoff_hz, self.others_at_rest, discard, "fit.friction")
        return plateaus_of_record(record, robot, slowest, reading)

    def _fitted(self, axis: str, table: AxisPlateaus, robot: Robot) -> tuple[tuple[str, ...], FrictionFit]:
        """Return what of the plain law was free, and the fit."""
        base = base_names(table)
        if table.n_plateau < len(base) + SPARE:
            raise DataRejected(
                f"fit.friction: {axis} has {table.n_plateau} plateaus, and {', '.join(base)} need {len(base) + SPARE} "
                "at least; measure at more speeds, or lower shortest_s"
            )
        held = {
            name: robot.parameter(f"friction.{axis}.{name}")
            for name in ("viscous", "offset")
            if name not in base
        }
        known = held.get("viscous", 0.0) * table.speed + held.get("offset", 0.0)
        less = replace(table, torque=table.torque - known)
        return base, choose(less, base, self.extras, self.significance, self.exponent)


def _result(told: Robot, robot: Robot, results: list[AxisResult]) -> Fit:
    """Everything of all axes; `robot` has the effects, `told` is the one that the fit was given."""
    names, nuisance, values, errors, blocks = [], [], [], [], []
    held: dict[str, float] = {}
    for one in results:
        own = [one.law.names.get(name, f"{name}.{one.axis}") for name in one.fit.names]
        names += own
        nuisance += [name not in one.law.names for name in one.fit.names]
        values += one.fit.value.tolist()
        errors += one.fit.standard_error.tolist()
        blocks.append(one.fit.covariance * np.outer(one.fit.widening, one.fit.widening))
        held |= one.law.held
    covariance = _block_diagonal(blocks)
    starts = {name: told.parameter(name) if name in told.layout else np.nan for name in names}
    estimates = dict(zip(names, values, strict=True))
    kept = np.flatnonzero(~np.array(nuisance))
    free = [names[i] for i in kept]
    numbers = {name: possible(name, estimates[name]) for name in free}
    model = robot.model({**held, **numbers}, free, covariance[np.ix_(kept, kept)])
    wrong = [
        name
        for name, value, error in zip(names, values, errors, strict=True)
        if name.endswith((".coulomb", ".viscous")) and value < -2 * error
    ]
    count = sum(one.table.n_plateau for one in results)
    told_laws = "; ".join(f"{one.axis}: {one.words}" for one in results)
    status = f"{count} plateaus; {told_laws}"
    units = [
        robot.parameter_unit(name) if name in robot.layout else robot.parameter_unit(free[0])
        for name in names
    ]
    return Fit(
        method="friction at constant speeds, least squares over plateaus",
        status=f"not physical: {', '.join(wrong)} negative; {status}" if wrong else status,
        converged=not wrong,
        misfit=1.0,
        misfit_against="",  # the scatter between plateaus itself gives the noise level
        n_starts=1,
        n_agree=1,
        parameters=ParameterTable(
            names=tuple(names),
            units=tuple(units),
            groups=tuple("nuisance" if out else "friction" for out in nuisance),
            start=np.array(
                [starts[name] if np.isfinite(starts[name]) else 0.0 for name in names], dtype=np.float64
            ),
            estimate=np.array(values, dtype=np.float64),
            standard_error=np.array(errors, dtype=np.float64),
            reported=~np.array(nuisance),
            at_bound=np.zeros(len(names), dtype=bool),
        ),
        covariance=covariance,
        free_names=tuple(names),
        stated_doubts=tuple(doubt for one in results for doubt in _doubts(one, told)),
        model=model,
        friction=tuple(_curve(one, robot) for one in results),
    )


def _block_diagonal(blocks: list[FloatArray]) -> FloatArray:
    size = sum(len(block) for block in blocks)
    whole, at = np.zeros((size, size)), 0
    for block in blocks:
        whole[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return whole


def _doubts(one: AxisResult, robot: Robot) -> list[Doubt]:
    """What only these plateaus tell."""
    found = []
    if NUISANCE in one.fit.extras:
        rows = [i for i, name in enumerate(one.fit.names) if name.startswith(NUISANCE)]
        size = float(np.abs(one.fit.columns[:, rows] @ one.fit.value[rows]).max())
        found.append(
            Doubt(
                "gravity",
                f"{one.axis}: the torque over the joint's angle is up to {size:.3g} N m beside the robot's gravity",
                "correct masses and centres of mass (fit.rigid); until then offset and share of the load depend on it",
            )
        )
    held = [name for name in ("viscous", "offset") if name not in one.fit.names]
    for name in held:
        lacking = "one speed only" if name == "viscous" else "one direction only"
        value = robot.parameter(f"friction.{one.axis}.{name}")
        found.append(
            Doubt(
                "held friction",
                f"{one.axis} moved at {lacking}: {name} was held at {value:.4g}, and the Coulomb level has its error",
                "measure at several speeds to and fro",
            )
        )
    return found


def _curve(one: AxisResult, robot: Robot) -> FrictionCurve:
    measured, fitted = curve_of(one.fit, one.fit.columns @ _linear(one.fit) + one.fit.residual)
    order = np.argsort(one.table.speed, kind="stable")
    return FrictionCurve(
        axis=one.axis,
        law=one.words,
        speed_unit=robot.parameter_unit(f"friction.{one.axis}.speed"),
        unit_symbol=robot.parameter_unit(f"friction.{one.axis}.coulomb"),
        speed=one.table.speed[order],
        measured=measured[order],
        fitted=fitted[order],
    )


def _linear(fit: FrictionFit) -> FloatArray:
    return fit.value[: fit.columns.shape[1]]
