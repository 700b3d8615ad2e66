"""A diagnosis of a blind case as one row of a table: what was hidden, what was told, and whether that is right."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence

import numpy as np

from blind.cases import BlindCase, blind_case
from blind.kinds import RIGHT, Hidden
from blind.plan import Wanted
from robid_core import Context, Diagnosis, Finding, FloatArray
from robid_core.stage import map_in_process
from robid_diagnosis.effects import Effects
from robid_diagnosis.wording import APART, SURE

FIELDS = (
    "stratum", "seed", "n_axis", "kinds", "on", "strengths", "sizes", "classes", "told", "right", "in_class", "kin",
    "wrong", "extras", "alarms", "seen", "ties", "size_error", "size_z", "covered", "stated", "z_squared", "gain",
    "gain_own", "late", "found_late", "misfit", "make_s", "seconds", "commit",
)  # fmt: skip
SIZES: dict[str, tuple[str, ...]] = {
    "friction.stribeck": ("breakaway",),
    "friction.load_dependent": ("load_coulomb",),
    "friction.dahl": ("coulomb",),
    "transmission.backlash": ("gap",),
    "transmission.stiffening": ("cubic",),
    "drive.torque_ripple": ("amplitude",),
    "sensing.resolver_ripple": ("amplitude",),
    "transmission.kinematic_error": ("amplitude",),
    "drive.current_loop": ("time_constant",),
    "load.cable_spring": ("stiffness",),
    "drive.saturation": ("limit",),
    "value.torque_constant": ("error",),
}
"""Parameters of the catalogue that are the first number of a hidden law."""
NEIGHBOURS = {
    "friction": (
        "friction.",
        "a_function_of_motor_speed",
        "a_function_of_load_and_speed",
        "a_function_of_motor_displacement",
    ),
    "transmission": ("transmission.", "friction.dahl", "friction.lugre", "a_function_of_gear_deflection"),
    "drive": ("drive.", "sensing.", "a_function_of_motor_angle", "a_function_of_frequency"),
    "sensing": ("sensing.", "drive.", "a_function_of_motor_angle"),
    "load": ("load.", "a_function_of_motor_angle"),
}
"""What is said of a law that the catalogue lacks, by its family: beginnings of names that are of its class."""
LIKELY = 1.96
NEAR = 4.0  # standard errors
KNOWN = "friction.asymmetric"


def judged(wanted: Wanted, commit: str) -> dict[str, str]:
    """Make a case, diagnose it, and return its row; times are those of the processor, whatever runs beside."""
    began = time.process_time()
    case = blind_case(wanted)
    made = time.process_time() - began
    exclude = RIGHT[wanted.kinds[0]] if wanted.taken_out else ()
    context = Context(
        np.random.default_rng(wanted.seed), map_in_process, lambda *_: None, logging.getLogger("blind")
    )
    began = time.process_time()
    diagnosis = Effects(exclude=exclude, separate=False, response_check=()).run(
        (case.record,), case.told, context
    )
    seconds = time.process_time() - began
    return _row(case, diagnosis) | {"make_s": f"{made:.1f}", "seconds": f"{seconds:.1f}", "commit": commit}


def _row(case: BlindCase, diagnosis: Diagnosis) -> dict[str, str]:
    wanted, findings = case.wanted, diagnosis.findings
    named = [finding for finding in findings if finding.kind != "unknown"]
    things = list(zip(case.hidden, case.classes, strict=True))
    right = [
        any(_tells(thing, alike, finding) for finding in named[: len(things)])
        or _refitted(thing, case, diagnosis)
        for thing, alike in things
    ]
    first = _name(named[0]) if named else ""
    tied = any(_is(thing, tie) for thing in case.hidden for tie in _ties(named[:1]))
    in_class = any(first in alike or (tied and alike) for alike in case.classes)
    extras = [one for one in named if not any(_tells(thing, alike, one) for thing, alike in things)]
    sizes = [_size(thing, size, named) for thing, size in zip(case.hidden, case.sizes, strict=True)]
    known = [size for size in sizes if size is not None]
    stated, covered, squared = _values(case, diagnosis)
    timing = diagnosis.timing
    assert timing is not None
    return {
        "stratum": wanted.stratum,
        "seed": str(wanted.seed),
        "n_axis": str(wanted.n_axis),
        "kinds": " ".join(wanted.kinds),
        "on": " ".join(thing.on for thing in case.hidden),
        "strengths": " ".join(f"{one:.4g}" for one in case.strengths),
        "sizes": " ".join(f"{one:.4g}" for one in case.sizes),
        "classes": " ".join(name for alike in case.classes for name in alike),
        "told": " ".join(f"{finding.kind}:{_name(finding)}" for finding in findings),
        "right": str(all(right) if right else not findings),
        "in_class": str(in_class),
        "kin": str(any(_kin(thing, finding) for thing in case.hidden for finding in findings)),
        "wrong": str(bool(named) and not any(right) and not in_class),
        "extras": str(len(extras) - (in_class and not any(right))),
        "alarms": str(len(findings)),
        "seen": " ".join(f"{one.n_seen}/{len(one.by_configuration)}" for one in named),
        "ties": " ".join(f"{use}@{on}" for use, on in _ties(named)),
        "size_error": " ".join(f"{error:.3g}" for error, _ in known),
        "size_z": " ".join(f"{z:.3g}" for _, z in known if np.isfinite(z)),
        "covered": str(covered),
        "stated": str(stated),
        "z_squared": f"{squared:.4g}",
        "gain": _gain(case.floor, diagnosis),
        "gain_own": _gain(np.where(np.isnan(case.floor), np.nan, case.own_floor), diagnosis),
        "late": f"{case.late:.3f}",
        "found_late": " ".join(f"{lag:.4f}" for lag in timing.lag),
        "misfit": next(
            line.removeprefix("Misfit ")
            for line in diagnosis.verdict.split("\n")
            if line.startswith("Misfit")
        ),
    }


def _name(finding: Finding) -> str:
    return f"{finding.effect}@{finding.on}".replace(" ", "_")


def _kin(thing: Hidden, finding: Finding) -> bool:
    """Whether a finding is at the place of the hidden thing and of its family, as near as it comes without the law."""
    near = NEIGHBOURS.get(thing.kind.partition(".")[0], ())
    return finding.on == thing.on and _name(finding).startswith(near)


def _ties(findings: Sequence[Finding]) -> list[tuple[str, str]]:
    """Effect and place of what findings cannot be told from."""
    parts = (tie.partition(" at ") for finding in findings for tie in finding.ties)
    return [(use, place.partition(" (")[0]) for use, _, place in parts]


def _is(thing: Hidden, told: Finding | tuple[str, str]) -> bool:
    """Whether what was told is the hidden thing, at its place."""
    use, on = told if isinstance(told, tuple) else (told.effect, told.on)
    return use in RIGHT[thing.kind] and (thing.on == "base" or on == thing.on)


def _tells(thing: Hidden, alike: Sequence[str], finding: Finding) -> bool:
    """Whether a finding is the hidden thing, or one of its class that says what it cannot be told from."""
    ties = any(_is(thing, tie) for tie in _ties([finding]))
    return _is(thing, finding) or (_name(finding) in alike and ties)


def _refitted(thing: Hidden, case: BlindCase, diagnosis: Diagnosis) -> bool:
    """Whether a wrong spring is told by its estimate: no cause took its place, and the estimate is right."""
    if thing.kind != "value.stiffness" or diagnosis.findings:
        return False
    table, name = diagnosis.values, f"gear_stiffness.{thing.on}"
    assert table is not None
    i = table.names.index(name)
    estimate, error = float(table.estimate[i]), float(table.standard_error[i])
    told = abs(estimate - table.start[i]) > max(SURE * error, APART * abs(table.start[i]))
    return told and abs(estimate - case.truth.parameter(name)) < NEAR * error


def _size(thing: Hidden, size: float, named: Sequence[Finding]) -> tuple[float, float] | None:
    """Relative error of a size, and its error in standard errors; None where it was not named or has no one number."""
    finding = next((one for one in named if _is(thing, one)), None)
    if finding is None or thing.law is None:
        return None
    (true, *_) = thing.numbers(size)
    values = dict(zip(finding.names, zip(finding.value, finding.standard_error, strict=True), strict=True))
    if thing.kind == KNOWN:  # level forwards less that backwards; one of the two is estimated
        levels = [(s * values[n][0], values[n][1]) for n, s in (("coulomb_forwards", 1), ("coulomb_backwards", -1))
                  if n in values]  # fmt: skip
        found, error = (
            sum(value for value, _ in levels),
            float(np.hypot.reduce([one for _, one in levels] or [0.0])),
        )
    else:
        name = next((name for name in SIZES.get(thing.kind, ()) if name in values), None)
        if name is None or finding.effect != RIGHT[thing.kind][0]:
            return None
        found, error = values[name]
        if name == "amplitude":  # a wave half a turn further on
            found, true = abs(found), abs(true)
    return float(found / true - 1), float((found - true) / error) if error > 0 else float("nan")


def _values(case: BlindCase, diagnosis: Diagnosis) -> tuple[int, int, float]:
    """Stiffnesses with an interval, how many of the 95 % intervals hold the truth, and the sum of squared errors."""
    table = diagnosis.values
    assert table is not None
    rows = [
        (float(table.estimate[i]) - case.truth.parameter(name)) / float(table.standard_error[i])
        for i, name in enumerate(table.names)
        if name in case.truth.layout and case.truth.parameter_kind(name) == "stiffness"
    ]
    z = np.array(rows)
    return len(z), int((np.abs(z) < LIKELY).sum()), float((z**2).sum())


def _gain(floor: FloatArray, diagnosis: Diagnosis) -> str:
    """Share of the error in left-out configurations, above that of noise, that the extended robot does away with."""
    if len(diagnosis.errors) < 2 or np.isnan(floor).any():
        return ""
    before, after = (np.asarray(one.relative) for one in diagnosis.errors[:2])
    axis = int(np.argmax(before - after))
    return f"{(before[axis] - after[axis]) / (before[axis] - floor[axis]):.4g}"
