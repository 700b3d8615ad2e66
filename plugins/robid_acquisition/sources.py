"""Where recordings lie, and which experiments of the robot they are: one file, parts of it, a pattern, or a table."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    FiniteFloat,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    model_validator,
)

from robid_acquisition.data_file import reader_name
from robid_acquisition.file_pattern import checked_pattern, find_recordings
from robid_acquisition.index_table import read_index
from robid_acquisition.recording import Recording
from robid_core import (
    BAG_READER,
    Acquisition,
    ConfigurationError,
    DataPath,
    ExtraMissing,
    load_plugin,
    record_readers,
)


class Sources(Acquisition):
    """Settings that name files, and what follows from them."""

    origin: str = ""
    """Where the data can be had, for the message when they are missing."""
    path: DataPath | None = None
    """One file, or the folder of a ROS 2 bag, relative to the data root; a channel may name another one."""
    pattern: Annotated[str, AfterValidator(checked_pattern)] | None = None
    """Many files or bags, an experiment each: {config}, {block}, {exp} are numbers, {variant}, {role} words, * any."""
    index: DataPath | None = None
    """A table (CSV), a line for each experiment: file, configuration, block, experiment, start_s, stop_s, role (train
    or test), variant; further columns are constants (numbers)."""
    starts_s: tuple[NonNegativeFloat, ...] = ()
    """When experiments begin in the one file; each lasts `duration_s`."""
    duration_s: PositiveFloat | None = None
    """Length of an experiment, with `starts_s`."""
    layout: tuple[PositiveInt, PositiveInt, PositiveInt] | None = None
    """Configurations, blocks and experiments, in the order of `starts_s`; null: all are experiments of one block."""
    start_s: NonNegativeFloat = 0.0
    """What lies before this time is left out, in each file."""
    stop_s: FiniteFloat | None = None
    """What lies after this time is left out, in each file."""
    role: Literal["", "train", "test"] = ""
    """Of all experiments; `test`: not used by fits, kept for validation; left out: as files or table say."""
    variant: str = ""
    """The variant (payload, tool, run) that is read, where files or table name several; else what the one is called."""
    incomplete: Literal["drop", "refuse"] = "drop"
    """Blocks that lack an experiment and gaps in the numbering: left out with a warning, or refused."""
    format: str = ""
    """Reader (csv, mat, npz, json, hdf5, mcap, parquet, rosbag or a plugin's); by default from the file's suffix."""
    sha256: Annotated[str, Field(pattern="^([0-9a-fA-F]{64})?$")] = ""
    """Checked where given: other data are refused. Of many files: the hash of what `sha256sum` prints for them."""

    @model_validator(mode="after")
    def _one_source(self) -> Sources:
        if [bool(self.path), bool(self.pattern), bool(self.index)].count(True) != 1:
            raise ValueError(
                "give one of path (a file), pattern (files by their names) and index (a table of files)"
            )
        if not self.starts_s:
            if self.duration_s is not None or self.layout is not None:
                raise ValueError("starts_s is missing, which duration_s and layout go with")
            return self
        if not self.path or self.duration_s is None:
            raise ValueError("starts_s: needs path and duration_s")
        if self.start_s or self.stop_s is not None:
            raise ValueError("starts_s: leave out start_s and stop_s, each experiment lasts duration_s")
        if self.layout is not None and math.prod(self.layout) != len(self.starts_s):
            shape = " x ".join(str(number) for number in self.layout)
            raise ValueError(
                f"layout: {shape} are {math.prod(self.layout)} experiments, and starts_s has {len(self.starts_s)}"
            )
        return self

    @property
    def source_name(self) -> str:
        """What the settings call the data."""
        return self.path or self.pattern or str(self.index)

    def external_files(self, data_root: Path) -> list[Path]:
        """Return the files read, so that a changed or further file is a changed input."""
        files = [*([self.index] if self.index else []), *(one.file for one in self.recordings(data_root))]
        return [data_root / file for file in dict.fromkeys(files)]

    def uses(self) -> list[tuple[str, str]]:
        """Return the readers that will be loaded, so that an edited reader is a changed input."""
        names = {reader_name(self.source_name, self.format)}
        if names == {""} and _is_installed(BAG_READER):  # folders have no suffix
            names = {BAG_READER}
        if self.index and not self.format:  # what the table lists is known where the data are
            names = {name for name in record_readers().values() if _is_installed(name)}
        return [("robid.records", name) for name in sorted(names) if name]

    def recordings(self, root: Path) -> list[Recording]:
        """Return the experiments that are read, each with its place, its variant and its role.

        Raises
        ------
        ConfigurationError
            If there is no file, or none of the variant.
        DataRejected
            If the table cannot be read.
        """
        if self.pattern:
            found = find_recordings(root, self.pattern, self.origin)
        elif self.index:
            found = read_index(root, self.index)
        else:
            found = self._parts(str(self.path))
        known = sorted({one.variant for one in found} - {""})
        if not self.variant or not known:
            return found
        if self.variant not in known:
            raise ConfigurationError(f"there is no variant '{self.variant}'; there are {', '.join(known)}")
        return [one for one in found if one.variant == self.variant]

    def _parts(self, path: str) -> list[Recording]:
        """Return the experiments of one file."""
        if not self.starts_s:
            return [Recording(path)]
        assert self.duration_s is not None
        places = np.ndindex(*(self.layout or (1, 1, len(self.starts_s))))
        return [
            Recording(path, c + 1, b + 1, e + 1, start, start + self.duration_s)
            for (c, b, e), start in zip(places, self.starts_s, strict=True)
        ]


def _is_installed(reader: str) -> bool:
    """Tell whether what a reader needs is installed; what lacks is told where a file needs it."""
    try:
        load_plugin("robid.records", reader)
    except ExtraMissing:
        return False
    return True
