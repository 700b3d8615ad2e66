"""What only a rigid fit can doubt: residuals with a memory, bodies unlike the file's, experiments that disagree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid_core import Doubt, FloatArray
from robid_core.estimation.disagreement import disagreement
from robid_core.estimation.rigid.coloured import correlation, is_counted
from robid_fit.disagreement_doubt import disagreement_doubt
from robid_fit.rigid_equations import RigidEquations
from robid_fit.rigid_solution import RigidSolution
from robid_fit.rigid_unknowns import RigidUnknowns
from robid_fit.tolerances import WIDENED

COLOURED = 0.5  # from one sample to the next
WEAK = 0.5  # of what was known before
MANY = 0.5  # of the base parameters: a fit of which more are weak is another robot file's
WORSE = 1.5  # times what is left when it is fitted
MOST = 6  # names in a sentence
UNEXPLAINED = 0.3  # of a torque's rms
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
        *_unexplained(equations, solution, unknowns.free.robot.axis_names),
        *_coloured(equations, solution, base, unknowns.free.robot.axis_names),
        *_weak(solution, base, base_names),
        *_unlike(solution),
        *_apart(equations, solution, base, base_names),
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


def _unexplained(
    equations: RigidEquations, solution: RigidSolution, axis_names: Sequence[str]
) -> Iterator[Doubt]:
    counted = equations.counted
    left, whole = (
        np.linalg.norm(counted * one, axis=0) for one in (solution.at.residual, solution.at.torque)
    )
    shares = left / np.maximum(whole, 1e-300)
    told = [
        f"{name} {100 * own:.0f} %"
        for name, own in zip(axis_names, shares.tolist(), strict=True)
        if own > UNEXPLAINED
    ]
    if told:
        yield Doubt(
            "unexplained torque",
            f"of some torques much is left: {_listed(told)}",
            "a rigid arm explains no motion near its resonances (cutoff_hz, below what its springs let through), and "
            "diagnosis.effects looks for what else acts there; standard errors do not cover what it is",
        )


def _coloured(
    equations: RigidEquations, solution: RigidSolution, base: FloatArray, axis_names: Sequence[str]
) -> Iterator[Doubt]:
    left = equations.counted * solution.at.residual
    residuals = [left[part] for part in equations.parts]
    parts = [correlation(residual) for residual in residuals]
    lengths = [part.stop - part.start for part in equations.parts]
    each = np.average(parts, axis=0, weights=lengths)
    told = [
        f"{name} {own:.2f}" for name, own in zip(axis_names, each.tolist(), strict=True) if own > COLOURED
    ]
    if not told:
        return
    sentence = (
        f"the residual is correlated over time: correlation of one sample with the next {_listed(told)}"
    )
    if is_counted(residuals):
        counted, white = (
            np.sqrt(np.maximum(np.einsum("bi,ij,bj->b", base, one, base), 0.0))
            for one in (solution.covariance, solution.white)
        )
        wider = float(np.median(counted[white > 0] / white[white > 0])) if (white > 0).any() else 1.0
        yield Doubt(
            "residual colour",
            f"{sentence}. Standard errors count it: they are {wider:.2g} times those of residuals without memory "
            "(median over the base parameters)",
            "diagnosis.effects looks for what acts in the machine and is not in the model; errors count no bias by it",
            "remark",
        )
        return
    yield Doubt(
        "residual colour",
        f"{sentence}, too long for this record: standard errors count it, but how far it reaches is not known",
        "record longer motions, or look for what acts in the machine and is not in the model (diagnosis.effects)",
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
            f"{len(weak)} of {len(names)} base parameters are determined by the robot file rather than by the data: "
            f"{_listed(weak)}",
            "record motions that show them (excitation.fourier plans such), or predict like motions only",
            "doubt" if len(weak) > MANY * len(names) else "remark",
        )


def _unlike(solution: RigidSolution) -> Iterator[Doubt]:
    if solution.asked > WIDENED:
        yield Doubt(
            "tolerance",
            f"bodies differ from the robot file by {solution.asked:.3g} times their stated tolerances",
            "state what is known of them (prior, widen), or look for what acts in the machine and is not in the model",
        )


def _apart(
    equations: RigidEquations, solution: RigidSolution, base: FloatArray, names: Sequence[str]
) -> Iterator[Doubt]:
    shares = solution.experiments
    if len(shares) > 1:
        freedom = float((len(equations.torque) / solution.inflation).min())
        found = disagreement(shares, solution.hessian, solution.covariance, base, freedom)
        yield from disagreement_doubt(found, names, len(shares))


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
