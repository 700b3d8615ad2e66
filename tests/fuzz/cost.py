"""What the reading process costs: its start, and a file after that, beside reading in this process.

    python tests/fuzz/cost.py

Milliseconds for the first small file, then the median of fifty, apart and here, of each format; and of 10^6 numbers.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzz.samples import SAMPLES

from robid_core import guarded_reader, load_plugin


def seconds(call: Callable[[], object]) -> float:
    """Return how long a call takes."""
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def main() -> None:
    """Print the table."""
    print(f"{'format':14}{'first':>9}{'apart':>10}{'here':>10}   (ms)")
    with tempfile.TemporaryDirectory() as folder:
        big = Path(folder) / "big.npz"
        np.savez(big, q=np.random.default_rng(1).normal(size=(10**6 // 6, 6)))
        files = {"a million": ("npz", big)}
        for name, (suffix, reader, write, _) in SAMPLES.items():
            path = Path(folder) / f"{name}{suffix}"
            write(path)
            files[name] = reader, path
        for name, (reader, path) in files.items():
            apart, here = guarded_reader(reader), load_plugin("robid.records", reader)
            first = seconds(lambda: apart.read(path))  # noqa: B023
            later = statistics.median(seconds(lambda: apart.read(path)) for _ in range(50))  # noqa: B023
            plain = statistics.median(seconds(lambda: here.read(path)) for _ in range(50))  # noqa: B023
            print(f"{name:14}{1e3 * first:9.1f}{1e3 * later:10.2f}{1e3 * plain:10.2f}")


if __name__ == "__main__":
    main()
