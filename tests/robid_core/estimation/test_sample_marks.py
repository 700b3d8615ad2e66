"""Records are known again by marks of their samples: whole, in part, beside others, and under another torque."""

from __future__ import annotations

import numpy as np
import pytest

from robid_core import DataRejected, Record
from robid_core.estimation.copies import refuse_copies
from robid_core.estimation.sample_marks import KEPT, have_been_seen, sample_marks

STEP = 0.002
UNITS = {"motor_position": "rad", "motor_torque": "N m"}


def record(position: np.ndarray, torque: np.ndarray | None = None) -> Record:
    torque = np.zeros_like(position) if torque is None else torque
    signals = {"motor_position": position, "motor_torque": torque}
    return Record.from_arrays(
        sample_time_s=STEP, axis_names=("a", "b"), angle=np.zeros((1, 2)), units=UNITS, **signals
    )


def motion(seed: int, n_sample: int = 30000, step: float = 0.0) -> np.ndarray:
    """Two axes with noise of an encoder, or rounded to its steps."""
    draw, time = np.random.default_rng(seed), STEP * np.arange(n_sample)
    angle = np.stack([np.sin(2 * np.pi * f * time) for f in (0.3, 0.7)], axis=1)
    angle = angle + draw.normal(0, 1e-4, angle.shape)
    return np.round(angle / step) * step if step else angle


@pytest.fixture(scope="module")
def marks() -> np.ndarray:
    return sample_marks([record(motion(1)), record(motion(2))])


@pytest.mark.parametrize(("first", "last"), [(0, 30000), (12345, 13345), (29000, 30000)])
def test_any_second_or_two_of_what_was_seen_is_known_again(marks: np.ndarray, first: int, last: int) -> None:
    part = motion(2)[first:last]
    assert have_been_seen([record(part, np.ones_like(part))], marks) is True
    assert len(marks) == KEPT


def test_another_run_of_the_same_motion_is_another(marks: np.ndarray) -> None:
    assert have_been_seen([record(motion(3))], marks) is False
    # Rounded to steps of four times the noise, the same motion shares many samples, and most it does not.
    coarse = sample_marks([record(motion(1, step=4e-4))])
    assert have_been_seen([record(motion(3, step=4e-4))], coarse) is False
    assert have_been_seen([record(motion(1, step=4e-4)[5000:9000])], coarse) is True


def test_too_little_to_tell_is_said_to_be() -> None:
    still = np.zeros((1000, 2))
    assert len(sample_marks([record(still)])) == 0
    assert have_been_seen([record(motion(1))], sample_marks([record(still)])) is None
    assert have_been_seen([record(still)], sample_marks([record(motion(1))])) is None


def test_a_copy_that_was_written_again_is_one() -> None:
    """Some programs write 0 for -0: the same number in other bits."""
    torque = np.random.default_rng(5).choice([-0.5, -0.0, 0.5], (1000, 2))
    first, again = record(motion(4, 1000), torque), record(motion(4, 1000), torque + 0.0)
    with pytest.raises(DataRejected, match="to the last digit"):
        refuse_copies([first, again])
    refuse_copies([first, record(motion(5, 1000), torque)])
