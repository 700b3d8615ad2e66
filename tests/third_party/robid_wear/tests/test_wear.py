"""What a plugin's author writes: the contract, and that the two ways of writing one law are one law."""

import numpy as np
import pytest
from robid_wear import Wear, WearOnLanes

from robid_core.testing import check_effect, example_place


def test_the_law_with_branches_keeps_the_contract_and_is_told_to_be_slower() -> None:
    with pytest.warns(UserWarning, match="Wear: its law runs lane after lane"):
        check_effect(Wear)


@pytest.mark.filterwarnings("error")
def test_the_law_for_lanes_keeps_the_contract() -> None:
    check_effect(WearOnLanes)


def test_both_are_the_same() -> None:
    place, one, other = example_place("motor"), np.zeros(1), np.zeros(1)
    parameters = Wear.arguments(Wear.defaults(), place)
    for velocity in (-3.0, -0.2, 0.0, 0.3, 8.0):
        for path in (0.0, 1.5, 7.0):
            given = (0.0, velocity, 0.0, np.array([path]))
            first = Wear.law(*given, one, parameters, 1e-2)
            assert first == pytest.approx(WearOnLanes.law(*given, other, parameters, 1e-2), rel=1e-14)
            assert one[0] == other[0]
