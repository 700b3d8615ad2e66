"""Files of the reference bench: one a plant and pose, outside the repository, never half written, never stale.

A name holds two hashes: of what is asked (robot, pose, excitation, settling, batches, seed; by value) and of the code
that answers (syntax trees without docstrings, so that comments and layout do not count). A file whose code
changed is not thrown away unseen: its first batch is computed again, and where that comes out the same the file is
taken over (`build`).
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import os
from collections.abc import Iterable
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from reference.best_linear_approximation import Moments
from reference.excitation_class import ExcitationClass
from reference.reference_pose import ReferencePose

import robid_core
from robid_core import Robot

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

FORMAT = 1
# What decides about a motion, besides the modules of the robot's own effects.
CODE = (
    "mechanics/*.py",
    "effect.py",
    "robot/robot.py",
    "robot/plant.py",
    "robot/effects.py",
    "robot/arrays.py",
    "estimation/excitation/multisine.py",
    "estimation/distortion/speed.py",
)


def default_folder() -> Path:
    """ROBID_REFERENCE, or robid/reference in the user's cache folder."""
    named = os.environ.get("ROBID_REFERENCE")
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(named) if named else Path(cache) / "robid" / "reference"


def question_hash(
    robot: Robot, angle: FloatArray, excitation: ExcitationClass, settings: Iterable[object]
) -> str:
    """Hash of robot, pose, excitation and settings, by value."""
    digest = hashlib.sha256(f"{FORMAT} {robot.to_yaml()} {tuple(settings)!r}".encode())
    for value in (angle, *asdict(excitation).values()):
        digest.update(np.ascontiguousarray(value).tobytes())
    return digest.hexdigest()[:12]


def code_hash(robot: Robot) -> str:
    """Hash of the code that simulates this robot and averages, docstrings and comments left out."""
    here, core = Path(__file__).parent, Path(robid_core.__file__).parent
    files = [file for pattern in CODE for file in sorted(core.glob(pattern))]
    files += [here / "excitation_class.py", here / "best_linear_approximation.py"]
    effects = {Path(inspect.getfile(bound.effect)) for bound in robot.effects}
    files += sorted(effects | {path.with_name("angle_wave.py") for path in effects})
    digest = hashlib.sha256()
    for file in files:
        digest.update(syntax_of(file).encode() if file.exists() else b"")
    return digest.hexdigest()[:8]


def syntax_of(file: Path) -> str:
    """Syntax tree of a file without docstrings, as text."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in ast.walk(tree):
        if isinstance(node, documented) and ast.get_docstring(node) is not None:
            node.body.pop(0)
    return ast.dump(tree)


def path_of(folder: Path, robot: Robot, pose: int, question: str, code: str) -> Path:
    """Path of the file of one plant and pose (1, 2, ...)."""
    return folder / f"{robot.name}_pose_{pose}-{question}-{code}.npz"


def write(path: Path, known: ReferencePose, first: tuple[ComplexArray, ComplexArray]) -> None:
    """Write a pose, and the sums of its first batch (see `first_sums`), whole or not at all."""
    arrays: dict[str, Any] = {
        "robot": known.robot.to_yaml(),
        "first_y": first[0],
        "first_u": first[1],
        **{
            name: getattr(known, name)
            for name in ("angle", "speed_rms", "sine_speed", "saturated", "transient")
        },
        **{f"excitation_{name}": value for name, value in asdict(known.excitation).items()},
        **{f"moments_{f.name}": getattr(known.moments, f.name) for f in fields(Moments)},
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}")
    with part.open("wb") as file:
        np.savez(file, **arrays)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)


def read(path: Path, robot: Robot) -> ReferencePose:
    """Read a pose of a robot (`robot.to_yaml()` stands in the file too)."""
    with np.load(path) as file:
        if str(file["robot"]) != robot.to_yaml():
            raise ValueError(
                f"{path} is of another robot than {robot.name} as it is drawn now; build it again"
            )

        def of(prefix: str, kind: type) -> dict[str, object]:
            values = {f.name: file[f"{prefix}_{f.name}"] for f in fields(kind)}
            return {name: value if value.ndim else value.item() for name, value in values.items()}

        return ReferencePose(
            robot,
            file["angle"],
            ExcitationClass(**of("excitation", ExcitationClass)),  # type: ignore[arg-type]
            Moments(**of("moments", Moments)),  # type: ignore[arg-type]
            file["speed_rms"],
            file["sine_speed"],
            float(file["saturated"]),
            float(file["transient"]),
        )


def first_sums(path: Path) -> tuple[ComplexArray, ComplexArray]:
    """Sums of Y R^-1 and U R^-1 over the first batch of a file."""
    with np.load(path) as file:
        return file["first_y"], file["first_u"]


def the_file(folder: Path, robot: Robot, pose: int) -> Path:
    """Path of the only file of a plant and pose, whatever made it.

    Raises
    ------
    FileNotFoundError
        Where there is none, or more than one and none of them by the present code.
    """
    found = sorted(folder.glob(f"{robot.name}_pose_{pose}-*.npz"))
    if len(found) > 1:
        found = [path for path in found if path.stem.endswith(code_hash(robot))]
    if len(found) != 1:
        raise FileNotFoundError(
            f"{folder}: {len(found) or 'no'} files of {robot.name}, pose {pose}; build it with `python "
            "tests/reference/build.py`, or clear out what other excitations left there"
        )
    return found[0]
