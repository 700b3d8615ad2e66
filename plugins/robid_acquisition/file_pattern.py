"""Patterns of file names: `lab/c{config}_b{block}_e{exp}.npz`, and the recordings that they find.

`{config}`, `{block}` and `{exp}` stand for whole numbers, `{variant}` and `{role}` for words, `*` for anything that
does not matter, such as a date; nothing of it reaches beyond a folder.
"""

from __future__ import annotations

import re
from pathlib import Path

from robid_acquisition.data_file import advice, below_root
from robid_acquisition.recording import Recording, is_test
from robid_core import ConfigurationError, is_recording

SHAPES = {"config": "[0-9]+", "block": "[0-9]+", "exp": "[0-9]+", "variant": "[^/]+?", "role": "[^/_]+?"}
SHOWN = 3  # files in a message
_FIELD = re.compile(r"\{([^{}]*)\}|(\*)")


def checked_pattern(text: str) -> str:
    """Return a pattern; ValueError where it leaves the data root, or has a field that is not known, or none."""
    below_root(text)
    names = [name for name, star in _FIELD.findall(text) if not star]
    for name in names:
        if name not in SHAPES:
            fields = ", ".join(f"{{{one}}}" for one in SHAPES)
            raise ValueError(f"'{{{name}}}' is no field; there are {fields}")
    if not names or "{" in _FIELD.sub("", text) or "}" in _FIELD.sub("", text):
        raise ValueError(
            "a pattern names files by fields such as {config}, {block}, {exp}; give `path` for one file"
        )
    return text


def expression(text: str) -> re.Pattern[str]:
    """Return the regular expression of a pattern; a field that stands twice means the same both times."""
    parts, end, seen = [], 0, set()
    for field in _FIELD.finditer(text):
        parts.append(re.escape(text[end : field.start()]))
        name, end = field[1], field.end()
        if field[2]:
            parts.append("[^/]*")
        elif name in seen:
            parts.append(f"(?P={name})")
        else:
            parts.append(f"(?P<{name}>{SHAPES[name]})")
            seen.add(name)
    return re.compile("".join([*parts, re.escape(text[end:])]))


def find_recordings(root: Path, text: str, origin: str = "") -> list[Recording]:
    """Return a recording for each file (or bag) below `root` that a pattern fits, in the order of their names.

    Raises ConfigurationError where there is none, and DataRejected where a role is none.
    """
    wanted = expression(text)
    glob = _FIELD.sub("*", re.sub(r"([\[?])", r"[\1]", text))
    names = sorted(path.relative_to(root).as_posix() for path in root.glob(glob) if is_recording(path))
    found = [(name, match.groupdict()) for name in names if (match := wanted.fullmatch(name))]
    if not found:
        raise ConfigurationError(
            f"no file in {root} fits '{text}'; {_nearby(root, text)}{advice(text, origin)}"
        )
    return [
        Recording(
            file=name,
            configuration=int(fields.get("config", 1)),
            block=int(fields.get("block", 1)),
            experiment=int(fields.get("exp", 1)),
            variant=fields.get("variant", ""),
            test=is_test(fields.get("role", "train"), name),
        )
        for name, fields in found
    ]


def _nearby(root: Path, text: str) -> str:
    """Say what lies where the files were looked for."""
    folder = root
    for part in text.split("/")[:-1]:
        if not (folder / part).is_dir():
            break
        folder = folder / part
    there = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    if folder == root or not there:
        return ""
    shown = ", ".join(there[:SHOWN]) + (", ..." if len(there) > SHOWN else "")
    return f"{folder.relative_to(root)} holds {shown}; "
