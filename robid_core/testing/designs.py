"""What a choice of experiments owes: weights, whole experiments, and a certificate that goes with its information."""

from __future__ import annotations

import numpy as np

from robid_core.artifacts import Design
from robid_core.testing.broken import ContractBroken

LARGEST_GAP = 1e-3  # of a criterion; the page calls a design beyond it not optimal
ROUNDING = 1e-6


def check_design(name: str, design: Design) -> None:
    """Check one design; ContractBroken says what of its certificate is missing or contradicts the rest."""
    if not np.isfinite(design.gap) or design.gap < 0:
        raise ContractBroken(
            f"{name}: the design has no certificate: its gap is {design.gap}; state by how much another choice "
            f"could be "
            "better at most (equivalence theorem)"
        )
    if design.gap > LARGEST_GAP:
        raise ContractBroken(
            f"{name}: by its own certificate another choice may be {design.gap:.2g} better; at most "
            f"{LARGEST_GAP:g} is no "
            "difference"
        )
    total = float(design.weight.sum())
    if (design.weight < 0).any() or not 0 < total <= 1 + ROUNDING:
        raise ContractBroken(
            f"{name}: weights are shares: none negative, and no more than 1 together (it is {total:.4g})"
        )
    if (design.experiments < 1).any():
        raise ContractBroken(
            f"{name}: a configuration is chosen for {int(design.experiments.min())} experiments"
        )
    if not 0 < design.efficiency <= 1 + ROUNDING:
        raise ContractBroken(
            f"{name}: whole experiments cannot be {design.efficiency:.4g} as good as the relaxed optimum; at most 1"
        )
    if len(design.parameter_names) != len(design.information):
        raise ContractBroken(
            f"{name}: information about {len(design.information)} parameters, and {len(design.parameter_names)} names"
        )
    _check_information(name, design)


def _check_information(name: str, design: Design) -> None:
    """Check that standard errors are promised that follow from the information but for one common factor."""
    information = design.information
    if not np.allclose(information, information.T, rtol=ROUNDING, atol=0.0):
        raise ContractBroken(f"{name}: the information matrix is not symmetric")
    values = np.linalg.eigvalsh(information)
    if not values[0] > 0:
        raise ContractBroken(
            f"{name}: the information matrix is not positive definite (smallest eigenvalue {values[0]:.2g}): some "
            "combination of the parameters is not seen at all"
        )
    promised = design.predicted_standard_error
    if not (np.isfinite(promised).all() and (promised > 0).all()):
        raise ContractBroken(f"{name}: predicted standard errors must be positive numbers, not {promised}")
    ratio = promised / np.sqrt(np.diag(np.linalg.inv(information)))
    if ratio.max() > ratio.min() * (1 + 1e-3):
        row = int(np.argmax(np.abs(np.log(ratio / np.median(ratio)))))
        raise ContractBroken(
            f"{name}: the standard error that is promised for {design.parameter_names[row]} does not follow from the "
            "information matrix as the others do"
        )
