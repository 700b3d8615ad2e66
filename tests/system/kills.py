"""`kill -9` at random moments of a run, then `robid run`: same hashes as an undisturbed run.

`python tests/system/kills.py --kills 20`: the main job shortened (fewer blocks, lines and candidates; same
stages, same CAN drives), killed at moments drawn over the length of a run, each kill in a fresh folder.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROBID = str(Path(sys.executable).with_name("robid"))


def shortened() -> str:
    """The main job with the same stages and less of everything."""
    text = (ROOT / "pipeline.yaml").read_text(encoding="utf-8")
    for old, new in (
        (r"count: 4", "count: 2"),
        (r"lines: 100, period_s: 4", "lines: 30, period_s: 4"),
        (r"periods: 2", "periods: 1"),
        (r"starts: 20", "starts: 3"),
        (r"candidates: 500", "candidates: 60"),
    ):
        text, found = re.subn(old, new, text)
        assert found == 1, old
    return text


def hashes(folder: Path) -> dict[str, str]:
    """SHA-256 of every artifact that the run names."""
    (artifacts,) = folder.glob("runs/*/artifacts")
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(artifacts.iterdir())}


def run(folder: Path, kill_after: float | None = None) -> float:
    """Run the job; with `kill_after` seconds, kill the whole process group without warning."""
    begin = time.monotonic()
    process = subprocess.Popen([ROBID, "run", "-q", "pipeline.yaml"], cwd=folder, start_new_session=True)
    if kill_after is None:
        assert process.wait() == 0
        return time.monotonic() - begin
    try:
        process.wait(kill_after)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    return time.monotonic() - begin


def main() -> None:
    """Kill, resume, compare; print one line a kill."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=None)
    arguments = parser.parse_args()
    seed = arguments.seed if arguments.seed is not None else random.SystemRandom().randrange(2**32)
    draw = random.Random(seed)
    with tempfile.TemporaryDirectory() as top:
        reference = Path(top, "reference")
        reference.mkdir()
        (reference / "pipeline.yaml").write_text(shortened(), encoding="utf-8")
        length = run(reference)
        expected = hashes(reference)
        print(f"seed {seed}; undisturbed run {length:.1f} s, {len(expected)} artifacts", flush=True)
        same = 0
        for kill in range(arguments.kills):
            folder = Path(top, f"kill_{kill}")
            folder.mkdir()
            shutil.copy(reference / "pipeline.yaml", folder)
            moment = draw.uniform(0.5, length)
            run(folder, moment)
            run(folder)
            equal = hashes(folder) == expected
            same += equal
            print(json.dumps({"kill": kill, "at_s": round(moment, 2), "same_hashes": equal}), flush=True)
            shutil.rmtree(folder)
    print(f"{same} of {arguments.kills} runs ended with the hashes of the undisturbed one")
    sys.exit(0 if same == arguments.kills else 1)


if __name__ == "__main__":
    main()
