"""What a run computed with: versions, threads, machine. Written into the manifest, compared by `--locked`."""

from __future__ import annotations

import platform
import re
import sys
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path
from typing import Any

from robid_core.executors import thread_settings

# Not required by robid itself, but part of the result where they are installed.
ALSO = ("llvmlite", "pydantic-core", "torch", "pytorch-kinematics", "distributed")


def versions(distributions: Iterable[str]) -> dict[str, str]:
    """Return the versions of Python, of some distributions and of everything they ask for, by name."""
    found = {"python": platform.python_version()}
    for name in sorted({"robid", *distributions}):
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue
        found[name] = distribution.version
        for requirement in distribution.requires or ():
            if "extra ==" in requirement:  # tools and options that took no part
                continue
            _add(found, re.split(r"[^A-Za-z0-9._-]", requirement, maxsplit=1)[0])
    for name in ALSO:
        _add(found, name)
    return dict(sorted(found.items()))


def _add(found: dict[str, str], name: str) -> None:
    try:
        found.setdefault(name, metadata.version(name))
    except metadata.PackageNotFoundError:  # an extra that is not installed
        return


def platform_fingerprint() -> dict[str, Any]:
    """Return what may change the last digit between machines: processor, system, libraries of linear algebra."""
    from threadpoolctl import threadpool_info

    libraries = sorted(
        {
            " ".join(str(library[k]) for k in ("internal_api", "version", "architecture") if library.get(k))
            for library in threadpool_info()
        }
    )
    return {
        "system": f"{platform.system()} {platform.release()}",
        "machine": platform.machine(),
        "processor": _processor(),
        "byte_order": sys.byteorder,
        "implementation": platform.python_implementation(),
        "linear_algebra": libraries,
    }


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:  # not Linux
        return platform.processor()
    return platform.processor()


def environment(distributions: Iterable[str]) -> dict[str, Any]:
    """Return versions, threads and machine of this process."""
    return {
        "versions": versions(distributions),
        "threads": thread_settings(),
        "platform": platform_fingerprint(),
    }
