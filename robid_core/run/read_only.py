"""A run in a folder that cannot be written: where everything is up to date, nothing has to be."""

from __future__ import annotations

import time

from robid_core.artifacts.doubts import NOT_CONVERGED
from robid_core.errors import NotTrustworthy
from robid_core.pipeline import Pipeline
from robid_core.run.beginning import hold_to, new_manifest
from robid_core.run.folder import RunFolder
from robid_core.run.identity import Surroundings
from robid_core.run.manifest import Manifest, warnings_of
from robid_core.run.options import RunOptions, RunResult
from robid_core.run.plan import Action, preview, selection
from robid_core.store import Store


def kept_without_writing(pipeline: Pipeline, options: RunOptions) -> RunResult | None:
    """Return the result of a run that would keep every stage, from what the last one left; None for any other run.

    Nothing is locked: whoever may write here instead replaces files whole.
    """
    began = time.perf_counter()
    folder = RunFolder.of(pipeline)
    if not folder.manifest.is_file():
        return None
    manifest = Manifest.read(folder)
    shared = Surroundings(pipeline, pipeline.robot.load(), warnings_of(manifest))
    if manifest is None:
        return None
    if options.locked:
        hold_to(manifest, folder, new_manifest(shared, options), shared)
    chosen = selection(pipeline, options.first, options.last)
    forced = options.forced(pipeline)
    decisions = preview(pipeline, chosen, forced, shared, Store(folder.path), manifest)
    stages = [manifest.stages.get(decision.stage) for decision in decisions]
    if any(decision.action is not Action.KEEP for decision in decisions) or None in stages:
        return None
    told: dict[str, list[str]] = {"warning": [], "doubt": [], "remark": []}
    unusable = False
    for name, record in manifest.stages.items():
        told["warning"] += [f"stage {name}: {text}" for text in record.warnings if name in chosen]
        for doubt in record.doubts if name in chosen else ():
            told[doubt.get("degree", "doubt")].append(f"stage {name}: {doubt['sentence']}; {doubt['remedy']}")
            unusable |= doubt["kind"] == NOT_CONVERGED
    distrusted = unusable or (options.strict and bool(told["doubt"]))
    return RunResult(
        folder,
        manifest,
        {decision.stage: "kept" for decision in decisions},
        tuple(told["warning"]),
        tuple(told["doubt"]),
        tuple(told["remark"]),
        time.perf_counter() - began,
        NotTrustworthy.exit_code if distrusted else 0,
    )
