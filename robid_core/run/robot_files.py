"""The robots that a run found, as robot files in its folder: `robot.<stage>.yaml`, the nominal robot and what differs.

Only robots that may be used are written: of a fit that did not converge there is none, and an earlier one goes.
"""

from __future__ import annotations

import os
from pathlib import Path

from robid_core.artifacts import Diagnosis, Fit, Model
from robid_core.errors import ConfigurationError
from robid_core.pipeline import StageNode
from robid_core.robot import Robot
from robid_core.robot.file.derived_file import derived_yaml
from robid_core.robot.file.reading import PACKAGED_FILES
from robid_core.run.folder import RunFolder
from robid_core.run.identity import Surroundings
from robid_core.run.verdict_file import verdict_json
from robid_core.stage import MODELLED
from robid_core.store import Entry, Store, failures_named


def keep_robot(node: StageNode, entry: Entry, shared: Surroundings, store: Store) -> None:
    """Bring the robot file of a finished stage up to date, or take it away where the stage found no robot."""
    if not issubclass(node.stage.output, MODELLED):
        return
    artifact = store.read(entry, node.stage.output)
    assert isinstance(artifact, Fit | Diagnosis)
    if isinstance(artifact, Diagnosis) and artifact.search is not None:
        verdict = verdict_json(artifact, shared.pipeline.robot.written, shared.robot_hash)
        store.write(RunFolder.of(shared.pipeline).verdict(node.name), verdict.encode("utf-8"))
    told = artifact.status if isinstance(artifact, Fit) else artifact.verdict
    usable = artifact.converged if isinstance(artifact, Fit) else True
    if artifact.model is None or not usable:
        drop_robot(node, shared, store)
        return
    folder, name = RunFolder.of(shared.pipeline), shared.pipeline.name
    lines = [
        f"What stage '{node.name}' of {name} found; robid run keeps this file up to date.",
        f"{artifact.method}: {told}",
        *(f"{doubt.degree.capitalize()}: {doubt}" for doubt in artifact.doubts),
    ]
    heading = "\n".join(" ".join(line.split()) for line in lines)
    text = robot_text(artifact.model, heading, shared, folder.path).encode("utf-8")
    path = folder.robot(node.name)
    with failures_named("read", path):
        known = path.is_file() and store.files.read(path) == text
    if not known:
        store.write(path, text)


def refuse_own_robot(shared: Surroundings) -> None:
    """Raise ConfigurationError where the nominal robot is a file that this very run keeps up to date."""
    pipeline = shared.pipeline
    folder, source = RunFolder.of(pipeline), Path(pipeline.robot.source)
    for node in pipeline.stages:
        if source.resolve() == folder.robot(node.name).resolve():
            raise ConfigurationError(
                f"robot: {pipeline.robot.written} is what stage '{node.name}' of this run found, and would be its own "
                "base; copy it beside the pipeline (with its `base:`), or give this pipeline another name"
            )


def drop_robot(node: StageNode, shared: Surroundings, store: Store) -> None:
    """Take away the robot file of a stage, where there is one."""
    folder = RunFolder.of(shared.pipeline)
    for path in (folder.robot(node.name), folder.verdict(node.name)):
        with failures_named("remove", path):
            store.files.remove(path)


def robot_text(model: Model, heading: str, shared: Surroundings, folder: Path) -> str:
    """Return a robot file that stands in `folder`: short where the model is of the pipeline's robot, else whole."""
    if model.base_sha256 != shared.robot_hash:
        return "".join(f"# {line}\n" for line in heading.splitlines()) + Robot.of_model(model).to_yaml()
    source = shared.pipeline.robot.source
    base = source if source in PACKAGED_FILES else Path(os.path.relpath(source, folder.resolve())).as_posix()
    return derived_yaml(model, base, heading)
