"""What a failed operation on a file advises."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from robid_core.errors import StoreError
from robid_core.store.files import failures_named


@pytest.mark.parametrize(("doing", "right"), [("read", "to read it"), ("write", "to write there")])
def test_the_right_that_lacks_is_that_of_the_operation(doing: str, right: str) -> None:
    with (
        pytest.raises(
            StoreError, match=f"cannot {doing} a.csv.*give yourself the right {right} and run again"
        ),
        failures_named(doing, Path("a.csv")),
    ):
        raise PermissionError(errno.EACCES, "Permission denied")
