"""Which experiments a model never repeats, by what two periods differ by from round to round, in noise."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core.residual.periodic_block import _never_repeats


@pytest.mark.parametrize(
    ("changes", "never"),
    [
        ([9.0, 4.0, 14.0, 11.0], True),  # rattles
        ([9.0, 8.5, 8.0, 7.5], False),  # rings out, slowly
        ([0.9, 0.2, 0.8, 0.7], False),  # within the noise
        ([9.0, 4.0, 0.5, 0.7], False),  # has come to rest
        ([90.0, 0.2, 14.0, 11.0], False),  # once it repeated
        ([9.0, 4.0, 14.0], False),  # not long enough to tell
        ([0.1, 9.0, 4.0, 14.0, 11.0], True),  # only the last rounds count
    ],
)
def test_what_neither_vanishes_nor_shrinks_never_repeats(changes: list[float], never: bool) -> None:
    rounds = [np.array([[0.01, one]]) for one in changes]
    np.testing.assert_array_equal(_never_repeats(rounds), [[False, never]])
