"""From a robot.yaml to a description: packaged robots, model files, data sheets, robots based on another.

Every mistake is told at once, each at its line and column (`document`, `wording`, `contradictions`).
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from robid_core.errors import ConfigurationError, RobidError
from robid_core.robot.file.denavit_hartenberg import table_written_out
from robid_core.robot.file.description import EffectEntry, RobotDescription
from robid_core.robot.file.document import Document, parse_document, read_document
from robid_core.robot.file.effect_class import effect_class
from robid_core.robot.file.effect_places import wrong_place
from robid_core.robot.file.expansion import sheets_written_out
from robid_core.robot.file.factors import values_by_factor
from robid_core.robot.file.flexible_links import links_written_out
from robid_core.robot.file.model_file import bodies_of, read_model, with_limits
from robid_core.robot.file.named_parameters import effect_table, misfits, named_parameters, with_values
from robid_core.robot.file.part import Identifier, Part, with_tuples
from robid_core.robot.file.wording import checked, reason
from robid_core.robot.file.writing import robot_sha256
from robid_core.yaml_file.problems import suggestion

DEEPEST_BASE = 16  # robots that stand on one another
PACKAGED = Path(__file__).parents[2] / "robots"
# Packaged robots come in pairs: what the maker believes, and what the simulated machine is.
PACKAGED_FILES = {
    "six_axis": "six_axis/robot.yaml",
    "six_axis_true": "six_axis/truth.yaml",
    "one_axis": "one_axis/robot.yaml",
    "one_axis_true": "one_axis/truth.yaml",
    "six_axis_flex": "six_axis_flex/robot.yaml",
    "universal_arm": "universal_arm/robot.yaml",
    "universal_arm_true": "universal_arm/truth.yaml",
    "seven_axis": "seven_axis/robot.yaml",
    "seven_axis_true": "seven_axis/truth.yaml",
    "scara": "scara/robot.yaml",
    "scara_true": "scara/truth.yaml",
}


class DerivedRobot(Part):
    """A robot file that says only what differs from another robot."""

    robid_robot: Literal[1]
    """Version of this file format."""
    name: str | None = None
    """Name of the robot; null: that of the base."""
    base: str
    """Packaged robot, or path of a robot.yaml, from which this one differs."""
    base_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = None
    """Hash of the base that this file was made from (`Robot.sha256`): another base is refused; null: any will do."""
    factors: dict[str, float] = {}
    """Named parameters, by pattern, that are so many times those of the base: `{gear_stiffness.*: 0.75}`."""
    parameters: dict[str, float] = {}
    """Named parameters with other values than in the base."""
    effects: dict[Identifier, EffectEntry | None] = {}
    """What acts in this robot and not in the base; null: the base's effect of this label does not."""


def find_robot(name_or_path: str, folder: Path | None = None) -> Path:
    """Return the file of a packaged robot or of a path (relative to `folder`)."""
    if name_or_path in PACKAGED_FILES:
        return PACKAGED / PACKAGED_FILES[name_or_path]
    path = (folder or Path.cwd()) / name_or_path
    if path.suffix in (".urdf", ".xacro"):
        raise ConfigurationError(
            f"{path} is a URDF; `robid init FOLDER --robot {path}` makes a robot file of it"
        )
    if path.is_dir():
        raise ConfigurationError(f"{path} is a folder; name the robot file in it")
    if not path.is_file():
        if (path.parent / "manifest.json").is_file():
            raise ConfigurationError(
                f"{path}: the run in this folder has written no such robot: its fit was refused, or is not made yet; "
                f"robid show {path.parent} says which"
            )
        names = ", ".join(PACKAGED_FILES)
        near = difflib.get_close_matches(name_or_path, PACKAGED_FILES, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise ConfigurationError(
            f"no robot '{name_or_path}': {path} is no file; packaged robots: {names}{hint}"
        )
    return path


def read_description(path: Path) -> RobotDescription:
    """Read a robot file into its canonical description: bodies inline, data sheets written out.

    A file has either `bodies`, or `dh` (a Denavit-Hartenberg table), or `model` (a path read through the `robid.models`
    plugin of its suffix, with `lock` for joints that stay where they are), or `base` (another robot) with the
    `factors` and `parameters` that differ and the `effects` that come on top. Limits that `axes` leaves out are those
    of the model.

    Raises
    ------
    FileProblems
        A ConfigurationError with every mistake of the file at its line and column.
    PluginError
        Where an effect or a reader of model files cannot be imported.
    """
    return _read(read_document(path), path, ())


def parse_description(text: str, path: Path) -> RobotDescription:
    """Make a description of a text as if it stood in the file `path`; raises as `read_description`."""
    return _read(parse_document(text.encode("utf-8"), path.name), path, ())


def model_of(path: Path) -> tuple[Path, dict[str, float]] | None:
    """Return the model file that a robot file, or a base of it, stands on, and the joints that it locks.

    The robot file is one that was read before (`read_description`); null: its bodies come from no model file.

    Raises FileProblems where it cannot be read any more.
    """
    seen: set[Path] = set()
    while path.resolve() not in seen:
        seen.add(path.resolve())
        document = read_document(path)
        data = document.data
        if "model" in data:
            return path.parent / str(data["model"]), _locked(data.get("lock"), document)
        if not isinstance(data.get("base"), str):
            return None
        path = find_robot(data["base"], path.parent)
    return None


def _read(document: Document, path: Path, above: tuple[Path, ...]) -> RobotDescription:
    data: dict[str, Any] = document.data
    if "base" in data:
        description = _derived(data, document, (*above, path.resolve()))
    else:
        description = _whole(data, document, path.parent)
    document.problems.raise_if_any()
    assert description is not None
    return description


def _whole(data: dict[str, Any], document: Document, folder: Path) -> RobotDescription | None:
    if "model" in data:
        data = _with_model(data, document, folder)
    data = table_written_out(data, document)
    bodies = data.get("bodies")
    for index, body in enumerate(bodies if isinstance(bodies, list) else ()):
        if isinstance(body, dict) and isinstance(body.get("joint"), str):
            document.names["bodies", index] = f"joint '{body['joint']}'"
    data = links_written_out(data, document, folder)
    description = checked(RobotDescription, sheets_written_out(data, document), document)
    _check_effects(data.get("effects"), document)
    _check_places(description, document)
    return description


def _with_model(data: dict[str, Any], document: Document, folder: Path) -> dict[str, Any]:
    """Put bodies and limits of the model file in; none where it has mistakes, and nothing is told of what follows."""
    rest = {key: value for key, value in data.items() if key not in ("model", "lock")}
    if "bodies" in data:
        document.add(("model",), "bodies and a model file are given; keep one of the two")
        return rest
    document.derive(("bodies",), ("model",))
    if not isinstance(data["model"], str):
        written = "nothing" if data["model"] is None else "no text"
        document.add(("model",), f"{written} is written here; name a model file, such as robot.urdf")
        document.spoil(("bodies",))
        return {**rest, "bodies": []}
    bodies: list[dict[str, Any]] = []
    locked = _locked(data.get("lock"), document)
    try:
        model = read_model(folder / data["model"], locked)
    except RobidError as error:
        for line in str(error).splitlines():
            document.add(("model",), line)
        document.spoil(("bodies",))
    else:
        for joint in locked.keys() - set(model.joints):
            document.add(
                ("lock", joint),
                f"the model file has no joint '{joint}' that could move; {suggestion(joint, model.joints, 'it has')}",
            )
        driven = {str(axis.get("joint") or name) for name, axis in _mappings(data.get("axes"))}
        bodies = bodies_of(model, driven)
        if "axes" in rest:
            rest["axes"] = with_limits(rest["axes"], model.limits, data.get("coupling") is not None)
        for name, joint in ((n, str(a.get("joint") or n)) for n, a in _mappings(rest.get("axes"))):
            if joint in locked and joint in model.joints:
                document.add(
                    ("axes", name), f"joint '{joint}' is locked; drop the axis, or its line under lock"
                )
                document.spoil(("axes", name))
    for index in range(len(bodies)):
        document.derive(("bodies", index), ("model",))
    return {**rest, "bodies": bodies}


def _locked(lock: Any, document: Document) -> dict[str, float]:
    """Return the joints that a robot file locks and their coordinates; what is no coordinate is told."""
    if lock is not None and not isinstance(lock, dict):
        document.add(
            ("lock",), "lock names joints of the model file with the coordinate each stays at, as {finger: 0}"
        )
    found = {}
    for joint, value in lock.items() if isinstance(lock, dict) else ():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number:
            document.add(
                ("lock", joint), f"'{value}' is written here, it must be a number; coordinate, rad or m"
            )
        found[str(joint)] = float(value) if number else 0.0
    return found


def _mappings(entries: Any) -> list[tuple[str, dict[str, Any]]]:
    pairs = entries.items() if isinstance(entries, dict) else ()
    return [(str(name), entry) for name, entry in pairs if isinstance(entry, dict)]


def _derived(data: dict[str, Any], document: Document, above: tuple[Path, ...]) -> RobotDescription | None:
    """Return the base with the changes of a derived file, or None where those have mistakes."""
    checked(DerivedRobot, data, document)
    effects = _check_effects(data.get("effects"), document)
    if not isinstance(data["base"], str):
        return None
    try:
        file = find_robot(data["base"], above[-1].parent)
    except ConfigurationError as error:
        document.add(("base",), str(error))
        return None
    if len(above) > DEEPEST_BASE:
        document.add(
            ("base",), f"more than {DEEPEST_BASE} robots, each the base of the one before; write some out"
        )
        return None
    if file.resolve() in above:
        names = " -> ".join(path.name for path in (*above, file))
        document.add(("base",), f"a robot cannot be its own base: {names}")
        return None
    base = _read(read_document(file), file, above)
    _check_base(base, data.get("base_sha256"), document)
    for label in effects.keys() & base.effects.keys():
        taken = f"{base.name} has an effect of this label; change it under parameters, as effect.{label}.<parameter>"
        document.add(("effects", label), taken)
    removed = _removed_effects(data.get("effects"), base, document)
    acting = {label: entry for label, entry in base.effects.items() if label not in removed}
    whole = base.model_dump()
    whole["effects"] = {label: entry.model_dump() for label, entry in (acting | effects).items()}
    if isinstance(data.get("name"), str):
        whole["name"] = data["name"]
    robot = checked(RobotDescription, whole, document)
    _check_places(robot, document)
    known = base if robot is None or document.problems.problems else robot
    scaled = values_by_factor(data.get("factors"), known, document)
    _check_parameters("parameters", data.get("parameters"), known, document)
    _check_parameters("factors", scaled, known, document)
    if robot is None or document.problems.problems:
        return None
    return with_values(robot, scaled | (data.get("parameters") or {}))


def _check_base(base: RobotDescription, sha256: Any, document: Document) -> None:
    """Tell where the base is not the one that the file was made from."""
    if isinstance(sha256, str) and sha256 != robot_sha256(base):
        document.add(
            ("base_sha256",),
            f"{base.name} has changed since this file was made from it; make the file anew (robid run), or delete this "
            "line to put its numbers into the robot as it is now",
        )


def _removed_effects(effects: Any, base: RobotDescription, document: Document) -> set[str]:
    """Return the labels of effects that are taken off the base; one that it does not have is told."""
    removed = (
        {label for label, entry in effects.items() if entry is None} if isinstance(effects, dict) else set()
    )
    for label in removed - base.effects.keys():
        hint = suggestion(label, base.effects, "it has")
        document.add(("effects", label), f"{base.name} has no effect of this label to take off; {hint}")
    return removed


def _check_parameters(key: str, values: Any, robot: RobotDescription, document: Document) -> None:
    """Check names and values of parameters that are numbers: what is not is told already.

    Moments of a body may be right together and each wrong beside the base's others: what is wrong together is looked
    for one by one.
    """
    known = named_parameters(robot)
    numbers: dict[str, float] = {}
    for name, value in values.items() if isinstance(values, dict) else ():
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        if name in known:
            numbers[name] = value
        else:
            document.add(
                (key, name),
                f"{robot.name} has no such parameter; {suggestion(name, known, 'it has')}",
            )
    if not _wrong(robot, numbers):
        return
    alone = {name: wrong for name, value in numbers.items() if (wrong := _wrong(robot, {name: value}))}
    for name, wrong in alone.items():
        unit = "" if known[name].kind == "effect" else f"; {name}: {known[name].unit}"
        for message in wrong:
            document.add((key, name), message + unit)
    if not alone:
        for message in _wrong(robot, numbers):
            document.add((key,), message)


def _wrong(robot: RobotDescription, numbers: Mapping[str, float]) -> list[str]:
    """Return what is wrong with a robot with other numbers; nothing where it can be."""
    try:
        with_values(robot, numbers)
    except ValidationError as error:
        return [reason(item) for item in error.errors(include_url=False)]
    except ConfigurationError as error:
        return [str(error)]
    return []


def _check_places(robot: RobotDescription | None, document: Document) -> None:
    """Check that effects can be where they are put; those of a robot with other mistakes are not looked at."""
    if robot is None or document.problems.problems:
        return
    for label, entry in robot.effects.items():
        if wrong := wrong_place(effect_class(entry.use), entry, robot):
            key, message = wrong
            document.add(("effects", label, key), message)


def _check_effects(effects: Any, document: Document) -> dict[str, EffectEntry]:
    """Check plugins and values of effects that are well written, and return those: what is not is told already."""
    found = {}
    for label, written in effects.items() if isinstance(effects, dict) else ():
        try:
            entry = found[label] = EffectEntry.model_validate(with_tuples(written))
        except ValidationError:
            continue
        try:
            table = effect_table(entry.use)
        except ConfigurationError as error:
            document.add(("effects", label, "use"), str(error))
            continue
        for name, wrong in misfits(entry.use, entry.with_, table).items():
            document.add(("effects", label, "with", name), wrong)
    return found
