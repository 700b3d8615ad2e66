"""Signs turned at the joints of a coupled arm, in data that pinocchio computes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from oracles.rigid_arm import ARM, loaded, record_of, recording

from robid_acquisition.plausible import slips_of


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("what", ["angle", "torque"])
def test_a_sign_at_the_joint_of_a_coupled_wrist_is_no_sign_of_a_motor(
    tmp_path: Path, axis: int, what: str
) -> None:
    """Motor angles are then a mixture; without its map the torque of j1 was named where the angle was turned."""
    gear = np.array([[0.02, 0, 0], [-0.02, 0.02, 0], [0, 0, -1.0]])
    robot = loaded(tmp_path, {**ARM, "name": "wrist", "coupling": gear.tolist()})
    run = recording(robot, 1, seconds=10.0, noise=0.02).run
    q, tau = (run.values(name)[0, 0, 0, 0] for name in ("motor_position", "motor_torque"))
    sign = np.where(np.arange(3) == axis, -1.0, 1.0)
    if what == "angle":
        q = (q @ gear.T * sign) @ np.linalg.inv(gear).T
    else:
        tau = (tau @ np.linalg.inv(gear) * sign) @ gear
    (slip,) = slips_of(record_of(robot, q, tau), robot)
    assert slip.what == f"the {what} of j{axis + 1} at the joint has the opposite sign"
    assert f"sign: -1 for j{axis + 1} (side: joint)" in slip.remedy
