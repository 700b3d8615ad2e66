"""Hashes of the sources of plugins that can change without changing their version.

A distribution from an index is known by its version. One that was installed from a folder (editable or not,
`direct_url.json` tells) or that lies outside `site-packages` is known by the content of its package too, and
of every other such package that it imports, found by reading its import statements. All files count, not
only modules: a template changes a page as much as a line of code. Time stamps count for nothing.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import importlib.util
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

CORE = "robid_core"
INSTALLED = ("site-packages", "dist-packages")


def sources_hash(module: str, distribution: str) -> str | None:
    """Return the hash of a plugin's own sources; None where name and version say enough.

    Parameters
    ----------
    module
        Where the plugin is, `package.module`.
    distribution
        The distribution it comes from; "unknown" where none is known.
    """
    package = module.partition(".")[0]
    if not (installed_from_folder(distribution) or is_local(package)):
        return None
    return packages_hash(local_packages(package))


def core_hash() -> str | None:
    """Return the hash of robid's core; None where its version says enough."""
    if not (installed_from_folder("robid") or is_local(CORE)):
        return None
    return packages_hash((CORE,))


@functools.cache
def installed_from_folder(distribution: str) -> bool:
    """Tell whether a distribution was installed from a place that can change under the same version."""
    try:
        return metadata.distribution(distribution).read_text("direct_url.json") is not None
    except metadata.PackageNotFoundError:
        return True


@functools.cache
def is_local(package: str) -> bool:
    """Tell whether a package lies outside the standard library and the installed packages."""
    if package in sys.stdlib_module_names:
        return False
    folders = _folders(package)
    return bool(folders) and not any(set(folder.parts) & set(INSTALLED) for folder in folders)


@functools.cache
def local_packages(package: str) -> tuple[str, ...]:
    """Return a package and every local one that it imports, directly or not; the core is known by itself."""
    found: set[str] = set()
    waiting = [package]
    while waiting:
        name = waiting.pop()
        if name not in found and name != CORE:
            found.add(name)
            waiting.extend(imported for imported in _imports(name) if is_local(imported))
    return tuple(sorted(found))


@functools.cache
def packages_hash(packages: tuple[str, ...]) -> str:
    """Hash the names and contents of all files of some packages."""
    digest = hashlib.sha256()
    for package in packages:
        for name, path in _files(package):
            content = hashlib.sha256(path.read_bytes()).hexdigest()
            digest.update(f"{package}/{name}\0{content}\n".encode())
    return digest.hexdigest()


def _imports(package: str) -> set[str]:
    """Return the first names of everything that the package's modules import."""
    names: set[str] = set()
    for _, path in _files(package):
        if path.suffix != ".py":
            continue
        try:
            tree = ast.parse(path.read_bytes())
        except (SyntaxError, ValueError):  # importing it will tell the user
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                names.update(alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names.add(node.module.partition(".")[0])
    return names


def _files(package: str) -> Iterator[tuple[str, Path]]:
    """Yield (name inside the package, path) of each file, sorted; bytecode and hidden files left out."""
    for place in _folders(package):
        if place.is_file():
            yield place.name, place
            continue
        for path in sorted(place.rglob("*")):
            parts = path.relative_to(place).parts
            if path.is_file() and not any(part.startswith(".") or part == "__pycache__" for part in parts):
                yield "/".join(parts), path


@functools.cache
def _folders(package: str) -> tuple[Path, ...]:
    """Return where a package lies: its folders, or the file of a single module."""
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        return ()
    if spec is None:
        return ()
    if spec.submodule_search_locations is not None:
        return tuple(Path(place) for place in spec.submodule_search_locations)
    if spec.origin is None or not spec.has_location:
        return ()
    return (Path(spec.origin),)


def forget() -> None:
    """Forget what was read, so that the next question reads the files again."""
    for function in (installed_from_folder, is_local, local_packages, packages_hash, _folders):
        function.cache_clear()
