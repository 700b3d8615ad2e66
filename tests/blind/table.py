"""What a table of blind cases says: counts with Wilson's intervals against what was asked, and confusions."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
import scipy

from blind.plan import ASKED, asked

Row = dict[str, str]
STRONG = 1000.0
NEAR = 0.02  # samples


def wilson(hits: int, n: int, level: float = 0.95) -> tuple[float, float]:
    """Interval of a proportion (Wilson 1927)."""
    if not n:
        return 0.0, 1.0
    interval = scipy.stats.binomtest(hits, n).proportion_ci(level, method="wilson")
    return float(interval.low), float(interval.high)


def summary(rows: Sequence[Row]) -> str:
    """Return the table against what was asked, and the confusions."""
    digest = hashlib.sha256(ASKED.read_bytes()).hexdigest()[:16]
    commits = ", ".join(dict.fromkeys(row["commit"] for row in rows))
    lines = [f"{len(rows)} cases at {commits}; asked.json {digest}", ""]
    return "\n".join([*lines, *_scores(rows), "", *_confusions(rows), "", *_times(rows)])


def _scores(rows: Sequence[Row]) -> Iterator[str]:
    limits = asked()["scores"]
    yield f"{'score':58} {'found':>8} {'95 % interval':>16} {'asked':>12}  of"
    for name, (hits, n) in _counts(rows).items():
        if n:
            low, high = wilson(hits, n)
            limit = limits.get(name, "")
            yield f"{name:58} {hits / n:8.3f} {low:7.3f} .. {high:5.3f} {limit!s:>12}  {hits}/{n}"
    ends = {kind: wilson(sum(map(_right, own)), len(own))[1] for kind, own in _strong_kinds(rows)}
    if ends:
        name, worst = (
            "strong: upper end of every kind's interval, at least",
            min(ends, key=lambda kind: ends[kind]),
        )
        yield f"{name:58} {ends[worst]:8.3f} {'':16} {limits[name]!s:>12}  {worst}"
    for name, values in _numbers(rows).items():
        if len(values):
            limit = limits.get(name, "")
            shown = np.sqrt(np.mean(np.square(values))) if "rms" in name else np.median(values)
            yield f"{name:58} {shown:8.3f} {'':16} {limit!s:>12}  {len(values)}"


def _counts(rows: Sequence[Row]) -> dict[str, tuple[int, int]]:
    """Successes, or failures where a name says at most, and cases."""

    def of(strata: Iterable[str], hit: Callable[[Row], bool]) -> tuple[int, int]:
        own = [row for row in rows if row["stratum"] in strata]
        return sum(hit(row) for row in own), len(own)

    laws = ("strong", "middle", "weak", "one configuration", "moves")
    timed = [row for row in rows if row["found_late"] and "drive.current_loop" not in row["kinds"]]
    stated = [row for row in rows if int(row["stated"])]
    found = {
        "exact inertia: alarms, at most": of(("exact inertia",), _alarmed),
        "nothing: alarms, at most": of(("nothing",), _alarmed),
        "strong: cause and axis named first": of(("strong",), _right),
        "middle: right, or in a class written beforehand": of(("middle",), _right_or_alike),
        "weak: wrong names, at most": of(("weak",), lambda row: _yes(row, "wrong")),
        "extra causes, at most": of((*laws, "pairs", "values"), lambda row: int(row["extras"]) > 0),
        "pairs: both right": of(("pairs",), _right),
        "law taken out: no cause from outside its class": of(("law taken out",), _no_foreign_cause),
        "law taken out: right class and axis": of(("law taken out",), _kin),
        "one configuration: named": of(("one configuration",), _right),
        "one configuration: said so": of(("one configuration",), lambda row: row["seen"].startswith("1/")),
        "values: told as such, and which": of(("values",), _right),
        "moves: cause and axis named first": of(("moves",), _right),
        "delay within 0.02 samples": (
            sum(late_by(row) < NEAR for row in timed), len(timed),
        ),
        "95 % intervals that hold the truth": (
            sum(int(row["covered"]) for row in stated), sum(int(row["stated"]) for row in stated),
        ),
    }  # fmt: skip
    return found


def _numbers(rows: Sequence[Row]) -> dict[str, np.ndarray]:
    strong = [row for row in rows if row["stratum"] == "strong"]
    far = [row for row in strong if float(row["strengths"]) >= STRONG]
    return {
        "size: rms of z": _floats(strong, "size_z"),
        "size at strength 1000 or more: median relative error, at most": np.abs(_floats(far, "size_error")),
        "gain: median share": _floats(strong, "gain"),
        **{
            f"gain over the noise of the record itself, {n} axes": _floats(
                [row for row in strong if row["n_axis"] == n], "gain_own"
            )
            for n in sorted({row["n_axis"] for row in strong})
        },
    }


def _confusions(rows: Sequence[Row]) -> Iterator[str]:
    """What was told first for each kind, and in how many cases."""
    yield "hidden: told first"
    for kind, own in _strong_kinds(rows):
        told = Counter(row["told"].split(" ")[0].partition("@")[0] or "nothing" for row in own)
        low, high = wilson(sum(map(_right, own)), len(own))
        names = ", ".join(f"{name} {n}" for name, n in told.most_common())
        yield f"{kind:30} {names}; right {low:.2f} .. {high:.2f}"


def _strong_kinds(rows: Sequence[Row]) -> Iterator[tuple[str, list[Row]]]:
    strong = [row for row in rows if row["stratum"] == "strong"]
    for kind in sorted({row["kinds"] for row in strong}):
        yield kind, [row for row in strong if row["kinds"] == kind]


def _times(rows: Sequence[Row]) -> Iterator[str]:
    for n_axis in sorted({row["n_axis"] for row in rows}):
        for moves in (False, True):
            seconds = _floats(
                [r for r in rows if r["n_axis"] == n_axis and (r["stratum"] == "moves") == moves], "seconds"
            )
            if len(seconds):
                what = "moves" if moves else "multisines"
                yield f"{n_axis} axes, {what}: median {np.median(seconds):.1f} s, worst {seconds.max():.1f} s"


def late_by(row: Row) -> float:
    """Largest error of a lag over the axes, samples: torques that act late were demanded, and recorded, before."""
    return float(np.abs(np.array(row["found_late"].split(" "), dtype=float) + float(row["late"])).max())


def _floats(rows: Iterable[Row], name: str) -> np.ndarray:
    values = np.array([float(row[name].split(" ")[0]) for row in rows if row.get(name)])
    return values[np.isfinite(values)]


def _yes(row: Row, name: str) -> bool:
    return row[name] == "True"


def _right(row: Row) -> bool:
    return _yes(row, "right")


def _right_or_alike(row: Row) -> bool:
    return _right(row) or _yes(row, "in_class")


def _kin(row: Row) -> bool:
    return _yes(row, "kin") or _yes(row, "in_class")


def _no_foreign_cause(row: Row) -> bool:
    return "cause:" not in row["told"] or _yes(row, "in_class")


def _alarmed(row: Row) -> bool:
    return int(row["alarms"]) > 0
