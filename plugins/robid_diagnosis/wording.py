"""The verdict in words: one line a finding, then values, then where nothing was found."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from robid_core import (
    DiagnosedData,
    Finding,
    FloatArray,
    ParameterTable,
    PredictionErrors,
    ResponseCheck,
    Robot,
    is_by_tolerance,
)
from robid_diagnosis.intervals import over_axes

SURE = 5.0  # standard errors from zero, or from what was told: what is read out
RESIDUAL = 0.5  # of a gain: where data show less of it, tolerances of told numbers show the rest
REFITTED = ("stiffness", "inertia")  # groups of values of which the verdict tells
APART = 0.02  # of what was told: values that are nearer to it are not read out
BEYOND = 3.0  # standard deviations of a tolerance: likewise
SHOWN = 5  # values
MANY_DIGITS = 4
BETTER = 1.005  # a gain that rounds to more than one
FREE = "a function of "  # of speed, load, angle...: what is free in its shape
MUCH_LACKS = 10.0  # misfit: above, noise is less than a tenth of what is left
LOADED = 0.1  # of the largest gravity torque that was recorded: less has no sign worth telling
MORE = 1.2  # times the largest, or less than the smallest over this: another load
TOGETHER = 3  # numbers of a body that are read out where none moved by itself
RESTING = 0.005  # share of the samples at rest: less is not a percent
MOVED = 2.0  # standard errors from what was told: numbers that moved less are not read out


def finding_line(
    finding: Finding, n_config: int, n_left_out: int = 0, unexplained: Collection[str] = ()
) -> str:
    """One line: where, what, how large, how sure.

    `n_left_out`: experiments in which its robot rattles; `unexplained`: axes at which something acts that no effect
    explains: a value that is fitted there may stand for it.
    """
    if finding.kind == "unknown" and not finding.names:
        return (
            f"{finding.on}: no effect of the catalogue explains the residual; {finding.effect} would "
            f"(twice the log-likelihood rises by {finding.gain:.3g})."
        )
    a_law = any(tie.startswith(FREE) for tie in finding.ties)
    what = {
        "cause": "{}",
        "partial": "{}, or a law at one axis that the catalogue lacks"
        if a_law
        else "{} explains a part; nothing in the catalogue explains the rest",
        "value": "a part is explained by another value, which may stand for what nothing explains here: {}"
        if finding.on in unexplained
        else "wrong value: {}",
    }[finding.kind].format(finding.effect if finding.kind != "value" else f"{finding.effect} of {finding.on}")
    rows = list(
        zip(finding.names, finding.value, finding.standard_error, finding.nominal, finding.units, strict=True)
    )
    moved = [row for row in rows if not abs(row[1] - row[3]) <= MOVED * row[2]]
    sizes = ", ".join(_size(*row) for row in moved or rows)
    if finding.kind == "value" and not moved and len(rows) > 1:
        furthest = sorted(rows, key=lambda row: -abs(row[1] - row[3]) / row[2])[:TOGETHER]
        sizes = f"{', '.join(_size(*row) for row in furthest)}; the data determine combinations of them alone"
    seen = ""
    if np.isfinite(finding.by_configuration).all():
        seen = f"; seen in {finding.n_seen} of {n_config} configuration{'' if n_config == 1 else 's'}"
        if finding.by_configuration.sum() < RESIDUAL * finding.gain:
            seen = "; without it parameters of the robot file would leave their tolerances"
            if n_left_out:
                seen = "; shown by the experiments that are not used, in which it rattles"
    chance = chance_text(finding.p_value)
    ties = f"these data cannot distinguish it from {', '.join(finding.ties)}" if finding.ties else "tie: none"
    return f"{finding.where}: {what} ({sizes}){seen}; {chance} after the search; {ties}."


def increment_line(finding: Finding, robot: Robot) -> str:
    """Say that the robot file has such an effect there already, whose numbers the found ones add to; else nothing."""
    labels = [
        label
        for label, one in robot.description.effects.items()
        if (one.use, one.on) == (finding.effect, finding.on) and one.side in (None, finding.side)
    ]
    if not labels:
        return ""
    its_own = ", ".join(f"effect.{labels[0]}.{name}" for name in finding.names)
    return (
        f"The robot file has {finding.effect} at {finding.on} already (effects: {', '.join(labels)}): what was found "
        f"adds to it. Its own numbers may be wrong: free them in a fit (`fit.torque_residual`, free: {its_own})."
    )


def own_friction_line(findings: Sequence[Finding], robot: Robot) -> str:
    """Say what sizes of friction at motors add to: the axis' own Coulomb friction; empty where there is none."""
    axes = list(
        dict.fromkeys(
            one.on
            for one in findings
            if one.effect.startswith("friction.")
            and one.side == "motor"
            and f"friction.{one.on}.coulomb" in robot.layout
        )
    )
    if not axes:
        return ""
    keys = ", ".join(f"friction.{name}.coulomb" for name in axes)
    return f"Sizes of friction at motors add to the axis' own ({keys}), which the extended robot keeps."


def chance_text(p_value: float, least: float = 1e-3) -> str:
    """A p-value, or that it is below the smallest one that is stated."""
    return f"p < {least:g}" if p_value < least else f"p = {p_value:.2g}"


def separation_line(finding: Finding) -> str:
    """Say with which experiment a finding is told from its ties; empty where it has none, or none could be tried."""
    return "" if finding.separation is None else f"{finding.where}: {finding.separation.sentence}."


def load_text(axis: str, here: float, recorded: FloatArray, load: str = "gravity") -> str:
    """Say how a load at rest, gravity or another one, differs from where it was recorded, N m; empty where it does not.

    `here` and `recorded`, (n_config,), are torques of the motor of an axis.
    """
    largest = float(np.abs(recorded).max(initial=0.0))
    if (recorded * here < 0).all() and abs(here) > LOADED * largest:
        how = "opposite"
    elif abs(here) > MORE * largest:
        how = "larger"
    elif MORE * abs(here) < float(np.abs(recorded).min(initial=np.inf)):
        how = "smaller"
    else:
        return ""
    return f"{how} {load} torque at {axis}: {here:.2g} N m, recorded {recorded.min():.2g} to {recorded.max():.2g} N m"


def place_text(use: str, on: str | None, side: str | None) -> str:
    """An effect and where it acts."""
    return f"{use} at {on}" + (f" ({side})" if side else "")


def settling_line(axes: Sequence[str]) -> str:
    """Say which axes still settled; empty where none did."""
    if not axes:
        return ""
    return (
        f"{', '.join(axes)} had not settled before the first period: what is found may be what was still ringing; "
        "leave out leading periods (discard: 1), or let the machine settle longer."
    )


def left_out_line(left_out: Sequence[int], n: int) -> str:
    """Say how many experiments of which configurations do not count, from those of each; empty where all do."""
    where = [str(number) for number, count in enumerate(left_out, start=1) if count]
    if not where:
        return ""
    return (
        f"{sum(left_out)} of {experiments_text(n)} {'is' if sum(left_out) == 1 else 'are'} not used (configuration "
        f"{', '.join(where)}): with what was found the model rattles there and does not repeat its motion as the "
        "machine did; in a gap that was found too wide it does so, too. Errors of prediction contain them. Smaller "
        "or slower motions, or a load on the axis, avoid that."
    )


def rests_line(axis_names: Sequence[str], at_rest: Sequence[float]) -> str:
    """Say which share of the samples does not count, since friction holds an axis at them; empty where all do."""
    told = [
        f"{name} {100 * share:.0f} %"
        for name, share in zip(axis_names, at_rest, strict=True)
        if share > RESTING
    ]
    if not told:
        return ""
    return (
        f"Samples at which friction holds an axis do not count in its torque: {', '.join(told)} of the samples. "
        "At rest, and where an axis turns back more abruptly than its angle resolves, it is any torque up to its "
        "level; what acts at turns alone is not seen."
    )


def sticking_line(axis_names: Sequence[str]) -> str:
    """Say which axes seem to be held by friction where they turn back, as only the torque shows; empty where none."""
    if not axis_names:
        return ""
    turn = "turns" if len(axis_names) == 1 else "turn"
    return (
        f"Where {' and '.join(axis_names)} {turn} back, torque is no function of the speed, and no effect explains it; "
        "without these samples next to nothing is left. Friction that turns more abruptly than the measured angle "
        "resolves, and holds a motor for a moment, is like that: a finer encoder shows it. at_rest: keep counts them."
    )


def untried_line(names: Sequence[str]) -> str:
    """Say which effects could be tried nowhere; empty where all could."""
    if not names:
        return ""
    return f"Not tried, since they cannot be used: {', '.join(names)} (robid doctor says why)."


def held_line(names: Sequence[str]) -> str:
    """Say which springs and dampers keep the value of the robot file; empty where the data determine all of them."""
    if not names:
        return ""
    more = f"; {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"These data do not determine {', '.join(names[:SHOWN])}{more}: taken from the robot file."


def values_line(values: ParameterTable, misfit: float) -> str:
    """Say which springs, bodies and rotors are not as they were told, the furthest from it first; empty if none is.

    Where much lacks, what is fitted stands for it, and no error says how far: with the misfit that is left.
    """
    told = np.where(values.start == 0, np.nan, values.start)
    relative, error = values.estimate / told - 1, values.standard_error / np.abs(told)
    apart = np.array([group in REFITTED for group in values.groups])
    apart &= np.abs(np.nan_to_num(relative)) > np.maximum(SURE * error, APART)
    if values.prior is not None:  # bodies are told within a tolerance, springs are not
        bodies = np.array([group == "inertia" for group in values.groups])
        apart &= ~bodies | (np.abs(values.estimate - values.start) > BEYOND * values.prior)
    furthest = sorted(np.flatnonzero(apart), key=lambda i: -abs(np.log(abs(1 + relative[i]))))
    by_tolerance = list[str]()
    if values.prior is not None:
        by_tolerance = [
            values.names[i]
            for i in furthest
            if bodies[i] and is_by_tolerance(values.standard_error[i], values.prior[i])
        ]
        furthest = [i for i in furthest if values.names[i] not in by_tolerance]
    lines = [
        f"{values.names[i]} is {100 * abs(relative[i]):.3g} ± {100 * error[i]:.1g} % "
        f"{'larger' if relative[i] > 0 else 'smaller'} than in the robot file"
        for i in furthest[:SHOWN]
    ]
    more = f"; {len(furthest) - SHOWN} more" if len(furthest) > SHOWN else ""
    doubt = "these cannot be distinguished from what the model lacks: " if misfit > MUCH_LACKS else ""
    told_apart = f"Values: {doubt}{'; '.join(lines)}{more}." if lines else ""
    return "\n".join(line for line in (told_apart, _tolerance_line(by_tolerance)) if line)


def _tolerance_line(names: Sequence[str]) -> str:
    """Name numbers of bodies that left their tolerances though the data determine combinations of them alone."""
    if not names:
        return ""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return (
        f"Beyond their tolerances, too: {', '.join(names[:SHOWN])}{more}; these data determine only combinations of "
        "them, and how much of a change each takes follows from the tolerances (prior)."
    )


def response_check_line(check: ResponseCheck) -> str:
    """Say whether frequency responses agree about the stiffnesses, or why there are none to ask."""
    if check.reason:
        return f"No check by frequency responses: {check.reason}."
    n = len(check.names)
    order = np.argsort(-np.abs(check.z))
    apart = order[~check.agree[order]].tolist()
    if not apart:
        worst = int(order[0])
        which = f"{n} stiffnesses, all that both determine; furthest apart" if n > 1 else "the stiffness"
        return (
            f"Check by frequency responses, fitted separately: they agree about {which}: {check.names[worst]}, "
            f"{_both(check, worst)}."
        )
    told = "; ".join(f"{check.names[i]}, {_both(check, i)}" for i in apart[:SHOWN])
    more = f"; {len(apart) - SHOWN} more" if len(apart) > SHOWN else ""
    return (
        f"Check by frequency responses, fitted separately: they disagree about {len(apart)} of {n} stiffnesses: "
        f"{told}{more}."
    )


def _both(check: ResponseCheck, i: int) -> str:
    """What both ways say of a stiffness, and how far that is apart."""
    return (
        f"{plain(check.by_responses[i])} ± {check.responses_error[i]:.2g} {check.units[i]} by responses, "
        f"{plain(check.by_torques[i])} ± {check.torques_error[i]:.2g} by torques: {abs(check.z[i]):.1f} standard "
        f"errors, where {check.limit:.1f} would count as a difference"
    )


def silent_line(
    axis_names: Sequence[str], findings: Sequence[Finding], doubtful: bool, refused: bool = False
) -> str:
    """Say at which axes nothing was found.

    `doubtful`: something is left that nothing explains. `refused`: what was asked for gains more than chance.
    """
    silent = [name for name in axis_names if not any(finding.on.startswith(name) for finding in findings)]
    if len(silent) == len(axis_names):
        if doubtful:
            return "No effect that was tried explains what the refitted model leaves."
        if findings:
            return "No axis has an effect of its own."
        if refused:
            return "No cause is named: what was asked for gains more than chance, and not enough."
        return (
            "Nothing significant: the robot file with fitted values and delays explains these data; "
            "for detectable sizes see the table on the page."
        )
    return (
        f"{', '.join(silent)}: nothing significant; for detectable sizes see the table on the page."
        if silent
        else ""
    )


def data_line(data: DiagnosedData) -> str:
    """Say what was looked at, and against what."""
    apart = f"; {experiments_text(data.n_test)} held out" if data.n_test else ""
    loads = f" with {', '.join(data.variants)}" if data.variants else ""
    where = "1 configuration" if data.n_config == 1 else f"{data.n_config} configurations"
    return (
        f"Data: {experiments_text(data.n_experiment)} in {where}{loads}, bins to {data.highest_hz:.4g} Hz, noise: "
        f"{' and '.join(data.noise)}{apart}."
    )


def experiments_text(count: int) -> str:
    """How many experiments."""
    return "1 experiment" if count == 1 else f"{count} experiments"


def misfit_line(refitted: float, found: float | None) -> str:
    """Say how far from the noise models are: with all values refitted, and with what was found, if anything was."""
    text = f"Misfit {refitted:.3g} with all values refitted"
    if found is None:
        return f"{text}."
    why = "" if found <= refitted else " (more, since that robot passes on less of the noise of the angles)"
    return f"{text}, {found:.3g} with what was found{why}."


def errors_line(models: Sequence[PredictionErrors], gain: FloatArray) -> str:
    """Say how far off the models are, what the last gains with its interval, (2,), and where it is worst."""
    first, last = models[0], models[-1]
    whole = [float(over_axes(one.relative)) for one in models]
    shares = ", ".join(
        f"{100 * share:.3g} % with the {one.model}" for one, share in zip(models, whole, strict=True)
    )
    text = f"{first.quantity.capitalize()}, rms over the axes: {shares}"
    if len(models) > 1 and whole[-1] > 0 and whole[0] / whole[-1] > BETTER:
        text += f" ({three_digits(whole[0] / whole[-1])} times better"
        text += (
            f", 95 % interval {three_digits(gain[0])} to {three_digits(gain[1])})"
            if np.isfinite(gain).all()
            else ")"
        )
    if last.noise is not None:
        text += f"; noise alone leaves {100 * float(over_axes(last.noise)):.3g} %"
    worst = int(np.argmax(np.nan_to_num(last.relative)))
    if len(last.axis_names) > 1:
        each = zip(last.axis_names, last.relative.tolist(), strict=True)
        text += f"; {', '.join(f'{name} {100 * share:.3g} %' for name, share in each)}"
    text += f"; worst on {last.axis_names[worst]}, {last.rms[worst]:.3g} {last.unit_symbol} rms."
    resting = [name for name, still in zip(last.axis_names, last.still, strict=True) if still]
    if resting:
        text += f" {', '.join(resting)} moved too little for percentages to mean much."
    return text


def three_digits(value: float) -> str:
    """Large numbers written out."""
    return f"{float(f'{value:.3g}'):.15g}"


def _size(name: str, value: float, error: float, told: float, unit: str) -> str:
    """A number with its standard error where one is stated, its unit, and what was told where it was."""
    text = f"{name} {plain(value)}" + (f" ± {error:.2g}" if np.isfinite(error) else "")
    text += f" {unit}" if unit not in ("", "1") else ""
    text += "" if np.isfinite(error) else ", not determined"
    return text + (f", robot file {plain(told)}" if np.isfinite(told) else "")


def plain(value: float) -> str:
    """Four digits."""
    return f"{value:.{MANY_DIGITS}g}"
