"""Build the reference bench: `python tests/reference/build.py --plants 1-50 --cache FOLDER`.

One file a plant and pose; what is there already is not computed again, and a tighter `--precision` goes on where a
file stopped. Stop it at any time: at most the pose in work is lost. At the end, or with `--plants` that are all
there, poses.csv and bounds.csv say what the bench holds.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
import time
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported: lanes are dealt to threads here
if str(Path(__file__).parents[1]) not in sys.path:
    sys.path.append(str(Path(__file__).parents[1]))

import numpy as np  # noqa: E402
from reference import cache  # noqa: E402
from reference.answer import MOST, PRECISION, SHIPPED_LABEL, answer  # noqa: E402
from reference.bounds import parameter_bound  # noqa: E402
from reference.excitation_class import shipped_class  # noqa: E402
from reference.metrics import rms_log_error  # noqa: E402
from reference.plants import BASES, N_POSE, ReferencePlant, reference_plant  # noqa: E402
from reference.reference_pose import JUDGE_BLOCKS, ReferencePose  # noqa: E402

# Tables -----------------------------------------------------------------------------------------------------------


def pose_row(index: int, pose: int, known: ReferencePose) -> dict[str, str]:
    """One line of poses.csv."""
    seen, size = known.seen, np.abs(known.response)
    own = (known.standard_error / size)[seen]
    judge = (np.sqrt(known.measured_variance()) / size)[seen]
    noise = np.sqrt(known.response_bound(distortion=False) / known.response_bound())
    return {
        "plant": str(index),
        "pose": str(pose),
        "blocks": str(known.moments.n_realization),
        "precision": f"{known.precision:.4f}",
        "own_standard_error": f"{np.median(own):.5f}",
        "measured_standard_error": f"{np.median(judge):.5f}",
        "seen": f"{seen.mean():.3f}",
        "noise_share": f"{np.median(noise):.4f}",
        "log_error_of_linear_model": f"{rms_log_error(known.linear_response, known.response, seen):.4f}",
        "saturated": f"{known.saturated:.5f}",
        "transient": f"{known.transient:.2e}",
    }


def bound_row(plant: ReferencePlant, known: list[ReferencePose]) -> dict[str, str]:
    """One line of bounds.csv: relative standard error of each stiffness from the judging measurement in these poses."""
    row = {"plant": str(plant.index), "poses": str(len(known))}
    for kind, distortion in (("noise", False), ("total", True)):
        bound = parameter_bound(
            plant.robot,
            np.stack([one.angle for one in known]),
            known[0].frequency_hz,
            np.stack([JUDGE_BLOCKS * one.moments.input_gram for one in known]),
            np.stack([one.residual(distortion=distortion) for one in known]),
            np.stack([one.motor_damping for one in known]),
        )
        names = plant.robot.stiffness_names
        for name, value in zip(names, bound.standard_error(*names), strict=True):
            row[f"{kind}.{name}"] = f"{value:.3e}"
    return row


def write_table(path: Path, rows: list[dict[str, str]], command: str) -> None:
    """Write a table with the command that made it, whole or not at all."""
    part = path.with_name(f".{path.name}.{os.getpid()}")
    with part.open("w", encoding="utf-8", newline="") as file:
        file.write(f"# {command}\n")
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    part.replace(path)


def main(arguments: list[str] | None = None) -> None:
    """Build what is missing, and write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robot", choices=tuple(BASES), default="six_axis")
    parser.add_argument("--plants", default="1-50", help="first and last plant")
    parser.add_argument("--poses", default=f"1-{N_POSE}", help="first and last pose")
    parser.add_argument("--cache", type=Path, default=cache.default_folder())
    parser.add_argument("--precision", type=float, default=PRECISION)
    parser.add_argument("--most", type=int, default=MOST, help="blocks a pose at most")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--label", default=SHIPPED_LABEL, help="folder for an excitation; needed with --with")
    parser.add_argument(
        "--with",
        dest="settings",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="other setting of excitation.multisine than the shipped one, as period_s=16",
    )
    given = parser.parse_args(arguments)
    if given.settings and given.label == SHIPPED_LABEL:
        parser.error("--with changes the excitation; give it a --label of its own")
    settings = {key: json.loads(value) for key, _, value in (text.partition("=") for text in given.settings)}
    settings = {key: tuple(value) if isinstance(value, list) else value for key, value in settings.items()}
    plants, poses = (
        range(int(a), int(b or a) + 1) for a, _, b in (t.partition("-") for t in (given.plants, given.poses))
    )
    folder = given.cache / given.label
    folder.mkdir(parents=True, exist_ok=True)
    begun, wanted = time.monotonic(), len(plants) * len(poses)
    pose_rows: list[dict[str, str]] = []
    bound_rows: list[dict[str, str]] = []
    worked = Worked()
    for index in plants:
        plant = reference_plant(index, given.robot)
        excitation = shipped_class(plant, **settings)
        known = []
        for pose in poses:
            with worked:
                one = answer(
                    plant, pose, excitation, folder,
                    precision=given.precision, most=given.most, jobs=given.jobs, tell=worked.tell,
                )  # fmt: skip
            known.append(one)
            pose_rows.append(pose_row(index, pose, one))
            print(
                f"{plant.robot.name} pose {pose}: {one.moments.n_realization} blocks, precision {one.precision:.3f}; "
                f"{len(pose_rows)} of {wanted} poses{worked.left(wanted - len(pose_rows))}",
                flush=True,
            )
        bound_rows.append(bound_row(plant, known))
    command = f"python tests/reference/build.py {' '.join(sys.argv[1:] if arguments is None else arguments)}"
    write_table(folder / "poses.csv", pose_rows, command)
    write_table(folder / "bounds.csv", bound_rows, command)
    print(f"{wanted} poses in {duration(time.monotonic() - begun)}; tables in {folder}")


class Worked:
    """Time spent on poses that had to be computed, told as the time that is left."""

    def __init__(self) -> None:
        self.seconds: list[float] = []
        self._begun, self._computes = 0.0, False

    def __enter__(self) -> None:
        """Begin a pose."""
        self._begun, self._computes = time.monotonic(), False

    def __exit__(self, *exception: object) -> None:
        """Count it, if it was not in the cache."""
        if self._computes:
            self.seconds.append(time.monotonic() - self._begun)

    def tell(self, text: str) -> None:
        """Hear of work; show it to who watches."""
        self._computes = True
        if sys.stdout.isatty():
            print(f"\r{text}   ", end="\r", flush=True)

    def left(self, poses: int) -> str:
        """Time that so many more poses take."""
        if not self.seconds:
            return ""
        mean = sum(self.seconds) / len(self.seconds)
        return f", {duration(mean)} each, {duration(mean * poses)} left if none of them is there"


def duration(seconds: float) -> str:
    """Seconds in words."""
    for unit, length in (("h", 3600.0), ("min", 60.0)):
        if seconds > 2 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s"


if __name__ == "__main__":
    main()
