"""Which law of friction the plateaus of one motor show, and how sure each of its numbers is.

Laws are nested (`friction_terms`): a term is taken where an F test says that chance would hardly gain as much. A
plateau is one equation: residuals within it are coloured, and only the scatter between plateaus says how sure a mean
is. How much of that scatter falls with a plateau's length is found by restricted likelihood (Patterson and Thompson
1971).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from robid_core import FloatArray
from robid_fit.friction_terms import SHAPED, Extra, Shape, columns_of, stribeck_or_viscous
from robid_fit.plateau_torques import AxisPlateaus

SPARE = 2  # plateaus beyond the unknowns, at least
SMALLEST_SCATTER = 1e-4  # of the torque: filters and rigid dynamics are not exact to more
COLLINEAR = 1e-3  # share of a column's length that others leave, below which it says nothing of its own
SHARES = np.linspace(0.0, 1.0, 6)  # of the variance that falls with the length of a plateau
REWEIGHTINGS = 3
GRID, ZOOMS = (
    24,
    4,
)  # Stribeck speeds, and decays, that are tried; each time between the neighbours of the best
HANGS_ON = {"stribeck_speed": "excess", "decay": "viscous"}
LONGEST_DECAY_K, SHORTEST_DECAY_K = 1e3, 1.0  # of the catalogue's effect


@dataclass(frozen=True, eq=False)
class FrictionFit:
    """A law with its numbers.

    `names` (coulomb, viscous, offset as far as they were free, then those of the extras), `value` and `covariance` of
    these; `chance` holds for each extra the probability of its gain without it, after the search. `widening` is that of
    standard errors by which 1.96 of them hold 95 %, few plateaus or many, (n_name,).
    """

    extras: tuple[Extra, ...]
    shape: Shape
    names: tuple[str, ...]
    value: FloatArray
    covariance: FloatArray
    residual: FloatArray
    widening: FloatArray
    chance: dict[str, float]
    columns: FloatArray

    @property
    def standard_error(self) -> FloatArray:
        """Shape (n_name,)."""
        result: FloatArray = self.widening * np.sqrt(np.diag(self.covariance))
        return result

    def of(self, name: str) -> float:
        """Return one number."""
        return float(self.value[self.names.index(name)])


def _solved(table: AxisPlateaus, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients and residual."""
    rows = columns / table.spread[:, None]
    length = np.linalg.norm(rows, axis=0)
    safe = np.where(length > 0, length, 1.0)
    value: FloatArray = np.linalg.lstsq(rows / safe, table.torque / table.spread)[0] / safe
    return value, table.torque - columns @ value


def squares(table: AxisPlateaus, base: Sequence[str], extras: Sequence[Extra], shape: Shape) -> float:
    """Weighted sum of squared residuals, floor included."""
    residual = _solved(table, columns_of(table, base, extras, shape)[1])[1] / table.spread
    return float(residual @ residual) + _floor(table)


def _floor(table: AxisPlateaus) -> float:
    return SMALLEST_SCATTER**2 * float(table.torque @ table.torque)


def best_shape(table: AxisPlateaus, base: Sequence[str], extras: Sequence[Extra], start: Shape) -> Shape:
    """Shape that leaves least: a grid, then a bounded search, one number after the other."""
    shape = start
    if "asymmetric" in extras:
        ways = [replace(shape, forwards=way) for way in (True, False)]
        shape = next((one for one in ways if _coefficient(table, base, extras, one, "one_way") >= 0), ways[0])
    for _ in range(3 if {"stribeck", "temperature"} <= set(extras) else 1):
        if "stribeck" in extras:
            shape = _along(table, base, extras, shape, "stribeck_speed", *_speed_range(table))
        if "temperature" in extras and "viscous" in base:
            decays = SHORTEST_DECAY_K, LONGEST_DECAY_K
            shape = _along(table, base, extras, shape, "decay", *decays)
    return shape


def _speed_range(table: AxisPlateaus) -> tuple[float, float]:
    sizes = np.abs(table.speed)
    return 0.5 * float(sizes.min()), float(sizes.max())


def with_number(shape: Shape, name: str, value: float) -> Shape:
    """Return a shape with another Stribeck speed or decay."""
    return replace(shape, stribeck_speed=value) if name == "stribeck_speed" else replace(shape, decay=value)


def _along(
    table: AxisPlateaus,
    base: Sequence[str],
    extras: Sequence[Extra],
    shape: Shape,
    name: str,
    low: float,
    high: float,
) -> Shape:
    """Search along the logarithm of one number of the shape, on which a single column hangs."""
    names, columns = columns_of(table, base, extras, shape)
    own = np.array([column == HANGS_ON[name] for column in names])
    beside = columns[:, ~own] / table.spread[:, None]
    basis, _ = np.linalg.qr(beside / np.linalg.norm(beside, axis=0))
    target = table.torque / table.spread
    target = target - basis @ (basis.T @ target)
    ends, best = (float(np.log(low)), float(np.log(high))), low
    for _ in range(ZOOMS):
        grid = np.linspace(*ends, GRID)
        trials = stribeck_or_viscous(table, shape, name, np.exp(grid)) / table.spread[:, None]
        length = (trials**2).sum(axis=0)
        trials = trials - basis @ (basis.T @ trials)
        rest = (trials**2).sum(axis=0)
        there = rest > COLLINEAR**2 * length
        gain = np.where(there, (target @ trials) ** 2 / np.where(there, rest, 1.0), 0.0)
        at = int(np.argmax(gain))
        ends, best = (float(grid[max(at - 1, 0)]), float(grid[min(at + 1, GRID - 1)])), float(grid[at])
    return with_number(shape, name, float(np.exp(best)))


def _coefficient(
    table: AxisPlateaus, base: Sequence[str], extras: Sequence[Extra], shape: Shape, name: str
) -> float:
    names, columns = columns_of(table, base, extras, shape)
    return float(_solved(table, columns)[0][names.index(name)])


POSITIVE: dict[Extra, str] = {"stribeck": "excess", "load": "load"}


def n_unknown(table: AxisPlateaus, base: Sequence[str], extras: Sequence[Extra], shape: Shape) -> int:
    """Unknowns of a law, linear and not."""
    linear = len(columns_of(table, base, extras, shape)[0])
    return linear + sum(SHAPED.get(extra, 0) for extra in extras)


def can_be_told(
    table: AxisPlateaus, base: Sequence[str], extras: Sequence[Extra], extra: Extra, shape: Shape
) -> bool:
    """Whether these plateaus could show an extra beside others: there are enough, and its columns are its own."""
    if extra == "temperature" and not (
        np.isfinite(table.temperature).all() and np.ptp(table.temperature) > 0
    ):
        return False
    if extra == "asymmetric" and not {"viscous", "offset"} <= set(base):
        return False
    if extra == "stribeck" and "viscous" not in base:
        return False
    if extra == "load" and "gravity" in extras:
        return False  # what the robot file says of the load is wrong
    if n_unknown(table, base, [*extras, extra], shape) + SPARE > table.n_plateau:
        return False
    known, beside = columns_of(table, base, extras, shape)
    names, columns = columns_of(table, base, [*extras, extra], shape)
    basis, _ = np.linalg.qr(beside / np.linalg.norm(beside, axis=0))
    added = columns[:, [name not in known for name in names]]
    rest = added - basis @ (basis.T @ added)
    length = np.linalg.norm(added, axis=0)
    if extra in SHAPED:
        return bool(length.any())
    values = np.linalg.svd(rest / np.where(length > 0, length, 1.0), compute_uv=False)
    return bool(values[-1] > COLLINEAR)


def chance_of(
    table: AxisPlateaus, base: Sequence[str], without: Sequence[Extra], extra: Extra, shape: Shape
) -> tuple[float, Shape]:
    """Probability by an F test that an extra gains so much without being there, and the shape with it."""
    extras = [*without, extra]
    bare, full = best_shape(table, base, without, shape), best_shape(table, base, extras, shape)
    name = POSITIVE.get(extra)
    if name is not None and _coefficient(table, base, extras, full, name) <= 0:
        return 1.0, full
    less, more = squares(table, base, extras, full), squares(table, base, without, bare)
    unknowns = n_unknown(table, base, extras, full)
    added = unknowns - n_unknown(table, base, without, bare)
    freedom = table.n_plateau - unknowns
    ratio = max(more - less, 0.0) / added / (less / freedom)
    return float(scipy.stats.f.sf(ratio, added, freedom)), full


def spread_with(table: AxisPlateaus, share: float) -> FloatArray:
    """Relative standard deviation where this share of the variance falls with the length of a plateau."""
    result: FloatArray = np.sqrt(1 - share + share * float(np.median(table.duration_s)) / table.duration_s)
    return result


def likelihoods(table: AxisPlateaus, columns: FloatArray) -> FloatArray:
    """Restricted likelihood of each of `SHARES` under a law with these columns; they add up to one.

    Restricted, so that it is not led by the numbers of the law that were fitted.
    """
    found = []
    for share in SHARES.tolist():
        spread = spread_with(table, share)
        rows, target = columns / spread[:, None], table.torque / spread
        length = np.linalg.norm(rows, axis=0)
        length[length == 0] = 1.0
        basis, triangle = np.linalg.qr(rows / length)
        left = target - basis @ (basis.T @ target)
        volume = float(np.log(np.abs(np.diag(triangle)) * length).sum())
        freedom = table.n_plateau - columns.shape[1]
        found.append(-0.5 * freedom * np.log(left @ left + _floor(table)) - np.log(spread).sum() - volume)
    relative: FloatArray = np.exp(np.array(found) - max(found))
    result: FloatArray = relative / relative.sum()
    return result


def weighted(table: AxisPlateaus, base: Sequence[str], extras: Sequence[Extra], shape: Shape) -> AxisPlateaus:
    """Plateaus with the spread that is to be expected under a law, of variances alike and as one over the length."""
    chances = likelihoods(table, columns_of(table, base, extras, shape)[1])
    return replace(table, spread=spread_with(table, float(chances @ SHARES)))


def choose(
    table: AxisPlateaus, base: Sequence[str], asked: Sequence[Extra], significance: float, exponent: float
) -> FrictionFit:
    """Fit the smallest law that these plateaus do not contradict, and the weights that go with it.

    Parameters
    ----------
    table
        Plateaus of one motor.
    base
        Of coulomb, viscous and offset what is free; the torque is without what is held.
    asked
        Extras that may be taken.
    significance
        Probability of any false extra.
    exponent
        Of the Stribeck curve.
    """
    found = selected(table, base, asked, significance, exponent)
    for _ in range(REWEIGHTINGS):
        table, before = weighted(table, base, found.extras, found.shape), found
        found = selected(table, base, asked, significance, exponent)
        if found.extras == before.extras:
            break
    return found


def selected(
    table: AxisPlateaus, base: Sequence[str], asked: Sequence[Extra], significance: float, exponent: float
) -> FrictionFit:
    """Fit the smallest law by weights that are known; parameters as `choose`.

    Forwards: of all extras that are left the least likely by chance is taken, while that probability times the number
    of extras asked for is below `significance`. Then backwards: an extra that is superfluous beside later ones goes.
    """
    shape, extras, chance = Shape(exponent=exponent), list[Extra](), dict[str, float]()
    while True:
        rest = [e for e in asked if e not in extras and can_be_told(table, base, extras, e, shape)]
        tried = {extra: chance_of(table, base, extras, extra, shape) for extra in rest}
        best = min(tried, key=lambda extra: tried[extra][0], default=None)
        if best is None or tried[best][0] * len(asked) > significance:
            break
        extras.append(best)
        chance[best], shape = min(1.0, tried[best][0] * len(asked)), tried[best][1]
    if "gravity" in extras and "load" in extras:
        extras.remove("load")
    for extra in list(extras):
        others = [one for one in extras if one != extra]
        alone = min(1.0, chance_of(table, base, others, extra, shape)[0] * len(asked))
        if others and alone > significance:
            extras.remove(extra)
        chance[extra] = alone
    shape = best_shape(table, base, extras, shape)
    return _fitted(table, base, tuple(extras), shape, {extra: chance[extra] for extra in extras})


def _fitted(
    table: AxisPlateaus,
    base: Sequence[str],
    extras: tuple[Extra, ...],
    shape: Shape,
    chance: dict[str, float],
) -> FrictionFit:
    """Numbers of a law with their covariance, those of its shape included."""
    names, columns = columns_of(table, base, extras, shape)
    value, residual = _solved(table, columns)
    shaped = [
        name
        for name, there in (
            ("stribeck_speed", "stribeck" in extras),
            (
                "decay",
                "temperature" in extras and "viscous" in base and shape.decay < 0.9 * LONGEST_DECAY_K,
            ),
        )
        if there
    ]
    slopes = []
    for name in shaped:
        at = getattr(shape, name)
        ends = [
            columns_of(table, base, extras, with_number(shape, name, at * (1 + sign * 1e-5)))[1] @ value
            for sign in (1, -1)
        ]
        slopes.append((ends[0] - ends[1]) / (2e-5 * at))
    jacobian = np.column_stack([columns, *slopes]) / table.spread[:, None]
    length = np.linalg.norm(jacobian, axis=0)
    length[length == 0] = 1.0
    inverse = np.linalg.pinv(jacobian / length) / length[:, None] / table.spread
    freedom = table.n_plateau - jacobian.shape[1]
    likely, each = likelihoods(table, columns), []
    for share in SHARES.tolist():
        spread = spread_with(table, share)
        moved, left = inverse * spread, residual / spread
        each.append((float(left @ left) + _floor(table)) / freedom * moved @ moved.T)
    covariance: FloatArray = np.tensordot(likely, each, axes=1)
    variances = np.diagonal(each, axis1=1, axis2=2)
    mean = np.diag(covariance)
    # Of a variance that is known like chi-square: by its residuals, and by what share of it falls with the length.
    unsure = likely @ (2 / freedom * variances**2) + likely @ (variances - mean) ** 2
    effective = 2 * mean**2 / unsure
    return FrictionFit(
        extras=extras,
        shape=shape,
        names=(*names, *shaped),
        value=np.concatenate([value, [getattr(shape, name) for name in shaped]]),
        covariance=covariance,
        residual=residual,
        widening=np.asarray(scipy.stats.t.ppf(0.975, effective) / scipy.stats.norm.ppf(0.975)),
        chance=chance,
        columns=columns,
    )
