"""Damages files of one format again and again and judges what is made of them.

    python tests/fuzz/run.py npz 100000          # numbers 0 to 99 999; a third argument is the first number

Prints the outcomes, and each that is not allowed with the number that makes it again.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzz.damage import damaged
from fuzz.judgement import Tally, judge
from fuzz.samples import SAMPLES

from robid_core.foreign import guarded_reader


def fuzz(name: str, numbers: Iterable[int], folder: Path) -> Tally:
    """Return what came of damaged files of one format, by the numbers of their damage."""
    suffix, reader, write, _ = SAMPLES[name]
    sound = folder / f"sound{suffix}"
    write(sound)
    data, truth = sound.read_bytes(), guarded_reader(reader).read(sound)
    path = folder / f"damaged{suffix}"
    tally = Tally()
    for number in numbers:
        content, words = damaged(data, number)
        path.write_bytes(content)
        judge(path, name, truth, words, tally)
    return tally


def main(arguments: list[str]) -> None:
    """Fuzz the formats named, separated by commas."""
    count = int(arguments[1])
    first = int(arguments[2]) if len(arguments) > 2 else 0
    for name in arguments[0].split(",") if arguments[0] != "all" else SAMPLES:
        with tempfile.TemporaryDirectory() as folder:
            tally = fuzz(name, range(first, first + count), Path(folder))
        print(f"{name}: {count} files, slowest {tally.slowest_s:.2f} s: {tally.counts}", flush=True)
        for fault in tally.faults[:40]:
            print(f"  {fault}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
