"""Rotation matrices in robot files; what is none is refused."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator

from robid_core.robot.file.part import Vector, refusal

Matrix = tuple[Vector, Vector, Vector]
_QUARTER_TURN = "[[0, 0, 1], [0, 1, 0], [-1, 0, 0]]"
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
UNIT_TOLERANCE = (
    1e-6  # as in mechanics.chain_check: what a text with seven digits leaves of lengths and rotations
)


def _a_rotation(rows: Matrix) -> Matrix:
    rotation = np.clip(rows, -2.0, 2.0)  # what is beyond is no rotation, and must not overflow
    deviation = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if deviation > UNIT_TOLERANCE:
        raise refusal(f"the rows are not orthonormal (off by {deviation:.3g}); give a rotation matrix")
    if np.linalg.det(rotation) < 0:
        raise refusal("the matrix mirrors (its determinant is -1); give a right-handed rotation matrix")
    return rows


def _no_angles(value: Any) -> Any:
    if isinstance(value, tuple) and value and not any(isinstance(row, tuple) for row in value):
        raise refusal(
            f"{len(value)} entries, and three rows of a matrix are wanted, no angles: a turn by 90 degrees about y is "
            f"{_QUARTER_TURN}"
        )
    return value


Rotation = Annotated[Matrix, AfterValidator(_a_rotation), BeforeValidator(_no_angles)]
