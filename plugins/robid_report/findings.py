"""What a reader must know before any number: rejected, partial and unconverged results first, then the summary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid_core import Design, Diagnosis, Excitation, Fit, Frf, Record, Truth
from robid_core.plot import noun
from robid_report.numbers import counted, percent, significant
from robid_report.parameters import deviations, relative_error

MASKED_LIMIT = 0.1  # of a configuration's lines; more is rejected data
GAP_LIMIT = 1e-3  # a design further than this from its optimum carries no certificate worth the name


@dataclass(frozen=True)
class Finding:
    """A sentence in the banner; `serious` makes it red."""

    serious: bool
    text: str


@dataclass(frozen=True)
class Fact:
    """A number in the summary strip with what it is."""

    value: str
    label: str


def findings(
    frf: Frf | None,
    fits: Sequence[Fit],
    record: Record | None,
    design: Design | None,
    diagnosis: Diagnosis | None,
    truth: Truth | None,
    warnings: Sequence[str] = (),
) -> list[Finding]:
    """Return everything that limits the use of the results, serious things first; `fits` begin with the page's own.

    `warnings` are those of the stages before the page, as the screen has them.
    """
    found = [
        *_of_record(record),
        *_of_frf(frf),
        *_of_fits(fits),
        *_of_diagnosis(diagnosis),
        *_of_what_explains(fits, diagnosis),
        *_of_truth(fits[0] if fits else None, truth),
        *(Finding(False, f"{text[:1].upper()}{text[1:].rstrip('.')}.") for text in warnings),
    ]
    if design is not None and not design.gap <= GAP_LIMIT:
        found.append(
            Finding(
                True, f"The design is not optimal: another choice may be {significant(design.gap, 2)} better."
            )
        )
    return sorted(found, key=lambda finding: not finding.serious)


def _of_record(record: Record | None) -> list[Finding]:
    if record is None:
        return []
    total = sum(run.valid.size for run in record.runs)
    missing = total - sum(int(run.valid.sum()) for run in record.runs)
    if not missing:
        return []
    return [Finding(True, f"The record is partial: {missing} of {total} samples were not measured.")]


def _of_frf(frf: Frf | None) -> list[Finding]:
    if frf is None:
        return []
    masked = ~frf.valid_lines
    result = []
    share = masked.mean(axis=1)
    for configuration in np.flatnonzero(share > MASKED_LIMIT):
        result.append(
            Finding(
                True,
                f"Configuration {configuration + 1} is rejected: {percent(float(share[configuration]))} of its "
                "lines could not be estimated.",
            )
        )
    few = int(masked[share <= MASKED_LIMIT].sum())
    if few:
        result.append(Finding(False, f"{counted(few, 'line')} could not be estimated and left out."))
    return result


def _of_fits(fits: Sequence[Fit]) -> list[Finding]:
    named = [
        ("Fit" if place == 0 else f"Fit beside it ({fit.method})", fit) for place, fit in enumerate(fits)
    ]
    return [Finding(not doubt.is_remark, f"{name}: {doubt}.") for name, fit in named for doubt in fit.doubts]


def _of_diagnosis(diagnosis: Diagnosis | None) -> list[Finding]:
    found = diagnosis.doubts if diagnosis is not None else ()
    return [Finding(not doubt.is_remark, f"Diagnosis: {doubt}.") for doubt in found]


def _of_what_explains(fits: Sequence[Fit], diagnosis: Diagnosis | None) -> list[Finding]:
    """Say whose numbers to use where a diagnosis names what a doubted fit lacks."""
    if diagnosis is None or not any(fit.is_doubted for fit in fits):
        return []
    causes = dict.fromkeys(f"{one.effect} at {one.on}" for one in diagnosis.findings if one.kind == "cause")
    if not causes or any(not doubt.is_remark for doubt in diagnosis.doubts):
        return []
    return [
        Finding(
            False,
            f"The diagnosis names what the fitted model lacks: {', '.join(causes)}. Use the robot that it found; the "
            "parameters of the fit were estimated without it.",
        )
    ]


def _of_truth(fit: Fit | None, truth: Truth | None) -> list[Finding]:
    if fit is None or truth is None:
        return []
    far = [
        name
        for name, d, shown in zip(
            fit.parameters.names, deviations(fit.parameters, truth), fit.parameters.reported, strict=True
        )
        if d is not None and shown and d.error > 0 and abs(d.share) > 4 * d.error
    ]
    if not far:
        return []
    return [Finding(False, f"More than four standard errors from the truth: {', '.join(far)}.")]


def facts(
    frf: Frf | None,
    fit: Fit | None,
    record: Record | None,
    design: Design | None,
    diagnosis: Diagnosis | None,
    truth: Truth | None,
) -> list[Fact]:
    """Return the few numbers that a reader looks for first."""
    result: list[Fact] = []
    if fit is not None:
        result += _fit_facts(fit, truth)
    for comparison in diagnosis.time if diagnosis is not None else ():
        loop = "closed-loop " if diagnosis is not None and diagnosis.method.startswith("closed-loop") else ""
        result.append(Fact(percent(comparison.relative_error), f"{loop}error of {noun(comparison)}"))
    if frf is not None:
        result.append(
            Fact(
                f"{len(frf.response)} × {len(frf.frequency_hz)}",
                f"configurations × lines, {frf.frequency_hz[0]:.3g} to {frf.frequency_hz[-1]:.3g} Hz",
            )
        )
    elif fit is None and (recorded := _recorded(record, diagnosis)):
        seconds, sources = recorded
        several = f" in {len(sources)} recordings" if len(sources) > 1 else ""
        result.append(Fact(f"{significant(seconds, 3)} s", f"recorded{several}"))
    if design is not None:
        result.append(Fact(str(design.n_config), "configurations chosen for the next robot"))
    return result


def _recorded(record: Record | None, diagnosis: Diagnosis | None) -> tuple[float, tuple[str, ...]] | None:
    """Return how long was recorded, in s, and from where: what a diagnosis looked at, or the page's own record."""
    data = diagnosis.data if diagnosis is not None else None
    if data is not None and data.sources:
        return data.seconds, data.sources
    if record is None:
        return None
    return sum(run.valid.size * run.sample_time_s for run in record.runs), (record.source,)


def _fit_facts(fit: Fit, truth: Truth | None) -> list[Fact]:
    table = fit.parameters
    shown = np.flatnonzero(table.reported)
    groups = {table.groups[i] for i in shown}
    what = "stiffness" if groups == {"stiffness"} else "parameter"
    what += "" if len(shown) == 1 else "es" if what == "stiffness" else "s"
    result = [Fact(str(len(shown)), f"{what} estimated")]
    known = [d for i, d in enumerate(deviations(table, truth)) if d is not None and table.reported[i]]
    if known:
        shares = [abs(d.share) for d in known]
        result.append(Fact(percent(float(np.median(shares))), "median deviation from the truth"))
        result.append(Fact(percent(max(shares)), "largest deviation from the truth"))
    errors = np.abs(
        table.standard_error[shown] / np.where(table.estimate[shown] == 0, np.nan, table.estimate[shown])
    )
    if np.isfinite(errors).any():
        result.append(Fact(relative_error(float(np.nanmedian(errors)), 1.0), "median standard error"))
    for comparison in fit.time:
        result.append(Fact(percent(comparison.relative_error), f"relative error of {noun(comparison)}"))
    if fit.n_starts > 1:
        result.append(Fact(f"{fit.n_agree} of {fit.n_starts}", "starts agree"))
    return result


def _misfit(fit: Fit) -> str:
    if fit.misfit_against:
        value = significant(fit.misfit, 3)
        return f"misfit {value} against {fit.misfit_against} (1 where model and uncertainty are right)"
    return "the misfit is one by choice of the weights, and checks nothing"


def steps(
    excitation: Excitation | None,
    record: Record | None,
    frf: Frf | None,
    fit: Fit | None,
    design: Design | None,
    diagnosis: Diagnosis | None = None,
) -> list[tuple[str, str]]:
    """Return what was done, one (noun, sentence) for each artifact that is at hand."""
    result: list[tuple[str, str]] = []
    if excitation is not None:
        n_realization, n_block, n_exp, _, _ = excitation.reference.shape
        band = (
            f"{excitation.frequency_hz[0]:.3g} to {excitation.frequency_hz[-1]:.3g} Hz"
            if len(excitation.line)
            else ""
        )
        result.append(
            (
                "Excitation",
                f"{counted(len(excitation.line), 'line')}, {band}, period {excitation.period_s:g} s, "
                f"{counted(n_block, 'block')} of {counted(n_exp, 'experiment')}, "
                f"{counted(n_realization, 'realisation')}",
            )
        )
    if record is not None:
        recorded = _recorded(record, diagnosis if fit is None else None)
        assert recorded is not None
        seconds, sources = recorded
        names = sorted({name for run in record.runs for name in run.channels})
        head = sources[0] if len(sources) == 1 else f"{len(sources)} ({sources[0]} to {sources[-1]})"
        word = "Record" if len(sources) == 1 else "Records"
        result.append((word, f"{head}: {significant(seconds, 4)} s of {', '.join(names)}"))
    if frf is not None:
        result.append(("Frequency response", f"{frf.estimator}; uncertainty: {frf.pooling or 'none stated'}"))
    if fit is not None:
        result.append(("Fit", f"{fit.method}: {fit.status}; {_misfit(fit)}"))
    if design is not None:
        result.append(
            (
                "Design",
                f"criterion {design.criterion}, certificate: no choice is better by more than "
                f"{significant(design.gap, 2)}, rounding keeps {percent(design.efficiency)} of it",
            )
        )
    return result
