"""Time left: of the present part of a stage alone, since fits and searches take turns."""

from __future__ import annotations

import pytest

from robid_core.commands.run_screen import Part


def test_time_left_is_that_of_the_present_part() -> None:
    """Forty effects at a second each, then six motions at ten seconds each: neither pace tells of the other."""
    part = Part(100.0)
    assert part.seconds_left(100.0, 0, 40) is None
    assert part.seconds_left(110.0, 10, 40) == pytest.approx(30.0)
    assert part.seconds_left(140.0, 1, 6) is None
    assert part.seconds_left(150.0, 2, 6) == pytest.approx(40.0)
    assert part.seconds_left(300.0, 1, 6) is None
