"""Types for settings of plugins that mean more than a number: files, robots, other stages.

A stage declares `path: DataPath` and the framework checks, before anything runs and at the line of the file,
that the path stays where it may be and that something is there. Settings are written back as the user wrote them, so
that results do not depend on where a project lies.
"""

from __future__ import annotations

import difflib
import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    PlainSerializer,
    ValidationError,
    ValidationInfo,
    model_serializer,
    model_validator,
)
from pydantic_core import CoreSchema

from robid_core.errors import ConfigurationError
from robid_core.registry import STAGES, Registry, registry
from robid_core.robot.file.reading import PACKAGED_FILES
from robid_core.stage import Stage

# Names that Windows gives to devices, with any extension and in any case.
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)


@dataclass(frozen=True)
class SettingFile:
    """A file that a setting names: the setting, what the user wrote, and where it is."""

    setting: str
    written: str
    path: Path


@dataclass(frozen=True)
class Places:
    """Where a pipeline's paths begin; `files` collects what its settings name."""

    folder: Path
    project: Path
    data_root: Path
    data_root_from: str
    files: list[SettingFile] = field(default_factory=list)


class LocatedPath(str):
    """The absolute path of a file that a setting names; `written` is what the user wrote, and what is saved."""

    written: str

    @classmethod
    def of(cls, written: str, path: Path) -> LocatedPath:
        """Return the path as text that remembers how it was written."""
        located = cls(path)
        located.written = written
        return located


def _as_written(value: str) -> str:
    return value.written if isinstance(value, LocatedPath) else value


_WHERE = "paths begin at the folder of the pipeline file, those of recordings at the data folder, and stay below it"


def relative_path(text: str) -> str:
    """Return `text` where it is a relative path without tricks; raises ValueError otherwise (fault Y05)."""
    if not text.strip() or any(ord(character) < 32 for character in text):
        raise ValueError("a path must be printable text")
    if "\\" in text:
        raise ValueError(f"'{text}' has a backslash; separate folders with '/'")
    if text.startswith(("/", "~")) or re.match(r"[A-Za-z]:", text):
        raise ValueError(f"'{text}' is absolute; {_WHERE}: copy the file there")
    parts = text.split("/")
    if ".." in parts:
        raise ValueError(
            f"'{text}' leaves its root by '..'; {_WHERE}: copy the file there, or put the pipeline file "
            "into a folder above it"
        )
    device = next((part for part in parts if is_device_name(part)), None)
    if device is not None:
        raise ValueError(f"'{device}' is the name of a device on some systems; choose another")
    return text


def is_device_name(text: str) -> bool:
    """Tell whether a file of this name would be a device on some system."""
    return _DEVICES.fullmatch(text) is not None


def locate_in_project(text: str, folder: Path, project: Path) -> Path:
    """Return the existing file that a pipeline in `folder` calls `text`; raises ValueError where it must not."""
    path = (folder / relative_path(text)).resolve()
    if not path.is_relative_to(project.resolve()):
        raise ValueError(f"'{text}' leads out of the project, to {path}; copy the file into the project")
    if not path.exists():
        raise ValueError(f"there is no file '{text}' in {folder}; paths are relative to the pipeline file")
    return path


def _in_project(text: str, info: ValidationInfo) -> str:
    relative_path(text)
    if isinstance(info.context, Places):
        path = locate_in_project(text, info.context.folder, info.context.project)
        info.context.files.append(SettingFile(str(info.field_name), text, path))
        return LocatedPath.of(text, path)
    return text


def _in_data(text: str, info: ValidationInfo) -> str:
    relative_path(text)
    if isinstance(info.context, Places):
        root = info.context.data_root
        path = root / text
        if not path.exists():
            origin = info.data.get("origin")
            fetch = f"get it from {origin} and " if isinstance(origin, str) and origin else ""
            raise ValueError(
                f"there is no file '{text}' in the data folder {root} ({info.context.data_root_from}); {fetch}"
                f"set ROBID_DATA or pass --data to the folder that holds {text}"
            )
        info.context.files.append(SettingFile(str(info.field_name), text, path))
    return text


def robot_source(text: str, places: Places) -> str:
    """Return what `Robot.load` takes for a packaged robot or a robot.yaml; raises ValueError for neither."""
    if text in PACKAGED_FILES:
        return text
    if text.endswith((".urdf", ".xacro")):
        raise ValueError(f"'{text}' is a URDF; `robid init FOLDER --robot {text}` makes a robot file of it")
    if "/" not in text and not text.endswith((".yaml", ".yml")):
        near = difflib.get_close_matches(text, PACKAGED_FILES, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(PACKAGED_FILES)}"
        raise ValueError(f"no robot '{text}'; {hint} (or the path of a robot.yaml)")
    return str(locate_in_project(text, places.folder, places.project))


def _robot(text: str, info: ValidationInfo) -> str:
    if isinstance(info.context, Places):
        source = robot_source(text, info.context)
        if source != text:
            info.context.files.append(SettingFile(str(info.field_name), text, Path(source)))
            return LocatedPath.of(text, Path(source))
    return text


ProjectPath = Annotated[str, AfterValidator(_in_project), PlainSerializer(_as_written)]
"""A file of the project, written relative to the pipeline file; the value opens from anywhere."""

DataPath = Annotated[str, AfterValidator(_in_data)]
"""A file below the data root (`ROBID_DATA`, `--data`); a stage opens ``context.data_root / self.path``.

A field `origin: str` declared before it ends the message about a missing file ("get it from ...").
"""

RobotName = Annotated[str, AfterValidator(_robot), PlainSerializer(_as_written)]
"""A packaged robot, or the path of a robot.yaml in the project; `Robot.load` takes the value."""


class StageRef(BaseModel):
    """Another stage as a setting: `estimator: frf.log`, or `estimator: {use: frf.log, with: {...}}`."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, populate_by_name=True)

    use: str
    """Name of the stage's plugin."""
    with_: dict[str, Any] = Field(default={}, alias="with")
    """Its settings."""

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        return {"use": value} if isinstance(value, str) else value

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        table = handler.resolve_ref_schema(handler(schema))
        return {"description": table.pop("description", ""), "anyOf": [{"type": "string"}, table]}

    @model_serializer
    def _as_written(self) -> str | dict[str, Any]:
        return {"use": self.use, "with": self.with_} if self.with_ else self.use

    def stage(self, plugins: Registry | None = None) -> Stage:
        """Return the stage, its settings checked; raises ConfigurationError or PluginError."""
        cls = (plugins or registry()).load(STAGES, self.use)
        if not (isinstance(cls, type) and issubclass(cls, Stage)):
            raise ConfigurationError(f"'{self.use}' is not a stage")
        try:
            return cls.model_validate_json(json.dumps(self.with_), strict=True)
        except ValidationError as error:
            raise ConfigurationError(f"settings of '{self.use}': {error}") from error
