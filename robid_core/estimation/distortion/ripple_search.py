"""Which waves of the motor's angle a record shows: forward selection with a stated rate of false alarms.

Order analysis by least squares: every candidate, a kind of ripple and an order, is a pair of columns, cosine and sine,
in the normal equations of one motor, configurations added up where the phase is common. The pair that explains most
is tested (`ripple_significance`), corrected for all that was tried (Bonferroni), taken and swept out of the equations,
until none is significant; then those go that later ones have made superfluous, weights are taken anew from what is
left, and the search begins again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core.arrays import FloatArray
from robid_core.estimation.distortion.order_analysis import (
    KINDS,
    Kind,
    MotorData,
    Wave,
    residuals,
    stacked,
    torque_and_friction,
    unexplained,
)
from robid_core.estimation.distortion.ripple_significance import Rows, chance_of_pair, covariance

ROUNDS = 12  # of search and new weights; two or three are enough, one for each wave where orders are refined
COLLINEAR = 1e-6  # share of a pair's length left by others below which it counts as their combination
TIE = 6.0  # chi-square by which another kind may explain less and is as good: a log-likelihood of 3


@dataclass(frozen=True)
class Ripple:
    """One wave that was found: ``cosine cos(order q) + sine sin(order q)``, q the motor's angle.

    Sizes are in N m (cogging), shares of the torque (current), rad at the motor (resolver).
    """

    kind: Kind
    order: float
    cosine: float
    sine: float
    standard_error: float
    """Of the amplitude."""
    chi_square: float
    """Of the pair beside all others that were found, two degrees of freedom."""
    p_value: float
    """Probability of so much by chance in any of the candidates tried."""
    ties: tuple[Kind, ...] = ()
    """Kinds that explain the data as well at this order."""

    @property
    def wave(self) -> Wave:
        """Kind and order."""
        return self.kind, self.order

    @property
    def amplitude(self) -> float:
        """Size of the wave."""
        return float(np.hypot(self.cosine, self.sine))

    @property
    def phase(self) -> float:
        """Phase at motor angle zero, rad: the wave is ``amplitude sin(order q + phase)``."""
        return float(np.arctan2(self.cosine, self.sine))


@dataclass(frozen=True)
class Found:
    """Ripple of one motor."""

    ripple: tuple[Ripple, ...]
    misfit: float
    """Weighted root mean square of the torque residual beside friction, over that beside friction and ripple."""


@dataclass(frozen=True, eq=False)
class NormalMatrix:
    """Normal equations: columns are waves in pairs (cosine, sine), last the measured torque.

    Rows are scaled to unit variance; linear response and friction are projected out.
    """

    waves: tuple[Wave, ...]
    gram: FloatArray
    """Shape (2 n_wave + 1, 2 n_wave + 1)."""
    freedom: float
    """Real degrees of freedom of the torque residual before any wave is fitted."""

    def __add__(self, other: NormalMatrix) -> NormalMatrix:
        """Put configurations with the same ripple together."""
        return NormalMatrix(self.waves, self.gram + other.gram, self.freedom + other.freedom)

    @property
    def length(self) -> FloatArray:
        """Squared length of each pair of columns, shape (n_wave,)."""
        return np.asarray(np.diag(self.gram)[:-1].reshape(-1, 2).sum(axis=1), dtype=np.float64)


class Motor:
    """One motor in the configurations in which its ripple is the same; residuals of candidates are kept."""

    def __init__(self, configurations: Sequence[MotorData], candidates: tuple[Wave, ...]) -> None:
        self.configurations = configurations
        self.candidates = candidates
        self._beside = [torque_and_friction(data) for data in configurations]
        # Single precision: they are many (50 MB for 40 orders, 24 experiments and 8 s), and six digits will do.
        self._columns = [residuals(data, candidates).astype(np.complex64) for data in configurations]

    def deviation(self, known: tuple[Wave, ...]) -> list[FloatArray]:
        """Deviation of each bin in each configuration beside friction and known waves, shape (n_bin,) each."""
        return [
            unexplained(np.concatenate([beside, residuals(data, known)], axis=-1), data)[1]
            for data, beside in zip(self.configurations, self._beside, strict=True)
        ]

    def projected(
        self,
        deviation: list[FloatArray],
        waves: tuple[Wave, ...] | None = None,
        known: tuple[Wave, ...] = (),
    ) -> list[FloatArray]:
        """Real rows of waves (None: all candidates) and, last, of the torque, friction and `known` projected out."""
        rows = []
        for data, beside, kept, spread in zip(
            self.configurations, self._beside, self._columns, deviation, strict=True
        ):
            columns = kept if waves is None else residuals(data, waves)
            nuisance = stacked(np.concatenate([beside[..., 1:], residuals(data, known)], axis=-1), spread)
            length = np.linalg.norm(nuisance, axis=0)
            there = length > 1e-12 * length.max(initial=0.0)
            basis, _ = np.linalg.qr(nuisance[:, there] / length[there])
            wanted = stacked(np.concatenate([columns, beside[..., :1]], axis=-1), spread)
            wanted -= basis @ (basis.T @ wanted)
            rows.append(wanted)
        return rows

    def equations(
        self,
        deviation: list[FloatArray],
        waves: tuple[Wave, ...] | None = None,
        known: tuple[Wave, ...] = (),
    ) -> NormalMatrix:
        """Normal equations of these rows, configurations together."""
        gram = sum(rows.T @ rows for rows in self.projected(deviation, waves, known))
        freedom = sum(
            2 * float(data.basis.freedom[np.isfinite(spread)].sum()) - beside.shape[-1] + 1 - 2 * len(known)
            for data, beside, spread in zip(self.configurations, self._beside, deviation, strict=True)
        )
        return NormalMatrix(self.candidates if waves is None else waves, np.asarray(gram), freedom)

    def rows(
        self, deviation: list[FloatArray], waves: tuple[Wave, ...], known: tuple[Wave, ...] = ()
    ) -> Rows:
        """The same rows as complex spectra, for tests."""
        parts = []
        for real, data in zip(self.projected(deviation, waves, known), self.configurations, strict=True):
            half = len(real) // 2
            parts.append((real[:half] + 1j * real[half:]).reshape(len(data.angle), len(data.bins), -1))
        whole = np.concatenate(parts)
        first = self.configurations[0]
        return Rows(whole[..., :-1], whole[..., -1], first.angle.shape[-1] * first.sample_time_s)


def swept(gram: FloatArray, pair: int) -> FloatArray:
    """Normal equations with one pair of columns projected out of all others."""
    own = slice(2 * pair, 2 * pair + 2)
    result: FloatArray = gram - gram[:, own] @ np.linalg.solve(gram[own, own], gram[own, :])
    result[own, :] = result[:, own] = 0.0
    return result


def gains(gram: FloatArray, length: FloatArray) -> FloatArray:
    """Sum of squares that each pair of columns would explain alone, shape (n_pair,).

    Zero where next to nothing is left of the pair; `length` holds its squared length before any sweep.
    """
    pairs = np.arange(len(gram) - 1).reshape(-1, 2)
    blocks, right = gram[pairs[:, :, None], pairs[:, None, :]], gram[pairs, -1]
    trace = blocks[:, 0, 0] + blocks[:, 1, 1]
    determinant = blocks[:, 0, 0] * blocks[:, 1, 1] - blocks[:, 0, 1] ** 2
    # determinant / trace lies between half of the smaller eigenvalue and all of it.
    there = (trace > 0) & (determinant > COLLINEAR * length * trace)
    safe = np.where(there[:, None, None], blocks, np.eye(2))
    gain: FloatArray = np.einsum("pi,pi->p", right, np.linalg.solve(safe, right[..., None])[..., 0])
    return np.where(there, gain, 0.0)


def forward_selection(
    motor: Motor, deviation: list[FloatArray], known: tuple[Wave, ...], level: float, most: int | None = None
) -> tuple[Wave, ...]:
    """Candidates that are significant beside `known` waves and one another, the strongest first.

    Parameters
    ----------
    level
        Probability of a false alarm of a single test.
    most
        How many to take at most.
    """
    equations = motor.equations(deviation, known=known)
    length, gram, chosen = equations.length, equations.gram, list[int]()
    refused = np.zeros(len(length), dtype=bool)
    waves = motor.candidates

    def chance(pairs: list[int], which: int) -> float:
        return chance_of_pair(motor.rows(deviation, tuple(waves[p] for p in pairs), known), which)

    while len(chosen) != most:
        gain = np.where(refused, 0.0, gains(gram, length))
        best = int(np.argmax(gain))
        freedom = equations.freedom - 2 * len(chosen) - 2
        value = 0.5 * gain[best] / max(gram[-1, -1] - gain[best], 1e-300) * freedom
        if gain[best] <= 0 or scipy.stats.f.sf(value, 2, freedom) > level:
            break  # as if the residual were white noise; it is worse than that
        if chance([*chosen, best], len(chosen)) > level:
            refused[best] = True
            continue
        chosen.append(best)
        gram = swept(gram, best)
    while len(chosen) > 1:
        chances = [chance(chosen, which) for which in range(len(chosen))]
        if max(chances) <= level:
            break
        del chosen[int(np.argmax(chances))]
    return tuple(waves[pair] for pair in chosen)


def find_ripple(
    configurations: Sequence[MotorData],
    candidates: tuple[Wave, ...],
    significance: float = 0.001,
    n_tried: int | None = None,
    refine: float | None = None,
) -> Found:
    """Ripple of one motor, common to the configurations given.

    Parameters
    ----------
    configurations
        The motor in each; the zero of its angle is the same in all.
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
    motor = Motor(configurations, candidates)
    found, deviation = tuple[Wave, ...](), motor.deviation(())
    for _ in range(ROUNDS):
        if refine is None:
            chosen = forward_selection(motor, deviation, (), significance / tried)
        else:  # one at a time: an order between two candidates is a part of both
            new = forward_selection(motor, deviation, found, significance / tried, most=1)
            chosen = (*found, *(refined(motor, wave, found, deviation, refine) for wave in new))
        if set(chosen) == set(found):
            break
        found, deviation = chosen, motor.deviation(chosen)
    return fitted_ripple(motor, deviation, found, tried)


def refined(
    motor: Motor, wave: Wave, known: tuple[Wave, ...], deviation: list[FloatArray], reach: float
) -> Wave:
    """Wave of the order that explains most, within `reach` of the one given."""
    kind, order = wave

    def missing(near: float) -> float:
        equations = motor.equations(deviation, waves=((kind, near),), known=known)
        return -float(gains(equations.gram, equations.length)[0])

    # To a thousandth of a period over the whole travel.
    tolerance = 1e-3 / max(data.turns for data in motor.configurations)
    bounds = (max(order - reach, 1e-3), order + reach)
    best = scipy.optimize.minimize_scalar(
        missing, bounds=bounds, method="bounded", options={"xatol": tolerance}
    )
    return kind, float(best.x)


def fitted_ripple(motor: Motor, deviation: list[FloatArray], found: tuple[Wave, ...], tried: int) -> Found:
    """Sizes of the waves found, their standard errors, and which other kinds would do as well."""
    if not found:
        return Found((), 1.0)
    rows = motor.rows(deviation, found)
    estimate = rows.estimate()
    spread, plain = covariance(rows, estimate), np.linalg.inv(rows.gram())
    total, left = (
        float(np.sum(np.abs(x) ** 2)) for x in (rows.target, rows.target - rows.columns @ estimate)
    )
    ripple = []
    for index, (kind, order) in enumerate(found):
        own = slice(2 * index, 2 * index + 2)
        pair = estimate[own]
        chi_square = float(pair @ np.linalg.solve(spread[own, own], pair))
        squares = float(pair @ np.linalg.solve(plain[own, own], pair))
        direction = pair / max(float(np.hypot(*pair)), 1e-300)
        error = float(np.sqrt(direction @ spread[own, own] @ direction))
        chance = min(1.0, tried * chance_of_pair(rows, index))
        # Sums of squares count as much as this wave's does.
        ties = _ties(motor, deviation, found, index, squares * (1 - TIE / max(chi_square, TIE)))
        cosine, sine = (float(x) for x in pair)
        ripple.append(Ripple(kind, order, cosine, sine, error, chi_square, chance, ties))
    return Found(tuple(ripple), float(np.sqrt(total / max(left, 1e-300))))


def _ties(
    motor: Motor, deviation: list[FloatArray], found: tuple[Wave, ...], index: int, enough: float
) -> tuple[Kind, ...]:
    """Other kinds at the order of a wave that explain at least `enough` in its place."""
    order = found[index][1]
    rivals = tuple((kind, order) for kind in KINDS if (kind, order) not in found)
    if not rivals:
        return ()
    others = tuple(wave for wave in found if wave != found[index])
    equations = motor.equations(deviation, waves=(*others, *rivals))
    gram = equations.gram
    for other in range(len(others)):
        gram = swept(gram, other)
    instead = gains(gram, equations.length)[len(others) :]
    return tuple(kind for (kind, _), gain in zip(rivals, instead, strict=True) if gain >= enough)
