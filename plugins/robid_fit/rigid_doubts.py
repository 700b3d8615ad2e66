"""What only a rigid fit can doubt: residuals with a memory, bodies unlike the file's, experiments that disagree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid_core import Doubt, FloatArray
from robid_core.estimation.rigid.coloured import correlation
from robid_fit.rigid_equations import RigidEquations
from robid_fit.rigid_solution import RigidSolution
from robid_fit.rigid_unknowns import RigidUnknowns

COLOURED = 0.5  # from one sample to the next
WIDENED = 3.0  # times the tolerances that were stated
DISAGREE = 2.0  # stated errors between experiments, rms over the base parameters
WEAK = 0.5  # of what was known before
WORSE = 1.5  # times what is left when it is fitted
MOST = 6  # names in a sentence
LATEST = 1.0  # samples between torque and angle: drives differ by less


def doubts(
    equations: RigidEquations,
    unknowns: RigidUnknowns,
    solution: RigidSolution,
    base: FloatArray,
    base_names: Sequence[str],
) -> tuple[Doubt, ...]:
    """Return every reason not to rely on a rigid fit.

    Parameters
    ----------
    equations, unknowns, solution
        What was fitted.
    base, base_names
        Base parameters per unit of each coordinate, (n_base, n_unknown), and what they are called.
    """
    return (
        *_coloured(equations, solution, unknowns.free.robot.axis_names),
        *_weak(solution, base, base_names),
        *_unlike(solution),
        *_apart(solution, base),
        *_late(unknowns, solution),
    )


def prediction_doubts(
    fitted: FloatArray, left_out: FloatArray, axis_names: Sequence[str]
) -> tuple[Doubt, ...]:
    """Doubt axes whose torque is predicted much worse than it is fitted; shares that are left, (n_axis,) each."""
    told = [
        f"{name} {100 * there:.3g} % for {100 * here:.3g} %"
        for name, here, there in zip(axis_names, fitted.tolist(), left_out.tolist(), strict=True)
        if there > WORSE * here
    ]
    if not told:
        return ()
    return (
        Doubt(
            "prediction",
            f"blocks left out are predicted much worse than they are fitted: {_listed(told)}",
            "record longer and richer motions, state tolerances that are narrower (prior), or free less (fixed)",
        ),
    )


def _coloured(
    equations: RigidEquations, solution: RigidSolution, axis_names: Sequence[str]
) -> Iterator[Doubt]:
    parts = [correlation(solution.at.residual[part]) for part in equations.parts]
    lengths = [part.stop - part.start for part in equations.parts]
    each = np.average(parts, axis=0, weights=lengths)
    told = [
        f"{name} {own:.2f}" for name, own in zip(axis_names, each.tolist(), strict=True) if own > COLOURED
    ]
    if told:
        yield Doubt(
            "residual colour",
            f"what is left has a memory: correlation of one sample with the next {_listed(told)}",
            "something that acts in the machine is not in the model; diagnosis.effects looks for it. Standard errors "
            "count the colour, a bias they do not",
        )


def _weak(solution: RigidSolution, base: FloatArray, names: Sequence[str]) -> Iterator[Doubt]:
    known = np.isfinite(solution.prior)
    before = np.sqrt((base[:, known] ** 2) @ solution.prior[known] ** 2)
    after = np.sqrt(np.maximum(np.einsum("bi,ij,bj->b", base, solution.covariance, base), 0.0))
    free = ~base[:, ~known].any(axis=1)
    weak = [names[i] for i in np.flatnonzero(free & (after > WEAK * before) & (before > 0)).tolist()]
    if weak:
        yield Doubt(
            "weakly seen",
            f"{len(weak)} of {len(names)} base parameters are told by the robot file rather than by the data: "
            f"{_listed(weak)}",
            "record motions that show them (excitation.fourier plans such), or predict like motions only",
        )


def _unlike(solution: RigidSolution) -> Iterator[Doubt]:
    if solution.asked > WIDENED:
        yield Doubt(
            "tolerance",
            f"bodies differ from the robot file {solution.asked:.3g} times as much as their tolerances promise",
            "state what is known of them (prior, widen), or look for what acts in the machine and is not in the model",
        )


def _apart(solution: RigidSolution, base: FloatArray) -> Iterator[Doubt]:
    n = len(solution.influence)
    if n <= 1:
        return
    moved = solution.influence @ base.T
    spread = np.sqrt((n - 1) / n * (moved**2).sum(axis=0))
    stated = np.sqrt(np.maximum(np.einsum("bi,ij,bj->b", base, solution.covariance, base), 0.0))
    ratio = spread / np.where(stated > 0, stated, np.inf)
    whole = float(np.sqrt((ratio**2).mean()))
    if whole > DISAGREE:
        yield Doubt(
            "experiments disagree",
            f"leaving out one of {n} experiments moves base parameters by {whole:.2g} stated errors (rms, jackknife)",
            "do not rely on the stated errors: experiments differ in what the model lacks (temperature, load, speed)",
        )


def _late(unknowns: RigidUnknowns, solution: RigidSolution) -> Iterator[Doubt]:
    samples = solution.at.point[unknowns.n_own :]
    errors = np.sqrt(np.diag(solution.covariance)[unknowns.n_own :])
    told = [
        f"{name.replace('torque_delay', 'the torque').replace('.', ' of ')} {'lags' if late > 0 else 'leads'} the "
        f"angles by {abs(late):.2f} ± {error:.1g} samples"
        for name, late, error in zip(unknowns.delays, samples.tolist(), errors.tolist(), strict=True)
        if abs(late) > LATEST + 2 * error
    ]
    if told:
        yield Doubt(
            "timing",
            _listed(told),
            "look at the clocks of both channels; say what is known where the record is read (motor_torque: delay_s)",
        )


def _listed(names: Sequence[str]) -> str:
    more = len(names) - MOST
    return ", ".join(names[:MOST]) + (f" and {more} more" if more > 0 else "")
