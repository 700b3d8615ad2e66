"""Wrong values: parameters that the data pull further from what was told than their tolerance explains.

Under a prior of covariance P an estimate x of covariance S has, where the told values are as uncertain as P says, the
covariance P - S. So ``x^T (P - S)^-1 x`` is chi-square distributed; it is also what the fit would gain by giving the
prior up, the others refitted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from robid_core import FloatArray, Robot, StructureEffect
from robid_core.residual import Linearisation, TorqueProblem, effect_class

PRICE = 3.0  # of a number that the data choose, in twice the log-likelihood
SEEN = 1e-3  # of a prior's variance: directions of which the data take less away say nothing


@dataclass(frozen=True)
class ValueHit:
    """Parameters that belong together, and what giving up their prior gains."""

    on: str
    kind: str
    """body, rotor, spring or load."""
    names: tuple[str, ...]
    gain: float
    freedom: int

    @property
    def worth(self) -> float:
        """What it gains, less what as many numbers gain by chance."""
        return self.gain - PRICE * self.freedom

    @property
    def log_p(self) -> float:
        """Logarithm of the p-value of this group alone."""
        return float(scipy.stats.chi2.logsf(self.gain, max(self.freedom, 1)))


def value_groups(robot: Robot, names: tuple[str, ...]) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Parameters that are wrong together, of a body, rotor, spring or load of a variant: (kind, where, names)."""
    for body in robot.description.bodies:
        own = tuple(
            name
            for name in names
            if name.split(".")[0] in ("mass", "centre_of_mass", "inertia")
            and name.split(".")[1] == body.joint
        )
        if own:
            yield "body", body.joint, own
    for head, kind in (
        ("rotor_inertia", "rotor"),
        ("gear_stiffness", "spring"),
        ("bearing_stiffness", "spring"),
    ):
        for name in names:
            if name.startswith(f"{head}."):
                yield kind, name.partition(".")[2], (name,)
    for label, entry in robot.description.effects.items():
        effect, own = effect_class(entry.use), tuple(n for n in names if n.startswith(f"effect.{label}."))
        if own and issubclass(effect, StructureEffect) and effect.places[0] == "body":
            yield "load", label, own


def value_hits(problem: TorqueProblem, point: FloatArray, about: Linearisation) -> list[ValueHit]:
    """What every group would gain, largest first."""
    covariance, prior = np.linalg.inv(about.whole), problem.prior
    index = {name: i for i, name in enumerate(problem.free.names)}
    found = []
    for kind, on, names in value_groups(problem.free.robot, problem.free.names):
        rows = [index[name] for name in names]
        inside = covariance[np.ix_(rows, rows)] / np.outer(prior[rows], prior[rows])
        size, axes = np.linalg.eigh(np.eye(len(rows)) - inside)
        along = axes.T @ (point[rows] / prior[rows])
        seen = size > SEEN
        gain = float((along[seen] ** 2 / size[seen]).sum())
        found.append(ValueHit(on, kind, names, gain, int(seen.sum())))
    return sorted(found, key=lambda hit: hit.worth, reverse=True)
