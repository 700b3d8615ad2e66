"""Waves of the motor's angle in any motion, periodic or not: order analysis of the torque beyond the rigid robot.

Waves are those of `order_analysis`, motions those of `angle_passage`. Angles come unevenly, so that sines and cosines
of the angle are fitted by least squares (Lomb 1976, Scargle 1982). What is left beside nuisances is coloured: an
autoregression whitens it, and all columns with it. Whether an order stands out is judged by its neighbours: noise has
about the same size at orders nearby, which the motion just tells apart. The ratio of one pair's sum of squares to that
of m neighbours has an F distribution with 2 and 2 m degrees of freedom where the noise is Gaussian.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from robid_core.arrays import BoolArray, FloatArray
from robid_core.estimation.distortion.angle_passage import Passage, wave_columns
from robid_core.estimation.distortion.order_analysis import KINDS, Kind, Wave
from robid_core.estimation.distortion.ripple_search import COLLINEAR, TIE, Found, Ripple

MEMORY = 16  # samples: of the autoregression that whitens what friction and noise leave
RIDGE = 1e-3  # of the variance, added as white noise: the whitening lifts nothing by more
NEIGHBOURS = 8  # on either side
APART = 1.25  # times the resolution of orders, from one neighbour to the next
HALF_LEVEL = 0.05  # probability by chance that either half of a record must be below by itself
DISAGREE = 0.001  # probability with which halves that agree are taken for different
MOST_WAVES = 20
TESTED = 4  # of each kind, those that explain most, are held against their neighbours


class Travels:
    """One motor in experiments that share their ripple: whitened, with all nuisances projected out."""

    def __init__(
        self, passages: Sequence[Passage], known: Sequence[Wave] = (), part: int | None = None
    ) -> None:
        """Take passages, waves that are nuisances, and which half of each passage: 0, 1, or None for all."""
        self.passages = passages
        self._kept = [_half(one, part) for one in passages]
        plain = []
        for one, kept in zip(passages, self._kept, strict=True):
            waves = [wave_columns(one, kind, np.array([order]))[:, 0] for kind, order in known]
            basis = orthonormal(np.column_stack([one.nuisance, *waves])[kept])
            plain.append(less(one.residual[kept], basis))
        self._autoregression = whitening(plain)
        self._bases = [orthonormal(self._white(i, one.nuisance)) for i, one in enumerate(passages)]
        self._known = np.zeros((sum(len(basis) for basis in self._bases), 0))
        for kind, order in known:
            pair = self.columns(kind, np.array([order]))[:, 0]
            self._known = np.column_stack([self._known, orthonormal(pair)])
        rows = [less(self._white(i, one.residual), self._bases[i]) for i, one in enumerate(passages)]
        self.target = less(np.concatenate(rows), self._known)

    @property
    def resolution(self) -> float:
        """Distance of orders that the motion just tells apart."""
        return 1.0 / max(max(one.turns for one in self.passages), 1e-9)

    def _white(self, number: int, rows: FloatArray) -> FloatArray:
        """Rows of a passage, whitened; the first ones have no past."""
        kept = rows[self._kept[number]]
        filtered: FloatArray = scipy.signal.lfilter(self._autoregression, 1.0, kept, axis=0)
        return filtered[MEMORY:]

    def columns(self, kind: Kind, orders: FloatArray) -> FloatArray:
        """Pairs of all passages below one another, shape (n_row, n_order, 2)."""
        parts = [
            less(self._white(i, wave_columns(one, kind, orders)), self._bases[i])
            for i, one in enumerate(self.passages)
        ]
        return less(np.concatenate(parts), self._known)

    def pairs(
        self, kind: Kind, orders: FloatArray, beside: Wave | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Least squares of each pair by itself, or beside a wave that leaks to its neighbours.

        Returns
        -------
        Sum of squares that it explains (n_order,), sizes of cosine and sine (n_order, 2), inverse of the pair's Gram
        matrix (n_order, 2, 2); zeros where nearly nothing is left of a pair.
        """
        x, target = self.columns(kind, orders), self.target
        if beside is not None:
            basis = orthonormal(self.columns(beside[0], np.array([beside[1]]))[:, 0])
            x, target = less(x, basis), less(target, basis)
        gram = np.einsum("roi,roj->oij", x, x)
        right = np.einsum("roi,r->oi", x, target)
        trace = gram[:, 0, 0] + gram[:, 1, 1]
        determinant = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
        there = (trace > 0) & (determinant > COLLINEAR * trace**2) & (trace > COLLINEAR * trace.max())
        safe = np.where(there[:, None, None], gram, np.eye(2))
        inverse = np.where(there[:, None, None], np.linalg.inv(safe), 0.0)
        size: FloatArray = np.einsum("oij,oj->oi", inverse, right)
        explained: FloatArray = np.einsum("oi,oi->o", size, right)
        return explained, size, inverse

    def neighbours(self, order: float) -> FloatArray:
        """Orders by which the noise at an order is judged, positive ones."""
        steps = np.concatenate([np.arange(-NEIGHBOURS, 0) - 0.5, np.arange(NEIGHBOURS) + 1.5])
        orders = order + APART * self.resolution * steps
        positive: FloatArray = orders[orders > 0.5 * self.resolution]
        return positive

    def noise(self, kind: Kind, order: float) -> tuple[float, int]:
        """Variance per degree of freedom at the neighbours of a wave, and of how many pairs it is the mean."""
        explained, _, inverse = self.pairs(kind, self.neighbours(order), (kind, order))
        there = inverse[:, 0, 0] > 0
        return (0.5 * float(explained[there].mean()), int(there.sum())) if there.any() else (np.inf, 0)

    def chance(self, kind: Kind, order: float) -> float:
        """Probability that noise gives so much at an order."""
        explained, (variance, count) = self.pairs(kind, np.array([order]))[0][0], self.noise(kind, order)
        if count < NEIGHBOURS or not variance > 0:
            return 1.0
        return float(scipy.stats.f.sf(0.5 * explained / variance, 2, 2 * count))


def whitening(rows: Sequence[FloatArray]) -> FloatArray:
    """Coefficients of the prediction error of an autoregression, shape (MEMORY + 1,), by Yule and Walker."""
    lags = np.zeros(MEMORY + 1)
    for own in rows:
        lags += [float(own[: len(own) - k] @ own[k:]) for k in range(MEMORY + 1)]
    if not lags[0] > 0:
        return np.concatenate([[1.0], np.zeros(MEMORY)])
    past = scipy.linalg.solve_toeplitz(lags[:-1] + RIDGE * lags[0] * np.eye(1, MEMORY)[0], lags[1:])
    result: FloatArray = np.concatenate([[1.0], -past])
    return result


def less(rows: FloatArray, basis: FloatArray) -> FloatArray:
    """Rows, of any shape behind the first axis, without their part in an orthonormal basis."""
    flat = rows.reshape(len(rows), -1)
    result: FloatArray = flat - basis @ (basis.T @ flat)
    return result.reshape(rows.shape)


def orthonormal(columns: FloatArray) -> FloatArray:
    """Basis of what columns span; those that say nothing of their own are left out."""
    length = np.linalg.norm(columns, axis=0)
    there = length > 1e-12 * length.max(initial=0.0)
    left, values, _ = np.linalg.svd(columns[:, there] / length[there], full_matrices=False)
    result: FloatArray = left[:, values > 1e-9 * values.max(initial=0.0)]
    return result


def _half(passage: Passage, part: int | None) -> BoolArray:
    """Samples of a half; halves have equally much motion."""
    if part is None:
        return np.ones(len(passage.angle), dtype=bool)
    way = np.cumsum(np.abs(passage.speed))
    first: BoolArray = way <= 0.5 * way[-1]
    return first if part == 0 else ~first


def halves_agree(passages: Sequence[Passage], wave: Wave, known: Sequence[Wave]) -> bool:
    """Whether either half of the motion shows a wave by itself, with the same size and phase."""
    kind, order = wave
    sizes, spreads, fewest = [], [], NEIGHBOURS
    for part in (0, 1):
        half = Travels(passages, known, part)
        if half.chance(kind, order) > HALF_LEVEL:
            return False
        variance, count = half.noise(kind, order)
        _, size, inverse = half.pairs(kind, np.array([order]))
        sizes.append(size[0])
        spreads.append(variance * inverse[0])
        fewest = min(fewest, count)
    apart = sizes[1] - sizes[0]
    statistic = 0.5 * float(apart @ np.linalg.solve(spreads[0] + spreads[1], apart))
    return bool(scipy.stats.f.sf(statistic, 2, 2 * fewest) > DISAGREE)


def find_orders(
    passages: Sequence[Passage],
    candidates: Sequence[Wave],
    significance: float = 0.001,
    n_tried: int | None = None,
    refine: float | None = None,
) -> Found:
    """Ripple of one motor, common to the experiments given.

    The wave that stands out most beside its neighbours is tested, corrected for all that was tried (Bonferroni), and
    asked whether both halves of the motion show it; it is then projected out, and the search goes on.

    Parameters
    ----------
    passages
        The motor in each experiment; the zero of its angle is the same in all.
    candidates
        Waves to look for.
    significance
        Probability of any false alarm among `n_tried` candidates.
    n_tried
        Candidates tried in all, those of other motors included; None: those given.
    refine
        How far from a candidate's order the true one may be, which is then fitted; None: orders are exact.
    """
    if not candidates:
        return Found((), 1.0)
    tried = max(n_tried or len(candidates), len(candidates))
    found, refused = list[Wave](), set[Wave]()
    whole = Travels(passages)
    start = float(np.linalg.norm(whole.target))
    while len(found) < MOST_WAVES:
        travels = Travels(passages, found)
        wave = _strongest(travels, [one for one in candidates if one not in refused and one not in found])
        if wave is None:
            break
        better = _refined(travels, wave, refine) if refine is not None else wave
        if travels.chance(*better) * tried > significance:
            break
        if halves_agree(passages, better, found):
            found.append(better)
        else:
            refused.add(wave)
        refused |= {one for one in candidates if refine is not None and abs(one[1] - better[1]) <= refine}
    ripple = tuple(_fitted(passages, found, index, tried) for index in range(len(found)))
    left = float(np.linalg.norm(Travels(passages, found).target))
    return Found(ripple, start / max(left, 1e-300))


def _strongest(travels: Travels, candidates: Sequence[Wave]) -> Wave | None:
    """Candidate least likely by chance; of kinds that explain as much at its order the plainest."""
    best, least = None, 1.0
    for kind in KINDS:
        orders = [order for own, order in candidates if own == kind]
        if not orders:
            continue
        explained = travels.pairs(kind, np.array(orders))[0]
        for at in np.argsort(-explained)[:TESTED].tolist():
            chance = travels.chance(kind, orders[at])
            if chance < least:
                best, least = (kind, orders[at]), chance
    if best is None:
        return None
    kinds = [kind for kind in KINDS if (kind, best[1]) in candidates]
    sizes = {kind: float(travels.pairs(kind, np.array([best[1]]))[0][0]) for kind in kinds}
    enough = max(sizes.values()) - TIE * travels.noise(*best)[0]
    return next(kind for kind in kinds if sizes[kind] >= enough), best[1]


def _refined(travels: Travels, wave: Wave, reach: float) -> Wave:
    """Wave of the order that explains most, within `reach` of the one given."""
    kind, order = wave

    def missing(near: float) -> float:
        return -float(travels.pairs(kind, np.array([near]))[0][0])

    step = 0.25 * travels.resolution
    grid = np.arange(max(order - reach, step), order + reach + step, step)
    middle = float(grid[np.argmax(travels.pairs(kind, grid)[0])])
    best = scipy.optimize.minimize_scalar(
        missing, bounds=(middle - step, middle + step), method="bounded", options={"xatol": 1e-3 * step}
    )
    return kind, float(best.x)


def _fitted(passages: Sequence[Passage], found: Sequence[Wave], index: int, tried: int) -> Ripple:
    """Size of a wave beside all others, and which other kinds would do as well."""
    kind, order = found[index]
    others = [wave for wave in found if wave != found[index]]
    beside = Travels(passages, others)
    explained, size, inverse = (x[0] for x in beside.pairs(kind, np.array([order])))
    variance, count = beside.noise(kind, order)
    direction = size / max(float(np.hypot(*size)), 1e-300)
    widening = float(scipy.stats.t.ppf(0.975, 2 * count) / scipy.stats.norm.ppf(0.975))
    error = widening * float(np.sqrt(variance * direction @ inverse @ direction))
    enough = explained - TIE * variance
    ties = tuple(
        other
        for other in KINDS
        if other != kind
        and (other, order) not in found
        and float(beside.pairs(other, np.array([order]))[0][0]) >= enough
    )
    chance = float(scipy.stats.f.sf(0.5 * explained / variance, 2, 2 * count))
    cosine, sine = (float(x) for x in size)
    return Ripple(kind, order, cosine, sine, error, explained / variance, min(1.0, tried * chance), ties)
