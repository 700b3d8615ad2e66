"""What the reading of a file may take, by its size.

Memory counts beyond what libraries have mapped before. Text becomes about thirty times its size while it is parsed, a
packed file of real samples some tens of times: the factor is for them, what is above it is damaged or a bomb (A04).
Time is that of the processor, so that other work on the machine makes no file suspect; slow text takes half a second a
megabyte. A reader that waits instead of working is ended by the clock.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from robid_core.foreign.bag import files_of

LEAST_BYTES = 512 * 2**20
BYTES_PER_BYTE = 40
LEAST_S = 10.0
S_PER_MB = 2.0
CLOCK_PER_PROCESSOR = 4.0  # a busy machine


@dataclass(frozen=True)
class Limits:
    """Limits of a worker process: address space in bytes, and seconds of processor and clock."""

    memory_bytes: int
    processor_s: float
    clock_s: float


def limits_of(path: Path) -> Limits:
    """Return what reading a file may take; a file that is not there has the least."""
    size = size_of(path)
    processor_s = LEAST_S + S_PER_MB * size / 1e6
    return Limits(LEAST_BYTES + BYTES_PER_BYTE * size, processor_s, CLOCK_PER_PROCESSOR * processor_s)


def size_of(path: Path) -> int:
    """Return the bytes of a recording."""
    try:
        return sum(file.stat().st_size for file in files_of(path))
    except OSError:
        return 0
