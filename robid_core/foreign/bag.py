"""Recordings that are folders: a bag of ROS 2 is its description (`metadata.yaml`) and the files that this lists."""

from __future__ import annotations

from pathlib import Path

BAG_METADATA = "metadata.yaml"
BAG_READER = "rosbag"  # the reader of folders, which have no suffix to tell


def is_bag(path: Path) -> bool:
    """Whether a path is the folder of a bag.

    >>> is_bag(Path("runs.csv"))
    False
    """
    return (path / BAG_METADATA).is_file()


def is_recording(path: Path) -> bool:
    """Whether a path may be a recording: a file, or the folder of a bag.

    >>> is_recording(Path("no_such_folder"))
    False
    """
    return path.is_file() or is_bag(path)


def files_of(path: Path) -> list[Path]:
    """Return the files of a recording: those of the folder where it is a bag, or the description of one.

    >>> [file.name for file in files_of(Path("runs.csv"))]
    ['runs.csv']
    """
    folder = path.parent if path.name == BAG_METADATA else path
    if path.name == BAG_METADATA or is_bag(path):
        return sorted(file for file in folder.iterdir() if file.is_file())
    return [path]
