"""Runs a pipeline: each stage kept from the store or made, checked, stored and written down."""

from __future__ import annotations

import contextlib
import datetime
import logging
import os
import time
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import replace

from robid_core.artifacts import Diagnosis, Doubt, Fit
from robid_core.artifacts.doubts import NOT_CONVERGED
from robid_core.errors import (
    DataRejected,
    MotionRefused,
    NotTrustworthy,
    PluginError,
    RobidError,
    StoreError,
    said_by,
    with_contexts,
)
from robid_core.executors import one_thread
from robid_core.interruption import heed, signals_as_interrupt
from robid_core.pipeline import Pipeline, StageNode
from robid_core.pipeline.wiring import feeding
from robid_core.run.beginning import executor, hold_to, new_manifest
from robid_core.run.calling import Caller
from robid_core.run.folder import RunFolder
from robid_core.run.guard import named_errors
from robid_core.run.identity import Surroundings, file_hashes
from robid_core.run.lock import run_lock
from robid_core.run.log import NAME, log_file, warnings_kept
from robid_core.run.manifest import (
    StageRecord,
    ending_told,
    readable_manifest,
    refuse_damaged_manifest,
    warnings_of,
)
from robid_core.run.motion import MotionRecords
from robid_core.run.options import RunOptions, RunResult
from robid_core.run.plan import Action, Decision, decide, input_hashes, preview, refuse_unmade, selection
from robid_core.run.progress import Listener, Shielded, Silence
from robid_core.run.read_only import kept_without_writing
from robid_core.run.recording import recording_decision
from robid_core.run.robot_files import drop_robot, keep_robot, refuse_own_robot
from robid_core.run.verification import raw_logs
from robid_core.stage import MODELLED, MapTasks
from robid_core.store import Entry, Files, Store


def run_pipeline(
    pipeline: Pipeline,
    options: RunOptions | None = None,
    listener: Listener | None = None,
    files: Files | None = None,
) -> RunResult:
    """Bring the results of a pipeline up to date.

    Raises
    ------
    RobidError
        As its class says; what was finished before is kept, and the next run goes on from there.
    KeyboardInterrupt
        On Ctrl-C, SIGTERM and SIGHUP, once the stage has stopped what it moves.
    """
    options, listener = options or RunOptions(), Shielded(listener or Silence())
    folder = RunFolder.of(pipeline)
    try:
        folder.make()
        folder.require_writable()
    except StoreError:
        if (result := kept_without_writing(pipeline, options)) is not None:
            return result
        raise
    title = f"run of {pipeline.path} by process {os.getpid()}"
    with (
        signals_as_interrupt(),
        run_lock(folder.lock, options.wait, listener.waiting) as require_held,
        one_thread(),
        log_file(folder.log, title),
        executor(pipeline, options) as tasks,
    ):
        store = Store(folder.path, files, folder.others(), require_held)
        return _Run(pipeline, options, listener, store, tasks).execute()


def preview_run(pipeline: Pipeline, options: RunOptions) -> list[Decision]:
    """Say what `run_pipeline` would do, and why; nothing is run or written."""
    folder = RunFolder.of(pipeline)
    chosen = selection(pipeline, options.first, options.last)
    previous, damage = readable_manifest(folder)
    shared = Surroundings(pipeline, pipeline.robot.load(), warnings_of(previous))
    if options.locked:
        refuse_damaged_manifest(damage)
        hold_to(previous, folder, new_manifest(shared, options), shared)
    return preview(
        pipeline,
        chosen,
        options.forced(pipeline),
        shared,
        Store(folder.path, None, folder.others()),
        previous,
    )


class _Run:
    """One run in progress; the lock is held."""

    def __init__(
        self, pipeline: Pipeline, options: RunOptions, listener: Listener, store: Store, tasks: MapTasks
    ) -> None:
        self.pipeline, self.options, self.listener, self.store = pipeline, options, listener, store
        self.folder = RunFolder.of(pipeline)
        self.previous, self.damage = readable_manifest(self.folder, store.files)
        self.shared = Surroundings(pipeline, pipeline.robot.load(), warnings_of(self.previous))
        if options.locked:
            refuse_damaged_manifest(self.damage)
        self.manifest = new_manifest(self.shared, options)
        self.caller = Caller(self.shared, store, tasks, listener, options)
        others = [RunFolder(path).motions for path in store.others]
        self.motions = MotionRecords(store, self.folder.motions, others)
        self.entries: dict[str, Entry] = {}
        self.outcomes: dict[str, str] = {}
        self.warnings: list[str] = []
        self.doubts: list[str] = []
        self.remarks: list[str] = []
        self.unusable = False

    def execute(self) -> RunResult:
        """Run what is to be run; write the manifest whatever happens."""
        began = time.perf_counter()
        chosen = selection(self.pipeline, self.options.first, self.options.last)
        forced = self.options.forced(self.pipeline) & chosen
        self._refuse_before(chosen, forced)
        self.store.prepare()
        self.found_unfinished = self.motions.unfinished()
        if self.damage:
            place = self.store.set_aside_file(self.folder.manifest)
            self._note(f"{self.damage}; it was set aside as {place}")
        if self.previous is not None and (ending := ending_told(self.previous)):
            self._note(ending)
        self.store.write(self.folder.pipeline, self.pipeline.text.encode())
        try:
            for index, node in enumerate(self.pipeline.stages, start=1):
                heed()
                self._stage(node, index, node.name in chosen, node.name in forced)
                self.manifest.making = ""
                self.manifest.write(self.store, self.folder)
        except BaseException as error:
            stopped = isinstance(error, KeyboardInterrupt)
            self.manifest.ending = said_by(error).partition("\n")[0]
            if isinstance(error, RobidError):
                error.warnings = tuple(self.warnings)
            self._end("interrupted" if stopped else "failed", error)
            raise
        self._end("done")
        seconds = time.perf_counter() - began
        distrusted = self.unusable or (self.options.strict and bool(self.doubts))
        code = NotTrustworthy.exit_code if distrusted else 0
        told = tuple(self.warnings), tuple(self.doubts), tuple(self.remarks)
        return RunResult(self.folder, self.manifest, self.outcomes, *told, seconds, code)

    def _refuse_before(self, chosen: set[str], forced: set[str]) -> None:
        """Raise what can be told before anything runs; take over what the manifest knows of earlier runs."""
        refuse_own_robot(self.shared)
        if self.options.locked:
            hold_to(self.previous, self.folder, self.manifest, self.shared)
        earlier = self.previous.stages if self.previous else {}
        if self.options.first is not None:
            decisions = preview(self.pipeline, chosen, forced, self.shared, self.store, self.previous)
            refused = [name for name, record in earlier.items() if record.outcome == "refused"]
            refuse_unmade(chosen, self.pipeline, decisions, refused)
        for node in self.pipeline.stages:
            if node.name in earlier:
                record = earlier[node.name]
                outcome = "refused" if record.outcome == "refused" else "earlier"
                self.manifest.stages[node.name] = replace(record, outcome=outcome)

    def _stage(self, node: StageNode, index: int, chosen: bool, forced: bool) -> None:
        optional = {item.name for item in node.stage.inputs() if item.optional}
        needed = feeding({p: source for p, source in node.inputs.items() if p not in optional})
        missing = [name for name in needed if name not in self.entries]
        if missing:
            if chosen:
                self._refuse(node, f"needs {' and '.join(missing)}, which gave no result")
            return
        inputs = input_hashes(node, {name: entry.sha256 for name, entry in self.entries.items()})
        decision = decide(node, inputs, self.shared, self.store, self.previous, forced)
        moves = self.shared.moves_hardware(node.stage)
        if moves and chosen:
            decision = recording_decision(decision, self.options, self.motions, self.found_unfinished)
        if decision.action is Action.KEEP and decision.entry is not None:
            self._keep(node, decision.entry, decision)
        elif chosen:
            self._make(node, decision, index, moves)

    def _keep(self, node: StageNode, entry: Entry, decision: Decision) -> None:
        for reason in decision.reasons:
            self._log(node).info("%s", reason)
        self.store.take_over(entry)
        if entry.recording:
            self.motions.finish(node.name, entry.key)
        record = self.previous.stages.get(node.name) if self.previous else None
        seconds = record.seconds if record is not None and record.key == entry.key else 0.0
        self._finish(node, entry, decision, "kept", seconds)

    def _make(self, node: StageNode, decision: Decision, index: int, moves: bool) -> None:
        self.listener.begin(node.name, index, len(self.pipeline.stages), decision.reasons)
        self._log(node).info("begins: %s", "; ".join(decision.reasons))
        if decision.damaged:
            self._set_aside(node, decision)
        self.manifest.making = node.name
        self.manifest.write(self.store, self.folder)  # a process that ends here leaves a trace
        began = time.perf_counter()
        try:
            with warnings_kept() as warned, named_errors(node, self._log(node), self.folder.log):
                entry = self._move(node, decision) if moves else self._compute(node, decision)
        except RobidError as error:
            self.warnings += [f"stage {node.name}: {text}" for text in warned]
            if not isinstance(error, NotTrustworthy):
                raise
            self._refuse(node, str(error))
            return
        record = self.previous.stages.get(node.name) if self.previous else None
        outcome = "same" if record is not None and record.sha256 == entry.sha256 else "made"
        self._finish(node, entry, decision, outcome, time.perf_counter() - began, warned)

    def _compute(self, node: StageNode, decision: Decision) -> Entry:
        artifact = self.caller.call(node, self.entries)
        self._refuse_changed_files(node, decision)
        before = decision.entry
        entry = self.store.put(decision.key, node.name, artifact, decision.ingredients, recording=False)
        if self.options.check and self.store.digest_of(self.caller.call(node, self.entries)) != entry.sha256:
            raise PluginError(
                f"stage {node.name}: R13: {node.plugin} ran twice and gave other bytes; its result cannot be made "
                "again; look for chance without context.generator, clocks, or sets and their order"
            )
        if before is not None and not decision.damaged and before.sha256 != entry.sha256:
            self._note(
                f"stage {node.name}: R13: {node.plugin} gave other bytes than before from the same ingredients; "
                "run with --check to see whether it is deterministic"
            )
        return entry

    def _refuse_changed_files(self, node: StageNode, decision: Decision) -> None:
        """Raise where nobody knows which content of a file a stage has read."""
        before, now = decision.ingredients["files"], file_hashes(node, self.pipeline.data_root)
        if changed := sorted({name for name, _ in before.items() ^ now.items()}):
            raise DataRejected(
                f"stage {node.name}: A13: changed while the stage ran: {', '.join(changed)}; nothing was stored; "
                "run again once nobody writes there"
            )

    def _move(self, node: StageNode, decision: Decision) -> Entry:
        """Record on hardware: begun is on the disk before anything moves, done after the data are."""
        if self.options.again:
            self.motions.give_up()
        self.motions.begin(node.name, decision.key)
        try:
            artifact = self.caller.call(node, self.entries)
        except MotionRefused:  # by its promise: before anything moved
            self.motions.forget(decision.key)
            raise
        entry = self.store.put(decision.key, node.name, artifact, decision.ingredients, recording=True)
        self.motions.finish(node.name, decision.key)
        return entry

    def _finish(
        self,
        node: StageNode,
        entry: Entry,
        decision: Decision,
        outcome: str,
        seconds: float,
        warned: Sequence[str] = (),
    ) -> None:
        path = self.store.publish(node.name, entry)
        self.entries[node.name], self.outcomes[node.name] = entry, outcome
        earlier = self.previous.stages.get(node.name) if self.previous else None
        raw: Mapping[str, str] = {}
        if outcome != "kept":
            raw = raw_logs(self.folder, node.name)
        elif earlier is not None and earlier.key == entry.key:
            raw, warned = earlier.raw, earlier.warnings
        self.warnings += [f"stage {node.name}: {text}" for text in warned]
        self.shared.warnings[node.name] = tuple(warned)
        self.manifest.stages[node.name] = StageRecord(
            outcome=outcome,
            key=entry.key,
            artifact=entry.artifact,
            file=str(path.relative_to(self.folder.path)),
            sha256=entry.sha256,
            recording=entry.recording,
            seconds=round(seconds, 3),
            inputs=node.inputs,
            ingredients=decision.ingredients,
            doubts=[
                {
                    "kind": doubt.kind,
                    "sentence": doubt.sentence,
                    "remedy": doubt.remedy,
                    "degree": doubt.degree,
                }
                for doubt in self._doubts_about(node, entry)
            ],
            warnings=tuple(warned),
            raw=raw,
        )
        keep_robot(node, entry, self.shared, self.store)
        self._log(node).info("%s in %.3f s: sha256 %s", outcome, seconds, entry.sha256)
        self.listener.end(node.name, outcome, seconds)

    def _refuse(self, node: StageNode, why: str) -> None:
        """Go on without a stage whose numbers would not be trustworthy."""
        why = why.removeprefix(f"stage {node.name}: ")
        self.store.withdraw(node.name)
        drop_robot(node, self.shared, self.store)
        self.outcomes[node.name] = "refused"
        self.shared.warnings.pop(node.name, None)
        self.manifest.stages[node.name] = StageRecord("refused", inputs=node.inputs, note=why)
        self.doubts.append(f"stage {node.name}: {why}")
        self.unusable = True
        self._note(f"stage {node.name} gave no result: {why}")
        self.listener.end(node.name, "refused", 0.0)

    def _set_aside(self, node: StageNode, decision: Decision) -> None:
        place = self.store.set_aside(decision.key, decision.entry)
        kept = f"; it was set aside as {place}" if place is not None else ""
        self._note(f"stage {node.name}: R06: {' '.join(decision.reasons)}{kept}; it is made again")

    def _doubts_about(self, node: StageNode, entry: Entry) -> tuple[Doubt, ...]:
        """Return why the result of a fit or a diagnosis should be doubted, and tell it to log and user."""
        if not issubclass(node.stage.output, MODELLED):
            return ()
        artifact = self.store.read(entry, node.stage.output)
        assert isinstance(artifact, Fit | Diagnosis)
        for doubt in artifact.doubts:
            log = self._log(node)
            (log.info if doubt.is_remark else log.warning)("%s: %s", doubt.kind, doubt)
            (self.remarks if doubt.is_remark else self.doubts).append(f"stage {node.name}: {doubt}")
            self.unusable |= doubt.kind == NOT_CONVERGED
        return artifact.doubts

    @staticmethod
    def _log(node: StageNode) -> logging.Logger:
        return logging.getLogger(f"{NAME}.{node.name}")

    def _note(self, text: str) -> None:
        logging.getLogger(NAME).warning(text)
        self.listener.note(text)

    def _end(self, status: str, error: BaseException | None = None) -> None:
        self.manifest.status = status
        self.manifest.finished = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
        try:
            self.manifest.write(self.store, self.folder)
        except StoreError:
            if error is None:
                raise
            _let_go(error)  # perhaps it is the files that a failed stage has open that are too many
            with contextlib.suppress(StoreError):  # the error that is on its way says more
                self.manifest.write(self.store, self.folder)


def _let_go(error: BaseException | None) -> None:
    """Let go what the functions that an error went through hold, open files above all."""
    for each in with_contexts(error):
        traceback.clear_frames(each.__traceback__)
