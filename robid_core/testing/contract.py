"""The contract of stages, as one function that a plugin's test calls.

Settings survive YAML; `run` is deterministic to the byte, leaves its inputs and the global state of chance
alone, gives what its kind promises, and that survives writing and reading; all for 1, 2 and 6 axes. What each kind
promises beside its shape stands in a file of its own: `estimators` (a plant known in closed form), `fits` (a known
robot), `designs` (the certificate), `diagnoses` (nothing wrong, and a planted cause), `acquisitions`, `reports`. A
clause that is broken is a ContractBroken whose message says which.
"""

from __future__ import annotations

import functools
import inspect
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from robid_core.artifacts import (
    Artifact,
    Configurations,
    Design,
    Diagnosis,
    Excitation,
    Fit,
    Frf,
    Model,
    Record,
    Report,
    Truth,
)
from robid_core.compiled.telling import compilation_told
from robid_core.drives import Drives
from robid_core.errors import RobidError
from robid_core.pipeline.checking import check
from robid_core.robot import Robot
from robid_core.run.arguments import arguments_of
from robid_core.stage import KINDS, Context, DiagnosisStage, Estimator, FrfEstimator, ReportStage, Stage
from robid_core.testing.acquisitions import check_record
from robid_core.testing.broken import ContractBroken
from robid_core.testing.compiling import compiled_beside
from robid_core.testing.designs import check_design
from robid_core.testing.diagnoses import check_null_and_cause
from robid_core.testing.estimators import (
    EXACT,
    check_covers_truth,
    check_hands_on_what_no_residual_shows,
    check_recovers_plant,
    note_missing_uncertainty,
)
from robid_core.testing.fits import Data, check_recovers_parameters
from robid_core.testing.inputs import EXAMPLES, example_of, example_record, example_truth
from robid_core.testing.lending import example_context, example_drives
from robid_core.testing.plants import MassSpringPlant, plant_record
from robid_core.testing.reports import check_page, check_text_stays_text, planted
from robid_core.testing.robots import example_robot
from robid_core.yaml_file.kind import PIPELINE_FILE
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.problems import ProblemList

Examples = Callable[..., Mapping[type[Artifact], Artifact]]
FIT_TOLERANCE = (
    0.01  # relative, beside six standard errors: what a simulated motion has that a linear model has not
)

SMALL = 2  # axes of a robot of which a diagnosis is tried with several poses and blocks


def check_stage(
    cls: type[Stage],
    *,
    for_axes: Sequence[int] = (1, 2, 6),
    data_root: Path = Path(),
    artifacts: Examples | None = None,
    recovery: bool = True,
    recovery_tolerance: float | None = None,
    **settings: Any,
) -> None:
    """Check that a stage keeps the contract.

    Parameters
    ----------
    cls
        The stage.
    for_axes
        Sizes of the robots it is tried with.
    data_root
        Where it finds measured data, if it reads any.
    artifacts
        Inputs for a robot by type, in place of `example_artifacts`, for a stage that needs better ones. A fit and a
        diagnosis are measured by it on other plants, too: `artifacts(robot)` must then be a measurement of that robot,
        `artifacts(robot, seed=...)` one with noise of its own, without which standard errors are not checked.
    recovery
        Whether a fit has to find known plants, and a diagnosis to tell a right model from a wrong one; false for one
        whose inputs do not depend on the robot that `artifacts` is given, which then has to be tested elsewhere.
    recovery_tolerance
        By how much an estimator may miss a closed-form plant without noise, relative to the largest entry at the
        line (by default 1e-8; local models are only nearly right on 30 lines), and a fit its parameters beside six
        standard errors (by default 1 %).
    settings
        Its settings, as they stand under `with:`.

    Raises
    ------
    ContractBroken
        With the clause that is broken.

    Examples
    --------
    >>> from robid_core import Configurations, CandidateDesign, Robot
    >>> from robid_core.testing import check_stage
    >>> class Zero(CandidateDesign):
    ...     "Stand where all angles are zero."
    ...     def run(self, robot: Robot) -> Configurations:
    ...         return Configurations(robot.axis_names, 0 * robot.drives.lower[None])
    >>> check_stage(Zero, for_axes=(1,))
    """
    stage = check_settings(cls, **settings)
    with compilation_told(), compiled_beside() if issubclass(cls, DiagnosisStage) else nullcontext():
        for n_axis in for_axes:
            robot = _robot(n_axis)
            given = artifacts(robot) if artifacts is not None else _enough_for(cls, robot)
            arguments = {
                entry.name: [_of_type(given, entry.artifact, n_axis)]
                * _how_many(cls, entry.many, n_axis, for_axes)
                for entry in cls.inputs()
            }
            _check_run(stage, arguments, robot, data_root)
        needed = {entry.name: arguments[entry.name] for entry in cls.inputs() if not entry.optional}
        if len(needed) < len(arguments):
            _check_run(stage, needed, robot, data_root)
        if isinstance(stage, ReportStage):
            _check_text(stage, arguments, robot, data_root)
        _check_kind(stage, for_axes, artifacts, recovery, recovery_tolerance)


def _check_text(
    stage: ReportStage, inputs: Mapping[str, list[Artifact]], robot: Robot, data_root: Path
) -> None:
    """Check a page of artifacts that have markup in their texts."""
    hostile = {key: [planted(one) for one in artifacts] for key, artifacts in inputs.items()}
    arguments: dict[str, Any] = {**arguments_of(stage, hostile, example_context().log)}
    with tempfile.TemporaryDirectory() as temporary:
        page = stage.run(**arguments, **_lent(stage, robot, data_root, Path(temporary)))
    check_text_stays_text(type(stage).__name__, page)


def _check_kind(
    stage: Stage, for_axes: Sequence[int], artifacts: Examples | None, recovery: bool, tolerance: float | None
) -> None:
    """Check what takes runs of their own: estimators and fits on known plants, diagnoses with and without a cause."""
    robot = _robot(min(for_axes))
    if isinstance(stage, FrfEstimator):
        for n_axis in for_axes:
            check_recovers_plant(stage, n_axis, EXACT if tolerance is None else tolerance)
        if not check_covers_truth(stage):
            note_missing_uncertainty(stage)
        check_hands_on_what_no_residual_shows(stage)
    elif isinstance(stage, Estimator) and recovery:
        seeded = artifacts is None or "seed" in inspect.signature(artifacts).parameters
        wide = FIT_TOLERANCE if tolerance is None else tolerance
        repetitions = {} if seeded else {"repetitions": 1}
        check_recovers_parameters(stage, robot, _measured_by(artifacts), wide, **repetitions)
    elif isinstance(stage, DiagnosisStage) and recovery:
        check_null_and_cause(stage, robot, _measured_by(artifacts))


def _measured_by(artifacts: Examples | None) -> Data | None:
    """Return what measures a plant with noise of a seed, where the author's function takes one."""
    if artifacts is None:
        return None
    if "seed" in inspect.signature(artifacts).parameters:
        return lambda plant, seed: artifacts(plant, seed=seed)
    return lambda plant, seed: artifacts(plant)


def check_settings(cls: type[Stage], **settings: Any) -> Stage:
    """Check a stage's declaration and that its settings survive YAML; return the stage."""
    if not (isinstance(cls, type) and issubclass(cls, Stage)):
        of = cls.__name__ if isinstance(cls, type) else f"an object of {type(cls).__name__}"
        raise ContractBroken(
            f"{of} is no stage; give a class that is derived from a kind such as robid_core.FrfEstimator"
        )
    name = cls.__name__
    if cls.kind not in {kind.kind for kind in KINDS} or not issubclass(cls, KINDS):
        raise ContractBroken(f"{name} is of no kind; derive it from one such as robid_core.FrfEstimator")
    if not (cls.__doc__ or "").strip() or cls.__doc__ in {kind.__doc__ for kind in KINDS}:
        raise ContractBroken(f"{name} has no docstring; `robid stages` shows it to the user")
    cls.inputs(), cls.lends()
    stage = cls(**settings)
    text = stage.model_dump_json(by_alias=True)  # JSON is YAML
    problems = ProblemList(name)
    root = read_nodes(text, PIPELINE_FILE, problems)
    again = check(cls, root, (), problems) if root is not None else None
    if again is None:
        raise ContractBroken(f"{name}: its settings do not survive YAML: {problems.problems[0]}")
    if again.model_dump_json(by_alias=True) != text:
        raise ContractBroken(f"{name}: settings change on their way through YAML: {text} became {again!r}")
    try:
        cls.model_validate({**stage.model_dump(), "no_such_setting": 1})
    except ValidationError:
        pass
    else:
        raise ContractBroken(f"{name} takes unknown settings; keep model_config of robid_core.Stage")
    try:
        field = next(iter(cls.model_fields), "no_such_setting")
        setattr(stage, field, None)
    except ValidationError:
        return stage
    raise ContractBroken(f"{name} is mutable; keep model_config of robid_core.Stage")


def _how_many(cls: type[Stage], many: bool, n_axis: int, for_axes: Sequence[int]) -> int:
    """Return how many artifacts an input gets: two where it takes many, of a diagnosis on the smallest robot only."""
    return 2 if many and (n_axis == min(for_axes) or not issubclass(cls, DiagnosisStage)) else 1


def _enough_for(cls: type[Stage], robot: Robot) -> Mapping[type[Artifact], Artifact]:
    """Return records that are enough for a stage that takes nothing else; otherwise the examples are used.

    That is one in closed form for an estimator, for which nothing compiles, and one experiment an axis for a diagnosis
    of many axes: it takes as long as there are experiments, and tries several poses and blocks on the smaller robots.
    """
    if {entry.artifact for entry in cls.inputs()} != {Record}:
        return {}
    if issubclass(cls, FrfEstimator):
        loop = robot if Robot in cls.lends().values() else None
        return {Record: plant_record(MassSpringPlant.of(robot.n_axis), noise=0.01, robot=loop)}
    if issubclass(cls, DiagnosisStage) and robot.n_axis > SMALL:
        return {Record: _short_record(robot.n_axis)}
    return {}


@functools.cache
def _robot(n_axis: int) -> Robot:
    return example_robot(n_axis)


@functools.cache
def _short_record(n_axis: int) -> Record:
    return example_record(_robot(n_axis), n_config=1, n_block=1)


@functools.cache
def _example(n_axis: int, kind: type[Artifact]) -> Artifact:
    """Return an example, made once for all stages, whose arrays cannot be written to."""
    return example_of(kind, _robot(n_axis))


def _of_type(given: Mapping[type[Artifact], Artifact], wanted: type[Artifact], n_axis: int) -> Artifact:
    kinds = [kind for kind in (wanted, *given, *EXAMPLES) if issubclass(kind, wanted)]
    for kind in kinds:
        if kind in given:
            return given[kind]
    for kind in kinds:
        if kind in EXAMPLES:
            return _example(n_axis, kind)  # type: ignore[arg-type]  # classes hash, whatever their objects do
    raise ContractBroken(f"there is no example of {wanted.__name__}; give one by `artifacts`")


def _check_run(stage: Stage, inputs: dict[str, list[Artifact]], robot: Robot, data_root: Path) -> None:
    """Run twice, compare, write, read."""
    name = f"{type(stage).__name__} with {robot.n_axis} axes"
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        arguments: dict[str, Any] = {**arguments_of(stage, inputs, example_context().log)}
        before = {key: _all_bytes(artifacts, folder / "input") for key, artifacts in inputs.items()}
        robot_before = robot.to_yaml()
        chance = repr(np.random.get_state())  # noqa: NPY002 - to see whether somebody else draws
        settings = stage.model_dump_json()
        first = stage.run(**arguments, **_lent(stage, robot, data_root, folder))
        second = stage.run(**arguments, **_lent(stage, robot, data_root, folder))
        if not isinstance(first, type(stage).output):
            raise ContractBroken(
                f"{name}: run gives a {type(first).__name__}, not a {type(stage).output.__name__}"
            )
        if repr(np.random.get_state()) != chance:  # noqa: NPY002
            raise ContractBroken(f"{name}: run draws from np.random; draw from context.generator")
        changed = [
            key for key, artifacts in inputs.items() if _all_bytes(artifacts, folder / "input") != before[key]
        ]
        if changed or robot.to_yaml() != robot_before or stage.model_dump_json() != settings:
            _example.cache_clear()
            _short_record.cache_clear()
            _robot.cache_clear()
            raise ContractBroken(
                f"{name}: run changes what it is given: {', '.join(changed) or 'robot or settings'}"
            )
        written = _bytes(first, folder / "output")
        if _bytes(second, folder / "output") != written:
            raise ContractBroken(
                f"{name}: run gives other bytes the second time with the same inputs and chance"
            )
        again = type(stage).output.read(folder / "output")
        if _bytes(again, folder / "again") != written:
            raise ContractBroken(f"{name}: the result changes when it is written and read")
        _check_result(name, first, [artifact for found in inputs.values() for artifact in found], robot)


def _bytes(artifact: Artifact, path: Path) -> bytes:
    artifact.write(path)
    return path.read_bytes()


def _all_bytes(artifacts: Sequence[Artifact], path: Path) -> list[bytes]:
    return [_bytes(artifact, path) for artifact in artifacts]


def _lent(stage: Stage, robot: Robot, data_root: Path, folder: Path) -> dict[str, Any]:
    lent: dict[str, Any] = {}
    for name, kind in stage.lends().items():
        if kind is Robot:
            lent[name] = robot
        elif kind is Context:
            lent[name] = example_context(data_root=data_root)
        elif kind is Truth:
            lent[name] = example_truth(robot)
        elif issubclass(kind, Drives):
            lent[name] = example_drives(robot, folder)
    return lent


def _check_result(name: str, result: Artifact, inputs: Sequence[Artifact], robot: Robot) -> None:
    """Check what each kind of result promises."""
    names = getattr(result, "axis_names", robot.axis_names)
    if names != robot.axis_names:
        raise ContractBroken(
            f"{name}: the result speaks of the axes {names}, the robot has {robot.axis_names}"
        )
    if isinstance(result, Configurations):
        beyond = (result.angle < robot.drives.lower) | (result.angle > robot.drives.upper)
        if beyond.any():
            raise ContractBroken(
                f"{name}: {int(beyond.any(axis=1).sum())} configurations are beyond the joint limits"
            )
    if isinstance(result, Excitation):
        _check_excitation(name, result, robot)
    if isinstance(result, Design):
        check_design(name, result)
    if isinstance(result, Report):
        check_page(name, result)
    if isinstance(result, Fit | Diagnosis) and result.model is not None:
        _check_model(name, result.model, robot)
    record = next((artifact for artifact in inputs if isinstance(artifact, Record)), None)
    if isinstance(result, Frf) and record is not None:
        shape = (len(record.angle), len(record.frequency_hz), robot.n_axis, robot.n_axis)
        if result.response.shape != shape:
            raise ContractBroken(f"{name}: the response has shape {result.response.shape}, not {shape}")
    if isinstance(result, Record):
        sizes = {values.values.shape[-1] for run in result.runs for values in run.channels.values()}
        if sizes != {robot.n_axis}:
            raise ContractBroken(f"{name}: channels have {sizes} axes, the robot has {robot.n_axis}")
        check_record(name, result, inputs, robot)


def _check_model(name: str, model: Model, robot: Robot) -> None:
    try:
        found = Robot.of_model(model)
    except RobidError as error:
        raise ContractBroken(f"{name}: no robot can be made of its model: {error}") from error
    if model.base_sha256 != robot.model({}).base_sha256:
        raise ContractBroken(f"{name}: its model is of {found.name}, not of the robot that it was given")


def _check_excitation(name: str, excitation: Excitation, robot: Robot) -> None:
    speed = np.abs(excitation.reference).max(axis=(0, 1, 2, 3))
    if (speed > robot.drives.speed_limit).any():
        raise ContractBroken(f"{name}: the reference is faster than the motors may turn")
    drift = np.abs(excitation.reference.mean(axis=3)).max()
    if drift > 1e-9 * speed.max():
        raise ContractBroken(f"{name}: one period of the reference does not come back to where it began")
    line = excitation.line  # none where the motion is not for a frequency response
    if len(line) and (line.min() < 1 or 2 * line.max() >= excitation.n_sample):
        raise ContractBroken(f"{name}: excited bins must lie between 1 and half of n_sample")
