"""The search: every candidate's gain, the best values of its shape, and what the largest gain of all means.

A largest gain among many means less than the same gain of one law that was asked for. How much less is drawn: noise of
the stated covariance in place of the residual, through the same projection and the same candidates; from the smallest
p-values of the draws comes the number of independent trials that the search is worth (Sidak's), and with it the p-value
after the search.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy

from robid_core import ConfigurationError, FloatArray, RobidError, SignalEffect
from robid_diagnosis.candidates import Candidate
from robid_diagnosis.columns import WHOLE, ColumnMeaning, Columns, Motion
from robid_diagnosis.projection import Gain, Projection
from robid_diagnosis.structures import softened, unseen
from robid_diagnosis.sums import Sums, inverse
from robid_diagnosis.values import PRICE
from robid_diagnosis.visible import Power, power_of
from robid_diagnosis.wording import place_text

DRAWS = 100
TOGETHER = 24  # candidates whose columns are projected at once
BLIND = 1e-4  # of a law's square that the fit's unknowns cannot do: its torque is not computed better
EXACT = 1e-7  # likewise of what is linear in a signal, which is known better
STEPS = 60  # of the search for a shape
FACTOR = 3.0  # by which a shape may leave the value that it was tried with
FIRST_STEP = 0.3  # of a shape's logarithm, or of an order
ROUNDS = 8  # of the search for springs
KEPT = 0.9  # of what columns gain: springs of which as they are less is left are looked for
SHARP = 0.02  # of a shape's logarithm: nearer is not looked


@dataclass(frozen=True, eq=False)
class Hit:
    """A candidate with its gain in twice the log-likelihood."""

    candidate: Candidate
    values: dict[str, float]
    """Shape with which it gains most."""
    meaning: ColumnMeaning
    """Of the columns."""
    sums: Sums
    gain: Gain

    @property
    def freedom(self) -> int:
        """Numbers that were chosen by the data: sizes and shapes."""
        return self.gain.freedom + sum(name not in self.names for name in self.candidate.shape)

    @property
    def names(self) -> list[str]:
        """Parameter of each column that takes part."""
        return [self.meaning.names[i] for i in self.gain.chosen]

    @property
    def worth(self) -> float:
        """What it gains, less what as many numbers gain by chance."""
        return self.gain.total - PRICE * self.freedom

    def log_p(self, misfit: float = 1.0) -> float:
        """Logarithm of the p-value without a search, in noise of so many times the variance that was told."""
        return _log_p_of(self.gain.total / max(1.0, misfit), self.freedom)


@dataclass(frozen=True)
class Failure:
    """A candidate that could not be tried."""

    use: str
    on: str | None
    side: str | None
    reason: str

    @property
    def where(self) -> str:
        """The effect and its place; the effect alone where it could be tried at none."""
        return self.use if self.on is None else place_text(self.use, self.on, self.side)


@dataclass(frozen=True, eq=False)
class Found:
    """Result of a search: the best of every effect at every place, best first."""

    hits: tuple[Hit, ...]
    failures: tuple[Failure, ...]
    trials: float
    """Independent trials that the search is worth."""
    n_tried: int
    """Candidates with their values."""
    tried: tuple[str, ...]
    """Effects of which there were any."""
    powers: Mapping[tuple[str, str, str], Sequence[Power]]
    """What every candidate would gain by its size."""

    def p_value(self, hit: Hit, misfit: float = 1.0) -> float:
        """p-value after the search, in noise of so many times the variance that was told."""
        return self._after_search(hit.log_p(misfit))

    def p_value_of_gain(self, gain: float, freedom: int) -> float:
        """p-value after the search of a gain in twice the log-likelihood by so many numbers."""
        return self._after_search(_log_p_of(gain, freedom))

    def _after_search(self, log_p: float) -> float:
        return float(-np.expm1(self.trials * np.log1p(-np.exp(min(log_p, -1e-16)))))


class Search:
    """A search of candidates in the residual of one fitted problem."""

    def __init__(self, motion: Motion, projection: Projection, generator: np.random.Generator) -> None:
        self.motion, self.projection, self.generator = motion, projection, generator

    @cached_property
    def blind(self) -> float:
        """Share of a law's square that must be left beside the fit's unknowns: their torque errs by what is left."""
        measured = self.motion.weighted([one.block.motion.torque_spectrum for one in self.motion.along])
        return max(BLIND, float((self.projection.residual**2).sum() / (measured**2).sum()))

    def run(
        self,
        uses: Sequence[str],
        places: Mapping[str, Collection[str]],
        progress: Callable[[float, float, str], None],
    ) -> Found:
        """Try every effect at every place; those of `places` at these only."""
        best: dict[tuple[str, str | None, str | None], Hit] = {}
        smallest, failures, n_tried, tried = np.zeros(DRAWS), list[Failure](), 0, dict[str, None]()
        powers: dict[tuple[str, str, str], list[Power]] = {}
        for number, use in enumerate(uses):
            progress(number, len(uses), f"trying {use}")
            try:
                candidates = self.motion.candidates(use)
            except RobidError as error:
                failures.append(Failure(use, None, None, str(error)))
                continue
            wanted = [one for one in candidates if use not in places or one.spot.on in places[use]]
            n_tried += len(wanted)
            if wanted:
                tried[use] = None
            for first in range(0, len(wanted), TOGETHER):
                for hit, by_chance in self._together(wanted[first : first + TOGETHER], failures):
                    candidate = hit.candidate
                    matrix, _ = self.projection.normal(hit.sums)
                    square = np.diag(hit.sums.own.sum(axis=0))
                    power = power_of(candidate, hit.meaning.names, square, matrix, self.blind)
                    powers.setdefault(candidate.key, []).append(power)
                    if not hit.gain.freedom:
                        continue
                    smallest = np.minimum(smallest, _log_p_by_chance(hit, matrix, by_chance))
                    known = best.get(candidate.key)
                    if known is None or hit.gain.total > known.gain.total:
                        best[candidate.key] = hit
        hits = sorted(best.values(), key=lambda one: one.worth, reverse=True)
        rate = -np.log1p(-np.exp(np.minimum(smallest, -1e-12))).mean()
        trials = float(max(1.0, 1.0 / rate)) if rate > 0 else 1.0
        trials += sum(waves.n_independent for waves in self.motion.waves.values())
        return Found(tuple(hits), tuple(failures), trials, n_tried, tuple(tried), powers)

    def hit(self, candidate: Candidate, values: dict[str, float]) -> Hit:
        """Evaluate one candidate at a shape."""
        columns = self._columns(candidate, values)
        return self._hit(candidate, values, columns.meaning, self.projection.sums(columns.rows))

    def _together(
        self, candidates: Sequence[Candidate], failures: list[Failure]
    ) -> Iterator[tuple[Hit, FloatArray]]:
        """Evaluate candidates, and the slopes of noise along the columns of each, (n_column, DRAWS).

        Products of many columns at once take a fraction of the time of one after the other.
        """
        done = list[tuple[Candidate, Columns]]()
        for candidate in candidates:
            try:
                done.append((candidate, self._columns(candidate, {})))
            except (RobidError, ArithmeticError, ValueError) as error:
                failures.append(Failure(*candidate.key, f"{type(error).__name__}: {error}"))
        if not done:
            return
        rows = np.concatenate([columns.rows for _, columns in done])
        sums = self.projection.sums(rows)
        drawn, taken = self._noise
        by_chance = rows.astype(np.float32) @ drawn - sums.cross.sum(axis=0).T @ taken
        first = 0
        for candidate, columns in done:
            own = range(first, first + len(columns.rows))
            first = own.stop
            yield self._hit(candidate, {}, columns.meaning, sums.of_columns(own)), by_chance[own]

    def _columns(self, candidate: Candidate, values: dict[str, float]) -> Columns:
        columns = self.motion.columns(candidate, values)
        if not np.isfinite(columns.rows).all():
            raise ConfigurationError("the law gives NaN or infinite values along this motion")
        return columns

    def _hit(self, candidate: Candidate, values: dict[str, float], meaning: ColumnMeaning, sums: Sums) -> Hit:
        linear = issubclass(candidate.effect, SignalEffect) and WHOLE not in meaning.names
        blind = EXACT if linear else self.blind
        gain = self.projection.gain(sums, meaning.positive, blind, meaning.paired)
        shape = {name: float(candidate.values[name]) for name in candidate.shape}
        return Hit(candidate, {**shape, **values}, meaning, sums, gain)

    def refined(self, hit: Hit, *, as_it_is: bool = False) -> Hit:
        """Move the shape of a candidate to where it gains most; `as_it_is`: with the law neither grown nor shrunk."""
        if hit.candidate.springs:
            return self._softened(hit)
        if not hit.candidate.shape:
            return hit
        starts = (hit, *self._sized(hit)) if as_it_is else (hit,)
        moved = (self._moved(one, as_it_is) for one in starts)
        return max(moved, key=lambda one: self._worth(one, as_it_is))

    def _softened(self, hit: Hit) -> Hit:
        """Springs as soft as their columns ask for, and these evaluated anew, until sizes stay at one."""
        best, most = hit, -np.inf
        for _ in range(ROUNDS):
            if not hit.gain.freedom:
                break
            sizes = dict(zip(hit.names, hit.gain.size.tolist(), strict=True))
            worth = self._of_size_one(hit.sums.of_columns(hit.gain.chosen))
            if worth > most:
                best, most = hit, worth
            if max(abs(np.log(size)) for size in sizes.values()) < SHARP:
                break
            values = {**hit.values, **softened(hit.candidate, hit.values, sizes)}
            try:
                hit = self.hit(hit.candidate, values)
            except RobidError:
                break
        found = replace(best, values={**best.values, **unseen(best.candidate, best.values, best.names)})
        return self._moved(found, as_it_is=True) if most < KEPT * best.gain.total else found

    def _moved(self, hit: Hit, as_it_is: bool) -> Hit:
        """Where the shape gains most near by."""
        names = hit.candidate.shape
        rows = {row.name: row for row in hit.candidate.effect.parameters}
        start = np.array([hit.values[name] for name in names])
        best, most = hit, self._worth(hit, as_it_is)

        def values_at(way: FloatArray) -> dict[str, float]:
            """Orders move by periods, all else by its logarithm."""
            moved = [
                value + step if name == "order" else value * np.exp(step)
                for name, value, step in zip(names, start, way, strict=True)
            ]
            return {
                name: float(np.clip(value, rows[name].lower, rows[name].upper))
                for name, value in zip(names, moved, strict=True)
            }

        def loss(way: FloatArray) -> float:
            nonlocal best, most
            if (np.abs(way) > np.log(FACTOR)).any():
                return 0.0
            try:
                tried = self.hit(hit.candidate, values_at(way))
            except RobidError:
                return 0.0
            worth = self._worth(tried, as_it_is)
            if worth > most:
                best, most = tried, worth
            return -worth

        begin, size = np.zeros(len(names)), FIRST_STEP
        if as_it_is and len(names) == 1:  # a limit is worth something only near its own value
            ways = np.arange(-FIRST_STEP, FIRST_STEP + SHARP, SHARP)
            begin, size = ways[[np.argmin([loss(np.array([way])) for way in ways])]], SHARP
        simplex = np.vstack([begin, begin + size * np.eye(len(names))])
        options = {"maxfev": STEPS, "xatol": SHARP, "fatol": 0.5, "initial_simplex": simplex}
        scipy.optimize.minimize(loss, begin, method="Nelder-Mead", options=options)
        return best

    def _sized(self, hit: Hit) -> Iterator[Hit]:
        """Hits with one number of the shape grown or shrunk by the best size: small gaps act in proportion."""
        size = float(np.abs(hit.gain.size).max(initial=0.0))
        if size == 0:
            return
        for row in hit.candidate.effect.parameters:
            if row.name in hit.candidate.shape:
                for value in (hit.values[row.name] * size, hit.values[row.name] / size):
                    if row.lower < value < row.upper:
                        with contextlib.suppress(RobidError):
                            yield self.hit(hit.candidate, {**hit.values, row.name: value})

    def _worth(self, hit: Hit, as_it_is: bool) -> float:
        """What a hit gains; with sizes of one, where it must stay as it is."""
        if not as_it_is:
            return hit.gain.total
        return self._of_size_one(hit.sums)

    def _of_size_one(self, sums: Sums) -> float:
        """What columns gain as they are."""
        matrix, slope = self.projection.normal(sums)
        return float(2 * slope.sum() - matrix.sum())

    @cached_property
    def _noise(self) -> tuple[npt.NDArray[np.float32], FloatArray]:
        """Noise in place of the residual, (n_row, DRAWS), and what the fit takes of it, (n_unknown, DRAWS)."""
        rows = self.projection.fitted
        drawn = self.generator.standard_normal((len(rows), DRAWS), dtype=np.float32)  # single: half the time
        return drawn, rows.T @ drawn.astype(np.float64)


def _log_p_of(gain: float, freedom: int) -> float:
    """Logarithm of the p-value, without a search, of a gain by so many numbers."""
    return float(scipy.stats.chi2.logsf(gain, max(freedom, 1)))


def _log_p_by_chance(hit: Hit, matrix: FloatArray, slope: FloatArray) -> FloatArray:
    """Logarithm of the p-value that noise gives a candidate in each draw, from its slopes (n_column, DRAWS)."""
    chosen = list(hit.gain.chosen)
    inside = inverse(matrix[np.ix_(chosen, chosen)], same=np.finfo(float).eps)
    total = (slope[chosen] * (inside @ slope[chosen])).sum(axis=0)
    result: FloatArray = np.log(scipy.special.chdtrc(len(chosen), total))
    return result


def parameters_of(hit: Hit, scaled: Sequence[str]) -> dict[str, float]:
    """Values of all parameters of the effect that a hit means.

    `scaled` are those to which, all together, a law is proportional that is linear in none; empty where it is not.
    """
    rows = {row.name: row for row in hit.candidate.effect.parameters}
    found = {**hit.candidate.values, **hit.values}
    meaning, gain = hit.meaning, hit.gain
    sizes = dict.fromkeys(range(len(meaning.names)), 0.0) | dict(
        zip(gain.chosen, gain.size.tolist(), strict=True)
    )
    if meaning.paired:
        names = list(dict.fromkeys(meaning.names))
        waves = {
            name: sum(
                size * np.exp(1j * meaning.phases[i]) for i, size in sizes.items() if meaning.names[i] == name
            )
            for name in names
        }
        largest = max(names, key=lambda name: abs(waves[name]))
        found["phase"] = float(np.angle(waves[largest]))
        turned = {name: float((wave * np.exp(-1j * found["phase"])).real) for name, wave in waves.items()}
        if WHOLE in turned:
            found |= {name: turned[WHOLE] * found[name] for name in scaled}
        else:
            found |= turned
    elif hit.candidate.springs:
        pass  # values are those with which sizes are one
    elif meaning.names == (WHOLE,):
        found |= {name: sizes[0] * found[name] for name in scaled}
    else:
        found |= {name: sizes[i] for i, name in enumerate(meaning.names)}
    return {name: float(np.clip(value, rows[name].lower, rows[name].upper)) for name, value in found.items()}
