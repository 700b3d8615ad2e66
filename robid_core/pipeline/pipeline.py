"""A pipeline: read from YAML, every mistake told at once, inputs found, stages in the order they can run."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from robid_core.drives import Drives
from robid_core.errors import ConfigurationError, RobidError
from robid_core.pipeline.checking import check
from robid_core.pipeline.grammar import PipelineFile, RobotUse, mend
from robid_core.pipeline.inputs import check_given, order_stages
from robid_core.pipeline.line_check import check_lines
from robid_core.pipeline.memory_check import check_memory
from robid_core.pipeline.overrides import override
from robid_core.pipeline.places import find_places
from robid_core.pipeline.resolving import Declared, Resolver, drives_or_executor
from robid_core.pipeline.robot_check import check_against_robot, check_drives_against_robot
from robid_core.pipeline.wiring import Source, feeding
from robid_core.registered import check_registered
from robid_core.registry import DRIVES, DYNAMICS, EXECUTORS, Plugin, Registry, registry
from robid_core.robot import Robot
from robid_core.robot.file.reading import find_robot, read_description
from robid_core.settings_types import Places, SettingFile, robot_source
from robid_core.stage import Stage
from robid_core.yaml_file.characters import decode
from robid_core.yaml_file.kind import PIPELINE_FILE, of_another_kind
from robid_core.yaml_file.nodes import Node
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.plain_values import plain_value
from robid_core.yaml_file.problems import FileProblems, KeyPath, ProblemList, nearest, suggestion


@dataclass(frozen=True)
class StageNode:
    """One stage of a pipeline, ready to run.

    `inputs` maps parameters of `run` to the stage that feeds them, or to the stages where a parameter takes many (an
    optional one may be absent); `files` are the files its settings name (hash them into the key of its result);
    `references` the plugins of stages that its settings refer to.
    """

    name: str
    plugin: Plugin
    stage: Stage
    inputs: dict[str, Source]
    line: int
    column: int
    files: tuple[SettingFile, ...] = ()
    references: tuple[Plugin, ...] = ()

    @property
    def feeds(self) -> tuple[str, ...]:
        """Every stage that feeds this one, each once."""
        return feeding(self.inputs)


@dataclass(frozen=True)
class PluginChoice:
    """A plugin that is no stage (drives, executor) with its settings checked."""

    plugin: Plugin
    settings: BaseModel
    files: tuple[SettingFile, ...] = ()


@dataclass(frozen=True)
class RobotChoice:
    """The nominal model: `source` is what `Robot.load` takes, `written` what the file says."""

    written: str
    source: str
    dynamics: str

    def load(self) -> Robot:
        """Return the robot."""
        return Robot.load(self.source, dynamics=self.dynamics)


@dataclass(frozen=True, repr=False)
class Pipeline:
    """A pipeline file that was read, checked and wired; `stages` are in the order in which they can run."""

    path: Path
    text: str
    overrides: tuple[str, ...]
    name: str
    seed: int
    robot: RobotChoice
    drives: PluginChoice | None
    executor: PluginChoice | None
    stages: tuple[StageNode, ...]
    places: Places

    def __repr__(self) -> str:
        stages = ", ".join(node.name for node in self.stages)
        return f"Pipeline {self.name}: seed {self.seed}, robot {self.robot.written}; stages: {stages}"

    def _repr_html_(self) -> str:
        """Return what a notebook shows of it: its stages, what each uses and takes, and its settings."""
        rows = []
        for node in self.stages:
            said = node.stage.model_dump(mode="json", by_alias=True, exclude_defaults=True)
            settings = ", ".join(f"{key}: {value}" for key, value in said.items())
            rows.append((node.name, node.plugin.name.rpartition(":")[2], settings))
        cells = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
        head = "<tr><th>stage</th><th>use</th><th>with</th></tr>"
        of = escape(f"{self.name}: robot {self.robot.written}, seed {self.seed}")
        return f"<div><b>Pipeline</b> {of}<table><thead>{head}</thead><tbody>{cells}</tbody></table></div>"

    @property
    def folder(self) -> Path:
        """Folder of the pipeline file, where its relative paths begin."""
        return self.places.folder

    @property
    def data_root(self) -> Path:
        """Read-only folder of measured data."""
        return self.places.data_root

    def stage(self, name: str) -> StageNode:
        """Return a stage by name; ConfigurationError names the ones that exist.

        >>> import robid_core as robid
        >>> where = {"use": "design.candidates", "with": {"count": 2}}
        >>> robid.Pipeline.from_dict({"robot": "one_axis", "stages": {"where": where}}).stage("where").stage.count
        2
        """
        for node in self.stages:
            if node.name == name:
                return node
        near = nearest(name, [node.name for node in self.stages])
        hint = f"did you mean '{near}'?" if near else f"there are: {', '.join(n.name for n in self.stages)}"
        raise ConfigurationError(f"{self.path.name} has no stage '{name}'; {hint}")

    @classmethod
    def load(
        cls,
        path: Path | str,
        overrides: Sequence[str] = (),
        *,
        data_root: Path | None = None,
        plugins: Registry | None = None,
    ) -> Pipeline:
        """Read a pipeline file.

        Parameters
        ----------
        path
            The file; messages name it as it is given here.
        overrides
            Values that replace those of the file, as ``stages.fit.with.starts=50``.
        data_root
            Folder of measured data, in place of ROBID_DATA.
        plugins
            Where plugins are found; by default what is installed.

        Raises
        ------
        FileProblems
            With every mistake of the file, in line order.
        ConfigurationError
            Where there is no such file.

        Examples
        --------
        >>> import tempfile, pathlib, robid_core as robid
        >>> file = pathlib.Path(tempfile.mkdtemp()) / "pipeline.yaml"
        >>> stages = "stages: {where: {use: design.candidates, with: {count: 2}}}"
        >>> _ = file.write_text("\\n".join(["robid: 1", "name: lab", "seed: 1", "robot: one_axis", stages]))
        >>> pipeline = robid.Pipeline.load(file, ["stages.where.with.count=3"])
        >>> pipeline.name, pipeline.stage("where").stage.count
        ('lab', 3)
        """
        file = Path(path)
        hint = "name a pipeline file, or make one with `robid init`"
        try:
            if file.exists() and not (file.is_file() or file.is_dir()):  # reading a pipe may never end
                raise ConfigurationError(f"{path}: is no file; {hint}")
            data = file.read_bytes()
        except OSError as error:
            reason = "there is no such file" if isinstance(error, FileNotFoundError) else str(error.strerror)
            raise ConfigurationError(f"{path}: {reason}; {hint}") from error
        return cls.parse(data, file, overrides, data_root=data_root, plugins=plugins)

    @classmethod
    def from_dict(
        cls, content: Mapping[str, Any], folder: Path | str = ".", *, data_root: Path | None = None
    ) -> Pipeline:
        """Check and wire a pipeline that is given in Python; what `load` takes from a file.

        Parameters
        ----------
        content
            As a pipeline file says it; `robid`, name and seed may be left out, and are 1, "notebook" and 0.
        folder
            Where its relative paths begin and the folder `runs` is made.
        data_root
            Folder of measured data, in place of ROBID_DATA.

        Raises
        ------
        ConfigurationError
            With every mistake, a line each, by its place in `content`.

        Examples
        --------
        >>> import robid_core as robid
        >>> pipeline = robid.Pipeline.from_dict(
        ...     {"robot": "one_axis", "stages": {"where": {"use": "design.candidates", "with": {"count": 2}}}})
        >>> [node.name for node in pipeline.stages]
        ['where']
        >>> robid.Pipeline.from_dict({"robot": "one_axis", "stages": {"where": {"use": "design.candidate"}}})
        Traceback (most recent call last):
        robid_core.errors.ConfigurationError: stages.where.use: no stage 'design.candidate'; did you mean ...
        """
        whole = {"robid": 1, "name": "notebook", "seed": 0, **content}
        text = json.dumps(whole, indent=2, default=plain_value)
        try:
            return cls.parse(text.encode(), Path(folder) / "pipeline.yaml", data_root=data_root)
        except FileProblems as error:
            lines = [": ".join(filter(None, (one.path, one.message))) for one in error.problems]
            raise ConfigurationError("\n".join(lines)) from None

    @classmethod
    def parse(
        cls,
        data: bytes,
        file: Path,
        overrides: Iterable[str] = (),
        *,
        data_root: Path | None = None,
        plugins: Registry | None = None,
    ) -> Pipeline:
        """Read a pipeline from bytes, as if they stood in `file`; see `load`.

        >>> import pathlib, robid_core as robid
        >>> where = b"{use: design.candidates, with: {count: 2}}"
        >>> text = b"{robid: 1, name: lab, seed: 1, robot: one_axis, stages: {where: " + where + b"}}"
        >>> robid.Pipeline.parse(text, pathlib.Path("pipeline.yaml")).name
        'lab'
        """
        overrides = tuple(overrides)
        problems = ProblemList(str(file))
        text = decode(data, PIPELINE_FILE, problems)
        root = read_nodes(text, PIPELINE_FILE, problems) if text is not None else None
        if text is None or root is None:
            problems.raise_if_any()
            raise AssertionError("a document was refused without a problem")
        if told := of_another_kind(root.entries(), PIPELINE_FILE):
            problems.add(root.mark, (), told)
            problems.raise_if_any()
        for number, entry in enumerate(overrides):
            root = override(root, entry, number, problems)
        root = mend(root, problems)
        head = check(PipelineFile, root, (), problems)
        resolver = Resolver(plugins or registry(), find_places(file, data_root), problems)
        robot = _robot(root, resolver)
        load = functools.cache(robot.load) if robot is not None else None
        drives = drives_or_executor(resolver, DRIVES, "drives", root)
        drives_node = root.get("drives")
        if drives and load is not None and drives_node is not None and isinstance(drives[1], Drives):
            check_drives_against_robot(drives[1], drives_node, load, problems)
        executor = drives_or_executor(resolver, EXECUTORS, "executor", root)
        stages = _stages(root, resolver, robot, load)
        problems.raise_if_any()
        assert head is not None
        assert robot is not None
        return cls(
            path=file,
            text=text,
            overrides=overrides,
            name=head.name,
            seed=head.seed,
            robot=robot,
            drives=PluginChoice(*drives) if drives else None,
            executor=PluginChoice(*executor) if executor else None,
            stages=stages,
            places=resolver.places,
        )


def _robot(root: Node, resolver: Resolver) -> RobotChoice | None:
    """Check the nominal model: the name or path, the robot file itself, what computes its dynamics."""
    node, problems = root.get("robot"), resolver.problems
    use = check(RobotUse, node, ("robot",), ProblemList("")) if node is not None else None
    if node is None or use is None or problems.spoils("robot"):
        return None
    place: KeyPath = ("robot", "model") if node.get("model") else ("robot",)
    try:
        source = robot_source(use.model, resolver.places)
        read_description(find_robot(source))
    except (ValueError, RobidError) as error:
        for line in str(error).splitlines():
            problems.add(root.at(place)[1], place, line)
        return None
    try:
        names = ["kernel", *resolver.plugins.names(DYNAMICS)]
        if use.dynamics.rpartition(":")[2] not in names:
            hint = suggestion(use.dynamics, names, "there are")
            raise ConfigurationError(f"no dynamics '{use.dynamics}'; {hint}")
        if use.dynamics != "kernel":
            dynamics = resolver.plugins.find(DYNAMICS, use.dynamics)
            check_registered(dynamics, dynamics.load())
    except RobidError as error:
        problems.add(node.keys["dynamics"], ("robot", "dynamics"), str(error))
        return None
    return RobotChoice(use.model, source, use.dynamics)


def _stages(
    root: Node, resolver: Resolver, robot: RobotChoice | None, load: Callable[[], Robot] | None
) -> tuple[StageNode, ...]:
    """Check every stage, wire them, and return them in the order in which they can run."""
    problems, table, drives = resolver.problems, root.get("stages"), root.get("drives")
    declared: dict[str, Declared] = {}
    if table is not None:
        for name, node in table.entries().items():
            declared[name] = resolver.stage(name, node, table.keys[name])
    if robot is not None and load is not None:
        moves = drives is not None and drives.value is not None
        mark, file = root.keys["robot"], find_robot(robot.source)
        check_against_robot(declared.values(), load, mark, problems, file, moves, resolver.places.data_root)
    for stage in declared.values():
        check_given(stage, declared, problems)
        if stage.known and Drives in stage.lends.values() and (drives is None or drives.value is None):
            message = (
                f"{stage.plugin} moves motors, but the pipeline has no drives; add "
                "`drives: {use: simulated, with: {plant: six_axis_true}}`, or your own"
            )
            problems.add(stage.node.keys["use"], ("stages", stage.name, "use"), message)
    order = order_stages(declared, problems)
    check_lines(declared, dict(order), problems)
    if load is not None and not problems.problems:
        check_memory(declared, dict(order), load, problems)
    if problems.problems:
        return ()
    nodes = []
    for name, inputs in order:
        stage = declared[name]
        assert stage.plugin is not None
        assert stage.stage is not None
        line, column = stage.mark.line, stage.mark.column
        nodes.append(
            StageNode(name, stage.plugin, stage.stage, inputs, line, column, stage.files, stage.references)
        )
    return tuple(nodes)
