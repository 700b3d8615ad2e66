"""The study of what can be seen and confused: shares of laws that others cannot do, against geometry; quotients."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).parents[2]))
from studies.hidden_effects import pairs, strengths

X, Y, Z, W = np.eye(4)
FITTED = W[:, None]  # what the fit does by itself


def shares(columns: dict[str, list[np.ndarray]]) -> dict[tuple[str, str], float]:
    return {(law, rival): share for law, rival, share in pairs._shares(FITTED, columns, 1e-4)}


def test_what_a_rival_leaves_is_the_square_of_the_sine_between_both_beside_the_fit() -> None:
    """Thirty degrees in the plane that the fit does not have; what it has turns nothing."""
    turned = np.cos(np.pi / 6) * X + np.sin(np.pi / 6) * Y + 5 * W
    found = shares({"law": [X[None]], "rival": [turned[None]], "apart": [Z[None]]})
    assert found["law", "rival"] == pytest.approx(0.25)
    assert found["rival", "law"] == pytest.approx(0.25)
    assert found["law", "apart"] == pytest.approx(1.0)


def test_a_special_case_is_taken_for_the_law_that_holds_it_and_not_the_other_way() -> None:
    """The rival's best value counts, and of the law the size that the rival does worst."""
    found = shares({"special": [X[None]], "general": [np.stack([X, Y])], "elsewhere": [Y[None], X[None]]})
    assert found["special", "general"] == pytest.approx(0.0, abs=1e-12)
    assert found["general", "special"] == pytest.approx(1.0)
    assert found["special", "elsewhere"] == pytest.approx(0.0, abs=1e-12)


def test_of_a_law_that_the_fit_does_by_itself_nothing_is_said() -> None:
    assert shares({"hidden": [(W + 1e-3 * X)[None]], "law": [X[None]]}).keys() == {("law", "hidden")}


def test_the_table_tells_the_median_over_axes_for_each_excitation() -> None:
    table = [
        {"excitation": name, "effect": "law", "side": "gear", "ratio": f"{ratio}"}
        for name, ratio in (("multisine", 1.0), ("fifth", 0.04), ("fifth", 0.9), ("fifth", 0.05))
    ]
    head, line = strengths.report(table)
    assert head.split()[-2:] == ["multisine", "fifth"]
    assert line.split()[-2:] == ["1", "0.05"]
