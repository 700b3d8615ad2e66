"""Identifiability: how well the data determine each free parameter, from derivatives and weights alone.

In units of the priors' standard deviations the information of the free parameters, all other unknowns projected out, is
``I + S``; a direction in which S is above one is determined better by the data than by the priors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray
from robid_core.errors import NotIdentifiable
from robid_core.residual.problem import Linearisation, TorqueProblem

BLIND = 0.9  # posterior over prior: above it data tell next to nothing
UNCERTAIN = 0.3  # prior, in natural scales: what was known better before may stay as it was
MOST_NAMES = 8


@dataclass(frozen=True, eq=False)
class Visibility:
    """How well data determine the free parameters, before they are fitted."""

    names: tuple[str, ...]
    prior: FloatArray
    """Standard deviations in natural scales, shape (n_free,)."""
    share: FloatArray
    """Posterior over prior standard deviation, shape (n_free,)."""
    rank: int
    """Directions that the data determine better than the priors do."""
    condition: float
    """Largest over smallest information, in units of the priors."""

    def __str__(self) -> str:
        halved = int((self.share < 0.5).sum())
        return (
            f"identifiability: the data determine {self.rank} of {len(self.names)} directions better than the priors, "
            f"and halve the standard deviation of {halved} parameter{'' if halved == 1 else 's'}; condition number "
            f"{self.condition:.1e}"
        )

    def check(self, needed: npt.NDArray[np.bool_]) -> None:
        """Refuse parameters that are needed, were not known and are not determined by the data.

        Raises
        ------
        NotIdentifiable
            With the names of such parameters.
        """
        blind = np.flatnonzero(needed & (self.share > BLIND) & (self.prior >= UNCERTAIN))
        if not len(blind):
            return
        named = ", ".join(self.names[i] for i in blind[:MOST_NAMES])
        more = f" and {len(blind) - MOST_NAMES} more" if len(blind) > MOST_NAMES else ""
        raise NotIdentifiable(
            f"the data do not determine {named}{more}: fix what they do not show (fixed: [{self.names[blind[0]]}]), "
            "give it a prior, or measure configurations that show it; where the size of an effect starts at zero its "
            "other parameters have no influence: start it at another size",
            [self.names[i] for i in blind],
        )


def visibility(problem: TorqueProblem, about: Linearisation) -> Visibility:
    """Return how well the data determine the free parameters, about one point."""
    n, prior = problem.n_free, problem.prior
    scaled = about.whole * np.outer(prior, prior)
    others = scaled[n:, n:]
    told = scaled[:n, :n] - scaled[:n, n:] @ np.linalg.solve(others, scaled[n:, :n])
    values, vectors = np.linalg.eigh(told)
    values = np.maximum(values, 1.0)  # of the priors alone; less is rounding
    share = np.sqrt(((vectors**2) / values).sum(axis=1))
    return Visibility(
        problem.free.names,
        prior[:n],
        share,
        int((values > 2.0).sum()),
        float(values[-1] / values[0]),
    )
