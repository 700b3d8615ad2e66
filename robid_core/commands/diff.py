"""`robid diff`: what two runs have different: settings, versions, results."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robid_core.commands.fit_screen import aligned, number_text

if TYPE_CHECKING:
    from robid_core.artifacts import Fit
    from robid_core.run import Manifest, RunFolder


MOST = 12  # parameters of a fit that are shown
NEGLIGIBLE = 0.005  # standard errors: less is printed as 0.00
NUISANCE = "nuisance"  # group of parameters that are not the robot's


def command(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN RUN [RUN...]", help="Names or folders of runs, or their pipeline files."),
    ],
    page: Annotated[
        Path | None,
        typer.Option(
            "--page", metavar="FILE", help="Write a page: parameters side by side, responses overlaid."
        ),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="All parameters that differ, in place of those that differ most.")
    ] = False,
) -> None:
    """Compare runs with the first: settings, versions, results; parameters by their difference over its standard error.

    With --page a fit of each run is shown beside the others, with intervals: the last one that differs between them.
    Measured responses are overlaid where runs share a configuration.
    """
    from robid_core.commands.diff_page import write_page
    from robid_core.errors import ConfigurationError
    from robid_core.run import RunFolder
    from robid_core.run.results import manifest_of

    if len(runs) < 2:
        raise ConfigurationError(f"{runs[0]}: one run is no comparison; name two or more")
    folders = [RunFolder.find(run) for run in runs]
    one, *others = folders
    for other in others:
        if len(others) > 1:
            typer.echo(f"{one.path} -> {other.path}")
        found = difference_lines(one, manifest_of(one), other, manifest_of(other), everything)
        typer.echo("\n".join(found))
    if page is not None:
        write_page(folders, page)
        typer.echo(f"page       {page}")


def difference_lines(
    one: RunFolder, old: Manifest, other: RunFolder, new: Manifest, everything: bool = False
) -> list[str]:
    """Return what differs, under headings; one line where nothing does."""
    sections = {
        "settings": setting_lines(old, new),
        "versions": version_lines(old, new),
        "results": result_lines(one, old, other, new, everything),
    }
    lines = []
    for heading, found in sections.items():
        if found:
            lines += [f"{heading}:", *(f"  {line}" for line in found)]
    return lines or ["no difference: the same settings, versions and results"]


def setting_lines(old: Manifest, new: Manifest) -> list[str]:
    """Return what was asked for differently."""
    from robid_core.run.identity import differences

    lines = []
    if old.seed != new.seed:
        lines.append(f"seed: {old.seed} -> {new.seed}")
    if old.robot["written"] != new.robot["written"]:
        lines.append(f"robot: {old.robot['written']} -> {new.robot['written']}")
    elif old.robot != new.robot:
        lines.append(f"robot: {old.robot['written']} says something else in the second")
    for name in [*old.stages, *(name for name in new.stages if name not in old.stages)]:
        if name not in old.stages or name not in new.stages:
            lines.append(f"stage {name}: only in the {'second' if name in new.stages else 'first'}")
            continue
        before, after = dict(old.stages[name].ingredients), dict(new.stages[name].ingredients)
        for left_out in ("inputs", "seed", "robot", "core"):  # told elsewhere, or results
            before.pop(left_out, None)
            after.pop(left_out, None)
        if before and after:
            lines += [f"stage {name}: {line}" for line in differences(before, after)]
    return lines


def version_lines(old: Manifest, new: Manifest) -> list[str]:
    """Return what was computed with other software, threads or machines."""
    from robid_core.run.identity import differences

    before = {**old.environment["versions"], "threads": old.environment["threads"]}
    after = {**new.environment["versions"], "threads": new.environment["threads"]}
    lines = [
        f"{name}: {before.get(name, 'absent')} -> {after.get(name, 'absent')}"
        for name in sorted({*before, *after})
        if before.get(name) != after.get(name)
    ]
    lines += differences({"core": _core(old)}, {"core": _core(new)})
    if old.environment["platform"] != new.environment["platform"]:
        processors = [manifest.environment["platform"].get("processor", "?") for manifest in (old, new)]
        lines.append(f"machine: {processors[0]} -> {processors[1]}")
    return lines


def _core(manifest: Manifest) -> dict[str, Any]:
    """Return which robid a run was made with."""
    found = [
        record.ingredients["core"] for record in manifest.stages.values() if "core" in record.ingredients
    ]
    return dict(found[0]) if found else {}


def result_lines(
    one: RunFolder, old: Manifest, other: RunFolder, new: Manifest, everything: bool = False
) -> list[str]:
    """Return which artifacts differ, and by how much where they are fits."""
    from robid_core.artifacts import Fit
    from robid_core.run.results import refuse_damaged

    for folder, manifest in ((one, old), (other, new)):
        for record in manifest.stages.values():
            if record.file:
                refuse_damaged(folder.path / record.file, record.sha256)
    lines = []
    for name in old.stages:
        if name not in new.stages or old.stages[name].sha256 == new.stages[name].sha256:
            continue
        before, after = old.stages[name], new.stages[name]
        if before.artifact == after.artifact == Fit.__name__:
            lines.append(f"{name}:")
            fits = (Fit.read(one.path / before.file), Fit.read(other.path / after.file))
            lines += [f"  {line}" for line in fit_difference_lines(*fits, everything)]
        elif not before.sha256 or not after.sha256:
            lines.append(f"{name}: no result in the {'second' if before.sha256 else 'first'}")
        else:
            lines.append(f"{name}: other bytes ({before.sha256[:12]}, {after.sha256[:12]})")
    return lines


def _by_occurrence(names: Sequence[str]) -> dict[tuple[str, int], int]:
    """Return the place of each name; equal ones are told apart by which of them they are."""
    return {(name, names[:index].count(name)): index for index, name in enumerate(names)}


def fit_difference_lines(old: Fit, new: Fit, everything: bool = False) -> list[str]:
    """Return the parameters that differ, with the difference over the standard error of the difference.

    The two errors are added as if they were independent. Parameters of the robot that differ most come first, `MOST` of
    them and what the others are; with `everything` all in the order of the fit.
    """
    rows, sizes, kinds = [], [], []
    theirs = _by_occurrence(new.parameters.names)
    ours = _by_occurrence(old.parameters.names)
    for (name, occurrence), index in ours.items():
        kinds.append(old.parameters.groups[index])
        if (name, occurrence) not in theirs:
            rows.append([name, _estimate(old, index), "-", "", ""])
            sizes.append(math.inf)
            continue
        other = theirs[name, occurrence]
        a, b = old.parameters.estimate[index], new.parameters.estimate[other]
        error = math.hypot(old.parameters.standard_error[index], new.parameters.standard_error[other])
        if a == b:
            kinds.pop()
            continue
        over = f"{(b - a) / error:+.2f}" if error > 0 else "-"
        change = f"{100 * (b - a) / a:+.3g} %" if a else "-"
        rows.append([name, _estimate(old, index), _estimate(new, other), change, over])
        sizes.append(abs(b - a) / error if error > 0 else 0.0)
    for (name, occurrence), index in theirs.items():
        if (name, occurrence) not in ours:
            rows.append([name, "-", _estimate(new, index), "", ""])
            sizes.append(math.inf)
            kinds.append(new.parameters.groups[index])
    status = [f"converged: {old.converged} -> {new.converged}"] if old.converged != new.converged else []
    if not rows:
        return [*status, "the estimates are equal; the evidence differs"]
    order = list(range(len(rows)))
    if not everything:
        order.sort(key=lambda place: (kinds[place] == NUISANCE, -sizes[place]))
        worth = [place for place in order if sizes[place] >= NEGLIGIBLE]
        shown = min(MOST, sum(kinds[place] != NUISANCE for place in worth) or len(worth))
        order, left = order[:shown], order[shown:]
        left_lines = _left_lines(
            [kinds[place] for place in left], [sizes[place] for place in left], bool(order)
        )
    else:
        left_lines = []
    head = ["parameter", "first", "second", "change", "over std error"]
    table = aligned([head, *(rows[place] for place in order)], n_left=1) if order else []
    return [*status, *table, *left_lines]


def _estimate(fit: Fit, index: int) -> str:
    table = fit.parameters
    return number_text(float(table.estimate[index]), float(table.standard_error[index]))


def _left_lines(kinds: list[str], sizes: list[float], follows: bool) -> list[str]:
    """Say how many parameters are not shown, and by how much the farthest of them differ."""
    if not kinds:
        return []
    nuisances = kinds.count(NUISANCE)
    parts = [f"{len(kinds) - nuisances} of the robot"] if nuisances < len(kinds) else []
    parts += [f"{nuisances} nuisance parameters"] if nuisances else []
    known = [size for size in sizes if size < math.inf]
    most = f", by {max(known):.2g} standard errors at most" if known else ""
    head = f"... {len(kinds)} more differ" if follows else f"{len(kinds)} parameters differ"
    return [f"{head} ({', '.join(parts)}){most}: --all shows them"]
