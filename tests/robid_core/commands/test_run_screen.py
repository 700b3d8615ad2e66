"""Time left, of the present part of a stage alone, and what long work has found so far."""

from __future__ import annotations

import logging

import pytest

from robid_core import MILESTONE
from robid_core.commands import run_screen
from robid_core.commands.run_screen import Part, listening


@pytest.mark.parametrize("on_terminal", [False, True])
def test_what_a_stage_has_found_or_warns_of_is_shown_when_it_is_logged(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, on_terminal: bool
) -> None:
    monkeypatch.setattr(run_screen, "on_terminal", lambda: on_terminal)
    log = logging.getLogger("robid.explain")
    monkeypatch.setattr(logging.getLogger("robid"), "level", logging.DEBUG)
    with listening(quiet=False, verbose=False):
        log.log(MILESTONE, "named %s", "friction.lugre at axis_2")
        assert "explain: named friction.lugre at axis_2" in capsys.readouterr().err
        log.info("not named")
        for number in range(2):
            log.warning("the torque of axis_1 is 1e-3 times what the robot makes, run %d", number)
        shown = capsys.readouterr().err
        assert shown.count("! explain: the torque of axis_1 is 1e-3 times") == 1
    with listening(quiet=True, verbose=False):
        log.log(MILESTONE, "named")
    log.log(MILESTONE, "nobody listens")
    assert "named" not in capsys.readouterr().err


def test_with_the_whole_log_nothing_is_shown_twice(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(logging.getLogger("robid"), "level", logging.DEBUG)
    with listening(quiet=False, verbose=True):
        logging.getLogger("robid.explain").log(MILESTONE, "named")
    assert capsys.readouterr().err.count("named") == 1


def test_time_left_is_that_of_the_present_part() -> None:
    """Forty effects at a second each, then six motions at ten seconds each: neither pace tells of the other."""
    part = Part(100.0)
    assert part.seconds_left(100.0, 0, 40) is None
    assert part.seconds_left(110.0, 10, 40) == pytest.approx(30.0)
    assert part.seconds_left(140.0, 1, 6) is None
    assert part.seconds_left(150.0, 2, 6) == pytest.approx(40.0)
    assert part.seconds_left(300.0, 1, 6) is None
