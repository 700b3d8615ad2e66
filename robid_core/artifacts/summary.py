"""Artifacts in one sentence: what they are by, of and about, without their numbers."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from functools import singledispatch

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts.artifact import Artifact
from robid_core.artifacts.dense_run import DenseRun
from robid_core.artifacts.design import Design
from robid_core.artifacts.doubts import Doubt
from robid_core.artifacts.excitation import Excitation
from robid_core.artifacts.finding import Finding
from robid_core.artifacts.fit import Diagnosis, Fit, ParameterTable, PredictionErrors, TimeComparison
from robid_core.artifacts.frf import Frf
from robid_core.artifacts.friction_curve import FrictionCurve
from robid_core.artifacts.misfit import MisfitTable
from robid_core.artifacts.record import Record
from robid_core.artifacts.report import Report
from robid_core.artifacts.response_check import ResponseCheck
from robid_core.artifacts.separating_experiment import SeparatingExperiment


@singledispatch
def summary(artifact: Artifact) -> str:
    """Say in a sentence what an artifact holds; of a kind without words of its own the lengths of its axes."""
    lengths: dict[str, int] = {}
    for item in dataclasses.fields(artifact):
        value = getattr(artifact, item.name)
        if value is not None and "axes" in item.metadata:
            lengths |= zip(item.metadata["axes"], value.shape, strict=True)
    return ", ".join(f"{name} {length}" for name, length in lengths.items())


@summary.register
def _of_fit(fit: Fit) -> str:
    misfit = f", misfit {fit.misfit:.3g} against {fit.misfit_against}" if fit.misfit_against else ""
    return f"by {fit.method}: {fit.status}{misfit}; {fit.n_agree} of {fit.n_starts} starts agree"


@summary.register
def _of_parameters(table: ParameterTable) -> str:
    free = int(np.isfinite(table.standard_error).sum())
    return f"of {len(table.names)} parameters, {free} with a standard error, {int(table.reported.sum())} reported"


@summary.register
def _of_response(frf: Frf) -> str:
    masked = int((~frf.valid_lines).sum())
    left = f", {masked} lines left out" if masked else ""
    f = frf.frequency_hz
    return (
        f"by {frf.estimator}: {len(frf.response)} configurations, {len(f)} lines from {f.min():.4g} to "
        f"{f.max():.4g} Hz of {_listed(frf.axis_names)}{left}; uncertainty: {frf.pooling}"
    )


@summary.register
def _of_record(record: Record) -> str:
    seconds = sum(run.valid.size * run.sample_time_s for run in record.runs)
    names = dict.fromkeys(name for run in record.runs for name in run.channels)
    lines = "" if record.line is None else f", {len(record.line)} excited lines"
    return (
        f"({record.source}): {len(record.angle)} configurations, {seconds:.4g} s of "
        f"{_listed(record.axis_names)}{lines}; channels {_listed(names)}"
    )


@summary.register
def _of_run(run: DenseRun) -> str:
    n_experiment = int(np.prod(run.valid.shape[:3]))
    missing = int((~run.valid).sum())
    return (
        f"of {n_experiment} experiments, {run.n_period} periods of {len(run.time_s)} samples each "
        f"({len(run.time_s) * run.sample_time_s:.4g} s){f', {missing} samples missing' if missing else ''}"
    )


@summary.register
def _of_excitation(excitation: Excitation) -> str:
    return (
        f"of {_listed(excitation.axis_names)}: periods of {excitation.period_s:.4g} s, {len(excitation.line)} lines, "
        f"{excitation.experiment_time_s:.4g} s in all without settling"
    )


@summary.register
def _of_design(design: Design) -> str:
    return (
        f"by criterion {design.criterion}: the optimum is at most {design.gap:.2g} away, efficiency "
        f"{design.efficiency:.4g} after rounding"
    )


@summary.register
def _of_diagnosis(diagnosis: Diagnosis) -> str:
    named = _listed(f"{one.effect} at {one.where}" for one in diagnosis.findings)
    if named or diagnosis.search is not None:
        return f"by {diagnosis.method}: found {named or 'nothing'}"
    return f"by {diagnosis.method}"


@summary.register
def _of_finding(finding: Finding) -> str:
    ties = f"; these data cannot distinguish it from {_listed(finding.ties)}" if finding.ties else ""
    return (
        f"({finding.kind}): {finding.effect} at {finding.where}, gain {finding.gain:.3g} of twice the log-likelihood, "
        f"p = {finding.p_value:.2g} after the search{ties}"
    )


@summary.register
def _of_separation(experiment: SeparatingExperiment) -> str:
    return experiment.sentence


@summary.register
def _of_comparison(comparison: TimeComparison) -> str:
    return (
        f"of {comparison.channel} of {_listed(comparison.axis_names)}: {len(comparison.time_s)} samples, "
        f"relative error {100 * comparison.relative_error:.3g} %"
    )


@summary.register
def _of_errors(errors: PredictionErrors) -> str:
    return (
        f"of the {errors.quantity} by {errors.model}: {_range(100 * errors.relative)} % of what was measured"
    )


@summary.register
def _of_misfit(misfit: MisfitTable) -> str:
    return (
        f"of {_listed(misfit.axis_names)} in {len(misfit.band_names)} bands: lines {_range(misfit.lines)}, other bins "
        f"{_range(misfit.other)} (1 where the model is right)"
    )


@summary.register
def _of_check(check: ResponseCheck) -> str:
    if check.reason:
        return f"not made: {check.reason}"
    return f"by {check.method}: {int(check.agree.sum())} of {len(check.names)} stiffnesses agree with those by torques"


@summary.register
def _of_friction(curve: FrictionCurve) -> str:
    return (
        f"of {curve.axis}, {curve.law}: {len(curve.speed)} points from {_range(curve.speed)} {curve.speed_unit}, "
        f"friction in {curve.unit_symbol}"
    )


@summary.register
def _of_doubt(doubt: Doubt) -> str:
    return f"({doubt.kind}): {doubt}"


@summary.register
def _of_report(report: Report) -> str:
    return (
        f"(a page of {len(report.html) / 1000:.0f} kB): write it to a file (.html) and open that in a browser"
    )


def _range(values: FloatArray) -> str:
    """Return the smallest and largest number that is known."""
    known = values[np.isfinite(values)]
    if not known.size:
        return "none known"
    return f"{known.min():.3g} to {known.max():.3g}"


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)
