"""What a disk may hold after the power failed: every state that a noted sequence of operations allows.

A pessimistic model of POSIX. Content that was written and not synced may be whole, empty or cut in half. A
change of a folder (a name added, replaced or taken away) that was not followed by a sync of that folder may
be there or not, each by itself: a rename between two folders may have reached one, both or none. A folder
whose own name was not synced may be missing with all that is in it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePath

from robid_core.store import Files

Contents = dict[str, bytes]  # path relative to the root: content


@dataclass
class Inode:
    """A file's content, and whether it has reached the disk."""

    content: bytes
    synced: bool = False

    def variants(self) -> list[bytes]:
        """Return what the disk may hold."""
        if self.synced:
            return [self.content]
        return list(dict.fromkeys([self.content, b"", self.content[: len(self.content) // 2]]))


@dataclass
class Folder:
    """Names on the disk, and the changes that may not have reached it."""

    durable: dict[str, Inode] = field(default_factory=dict)
    pending: list[tuple[str, Inode | None]] = field(default_factory=list)

    def sync(self) -> None:
        """Bring the changes to the disk."""
        for name, inode in self.pending:
            _apply(self.durable, name, inode)
        self.pending = []

    def current(self) -> dict[str, Inode]:
        """Return the names as a running program sees them."""
        names = dict(self.durable)
        for name, inode in self.pending:
            _apply(names, name, inode)
        return names

    def variants(self) -> Iterator[dict[str, Inode]]:
        """Yield what the disk may hold."""
        seen = set()
        for chosen in itertools.product((False, True), repeat=len(self.pending)):
            names = dict(self.durable)
            for (name, inode), happened in zip(self.pending, chosen, strict=True):
                if happened:
                    _apply(names, name, inode)
            state = frozenset((name, id(inode)) for name, inode in names.items())
            if state not in seen:
                seen.add(state)
                yield names


def _apply(names: dict[str, Inode], name: str, inode: Inode | None) -> None:
    if inode is None:
        names.pop(name, None)
    else:
        names[name] = inode


class Disk:
    """The model: folders by path relative to the root, "" being the root itself, which is durable."""

    def __init__(self) -> None:
        self.folders: dict[str, Folder] = {"": Folder()}
        self.made: dict[str, bool] = {"": True}  # folder: its name has reached the disk

    def find(self, path: str) -> Inode:
        """Return the file at a path."""
        return self._folder(path).current()[PurePath(path).name]

    def _folder(self, path: str) -> Folder:
        return self.folders[_parent(path)]

    def do(self, operation: tuple[str, ...], content: bytes = b"") -> None:
        """Take one noted operation into account."""
        match operation:
            case ("make_folder", path):
                if path not in self.folders:
                    self.folders[path], self.made[path] = Folder(), False
            case ("write", path):
                self._folder(path).pending.append((PurePath(path).name, Inode(content)))
            case ("sync", path):
                self.find(path).synced = True
            case ("sync_folder", path):
                self.folders[path].sync()
                self.made.update({name: True for name in self.made if _parent(name) == path})
            case ("replace", source, target):
                inode = self.find(source)
                self._folder(source).pending.append((PurePath(source).name, None))
                self._folder(target).pending.append((PurePath(target).name, inode))
            case ("link", source, target):
                self._folder(target).pending.append((PurePath(target).name, self.find(source)))
            case ("remove", path):
                self._folder(path).pending.append((PurePath(path).name, None))
            case _:
                raise AssertionError(operation)

    def states(self) -> Iterator[tuple[frozenset[str], Contents]]:
        """Yield (folders, contents) of every state that a loss of power may leave now."""
        unsure = [name for name, durable in self.made.items() if not durable]
        for count in range(len(unsure) + 1):
            for lost in itertools.combinations(unsure, count):
                kept = [name for name in self.folders if not any(_inside(name, folder) for folder in lost)]
                yield from self._states_of(kept)

    def _states_of(self, kept: list[str]) -> Iterator[tuple[frozenset[str], Contents]]:
        choices = [list(self.folders[name].variants()) for name in kept]
        for chosen in itertools.product(*choices):
            named = {
                f"{folder}/{name}".lstrip("/"): inode
                for folder, names in zip(kept, chosen, strict=True)
                for name, inode in names.items()
            }
            inodes = list({id(inode): inode for inode in named.values()}.values())
            for variant in itertools.product(*(inode.variants() for inode in inodes)):
                held = {id(inode): content for inode, content in zip(inodes, variant, strict=True)}
                yield frozenset(kept), {path: held[id(inode)] for path, inode in named.items()}


def _parent(path: str) -> str:
    parent = str(PurePath(path).parent)
    return "" if parent == "." else parent


def _inside(path: str, folder: str) -> bool:
    return PurePath(path).is_relative_to(folder)


class NotingFiles(Files):
    """Does everything, and writes down what it did below a root."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.done: list[tuple[tuple[str, ...], bytes]] = []

    def _note(self, name: str, *paths: Path, content: bytes = b"") -> None:
        places = [str(path.relative_to(self.root)) for path in paths]
        self.done.append(((name, *("" if place == "." else place for place in places)), content))

    def make_folder(self, path: Path) -> None:
        super().make_folder(path)
        self._note("make_folder", path)

    def write(self, path: Path, writer: Callable[[Path], None]) -> None:
        super().write(path, writer)
        self._note("write", path, content=path.read_bytes())

    def copy(self, source: Path, target: Path) -> None:
        super().copy(source, target)
        self._note("write", target, content=target.read_bytes())

    def sync(self, path: Path) -> None:
        super().sync(path)
        self._note("sync", path)

    def sync_folder(self, path: Path) -> None:
        super().sync_folder(path)
        self._note("sync_folder", path)

    def replace(self, source: Path, target: Path) -> None:
        super().replace(source, target)
        self._note("replace", source, target)

    def link(self, source: Path, target: Path) -> None:
        super().link(source, target)
        self._note("link", source, target)

    def remove(self, path: Path) -> None:
        there = path.exists()
        super().remove(path)
        if there:
            self._note("remove", path)


def crash_states(
    done: list[tuple[tuple[str, ...], bytes]], first: int = 0
) -> Iterator[tuple[int, frozenset[str], Contents]]:
    """Yield (number of operations done, folders, contents) of each distinct state, from operation `first` on."""
    disk, seen = Disk(), set()
    for count in range(len(done) + 1):
        if count > 0:
            disk.do(*done[count - 1])
        if count < first:
            continue
        for folders, contents in disk.states():
            state = (folders, frozenset(contents.items()))
            if state not in seen or count == len(done):
                seen.add(state)
                yield count, folders, contents


def lay_out(root: Path, folders: frozenset[str], contents: Contents) -> None:
    """Put a state on a real disk."""
    for name in sorted(folders):
        (root / name).mkdir(parents=True, exist_ok=True)
    for name, content in contents.items():
        (root / name).write_bytes(content)
