"""Rotation matrices in robot files; what is none is refused."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from robid_core.robot.file.part import Vector, refusal

Matrix = tuple[Vector, Vector, Vector]
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


Rotation = Annotated[Matrix, AfterValidator(_a_rotation)]
