"""The bench of the local rational method agrees with its peer on every line; its rates are printed only."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.full


def test_every_line_agrees_with_the_loop() -> None:
    folder = str(Path(__file__).parent)
    if folder not in sys.path:
        sys.path.append(folder)
    import local_rational

    assert local_rational.largest_differences(200) < 1e-9
