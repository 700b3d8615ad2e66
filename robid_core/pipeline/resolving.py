"""From `use` and `with` to checked objects: plugins found, imported, their settings validated.

What a stage makes is also worked out for stages whose `use` is wrong (from the plugin that was probably
meant), so that one mistake does not make its neighbours look wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from pydantic import BaseModel

from robid_core.artifacts import Artifact
from robid_core.errors import ConfigurationError, PluginError, RobidError
from robid_core.pipeline.checking import check, settings_model
from robid_core.pipeline.wiring import Source
from robid_core.registered import check_registered
from robid_core.registry import EFFECTS, NOUNS, STAGES, Plugin, Registry
from robid_core.settings_types import Places, SettingFile, StageRef
from robid_core.stage import Input, Stage, stage_fault
from robid_core.yaml_file.nodes import Node, mapping
from robid_core.yaml_file.problems import KeyPath, Mark, ProblemList, nearest


@dataclass
class Declared:
    """One entry of `stages:` as far as it could be understood."""

    name: str
    node: Node
    mark: Mark
    plugin: Plugin | None = None
    stage: Stage | None = None
    inputs: tuple[Input, ...] = ()
    output: type[Artifact] | None = None
    lends: dict[str, type] = field(default_factory=dict)
    known: bool = False
    files: tuple[SettingFile, ...] = ()
    references: tuple[Plugin, ...] = ()
    given: dict[str, Source | None] = field(default_factory=dict)


@dataclass
class Resolver:
    """Finds plugins and checks their settings; what is wrong goes to `problems`."""

    plugins: Registry
    places: Places
    problems: ProblemList

    def plugin(self, group: str, node: Node, path: KeyPath) -> tuple[Plugin, Any] | None:
        """Return the plugin that `use` names, with its object; None where there is a problem."""
        use = node.get("use")
        if use is None or not isinstance(use.value, str) or self.problems.spoils(*path, "use"):
            return None
        try:
            plugin = self.plugins.find(group, use.value)
            loaded = plugin.load()
            if group != STAGES:  # told in words of its own
                check_registered(plugin, loaded)
            return plugin, loaded
        except (ConfigurationError, PluginError) as error:
            text = " ".join(str(error).split())
            if group != EFFECTS and use.value in self.plugins.names(EFFECTS):
                label = use.value.rpartition(".")[2]
                text = (
                    f"'{use.value}' is an effect, and no {NOUNS[group]}: it goes into a robot file, as "
                    f"`effects: {{{label}: {{use: {use.value}, ...}}}}`; robid stages {use.value} shows its settings"
                )
            hint = "; is the package that brings it installed?" if "; there are:" in text else ""
            self.problems.add(node.keys["use"], (*path, "use"), text + hint)
            return None

    def settings(
        self, model: type[BaseModel], node: Node, path: KeyPath, mark: Mark
    ) -> tuple[BaseModel, tuple[SettingFile, ...]] | None:
        """Return the settings under `with` and the files they name, None where there is a problem.

        `mark` is where to point when settings are missing and there is no `with`.
        """
        if self.problems.spoils(*path, "with"):
            return None
        given = node.get("with") or mapping(mark, {}, {})
        place = node.keys.get("with", mark)
        count = len(self.problems.problems)
        places = replace(self.places, files=[])
        settings = check(model, replace(given, mark=place), (*path, "with"), self.problems, places)
        if settings is None or len(self.problems.problems) > count:
            return None
        return settings, tuple(places.files)

    def used(self, settings: BaseModel, node: Node, path: KeyPath) -> None:
        """Import the plugins that settings say they will load (`uses() -> [(group, name)]`), if they do."""
        uses = getattr(settings, "uses", None)
        for group, name in uses() if callable(uses) else ():
            try:
                plugin = self.plugins.find(group, name)
                loaded = plugin.load()
                if group != EFFECTS:  # a diagnosis tries the others, and names those that cannot be used
                    check_registered(plugin, loaded)
            except (ConfigurationError, PluginError) as error:
                self.problems.add(node.keys["use"], (*path, "use"), " ".join(str(error).split()))

    def external(self, stage: Stage, plugin: Plugin, node: Node, path: KeyPath) -> None:
        """Let a stage look for the data files that its settings lead to."""
        try:
            stage.external_files(self.places.data_root)
            return
        except RobidError as error:
            text = str(error)
        except Exception as error:
            text = f"{plugin} breaks the contract of stages: external_files: {type(error).__name__}: {error}"
        self.problems.add(node.keys.get("with", node.mark), path, " ".join(text.split()))

    def stage(self, name: str, node: Node, mark: Mark) -> Declared:
        """Return what one entry of `stages:` declares."""
        path: KeyPath = ("stages", name)
        declared = Declared(name, node, mark)
        found = self.plugin(STAGES, node, path)
        cls = self._stage_class(found, node, path) if found else None
        if found and cls:
            declared.plugin, declared.known = found[0], True
            checked = self.settings(cls, node, path, mark)
            if checked:
                self.used(checked[0], node, path)
            if checked and isinstance(checked[0], Stage):
                declared.stage, declared.files = checked[0], checked[1]
                self.external(checked[0], declared.plugin, node, (*path, "with"))
                declared.references = tuple(self._references(checked[0], node, path))
        else:
            cls = self._probably(node)
        if cls:
            declared.inputs, declared.output, declared.lends = cls.inputs(), cls.output, cls.lends()
        if path in self.problems.repeated:  # which of the two was meant is unknown
            declared.output, declared.known = None, False
        return declared

    def _stage_class(self, found: tuple[Plugin, Any], node: Node, path: KeyPath) -> type[Stage] | None:
        plugin, loaded = found
        if fault := stage_fault(loaded):
            self.problems.add(node.keys["use"], (*path, "use"), f"{plugin} {fault}")
            return None
        cls: type[Stage] = loaded
        return cls

    def _probably(self, node: Node) -> type[Stage] | None:
        """Return the stage that a wrong `use` was probably meant to be: the nearest, or one of the same family."""
        use = node.get("use")
        if use is None or not isinstance(use.value, str):
            return None
        name = use.value.rpartition(":")[2]
        if name in self.plugins.names(EFFECTS):  # no stage was meant
            return None
        names = self.plugins.names(STAGES)
        family = [other for other in names if other.partition(".")[0] == name.partition(".")[0]]
        for guess in filter(None, [nearest(name, names), *family]):
            for plugin in self.plugins.plugins(STAGES):
                if plugin.name == guess:
                    try:
                        cls: type[Stage] = plugin.load()
                        if not stage_fault(cls):
                            return cls
                    except Exception:
                        continue
        return None

    def _references(self, settings: Stage, node: Node, path: KeyPath) -> Iterator[Plugin]:
        """Check the stages that settings refer to, and yield their plugins."""
        for place, reference in references(settings):
            written = (node.get("with") or Node({}, node.mark)).find(place)
            full = (*path, "with", *place)
            mark = node.at(("with", *place))[1]
            if written is None or isinstance(written.value, str):  # a default, or the short form
                use = Node(reference.use, mark)
                written = mapping(mark, {"use": use}, {"use": mark})
            found = self.plugin(STAGES, written, full)
            cls = self._stage_class(found, written, full) if found else None
            if found and cls:
                self.settings(cls, written, full, mark)
                yield found[0]


def references(value: Any, place: KeyPath = ()) -> Iterator[tuple[KeyPath, StageRef]]:
    """Yield every StageRef inside settings, with the path that leads to it."""
    if isinstance(value, StageRef):
        yield place, value
    elif isinstance(value, BaseModel):
        for name, info in type(value).model_fields.items():
            yield from references(getattr(value, name), (*place, info.alias or name))
    elif isinstance(value, dict):
        for key, entry in value.items():
            yield from references(entry, (*place, str(key)))
    elif isinstance(value, tuple | list):
        for index, entry in enumerate(value):
            yield from references(entry, (*place, index))


def drives_or_executor(
    resolver: Resolver, group: str, key: str, root: Node
) -> tuple[Plugin, BaseModel, tuple[SettingFile, ...]] | None:
    """Return the plugin, settings and files under `drives:` or `executor:`, None where there are none or a problem."""
    node = root.get(key)
    if node is None or node.value is None or resolver.problems.spoils(key):
        return None
    found = resolver.plugin(group, node, (key,))
    if found is None:
        return None
    try:
        model = settings_model(found[1])
    except PluginError as error:
        resolver.problems.add(node.keys["use"], (key, "use"), str(error))
        return None
    checked = resolver.settings(model, node, (key,), root.keys[key])
    if checked is None:
        return None
    resolver.used(checked[0], node, (key,))
    return found[0], *checked
