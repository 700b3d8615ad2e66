"""Poses and Jacobians of many configurations, by `pytorch-kinematics`.

Its chains know fixed, revolute and prismatic joints; what leads from the base to a body is written as one of them, in
double precision (from a URDF it rounds lengths to 24 bits). A mode of a flexible link turns and slides at once, and is
no such joint: there `robid_core.mechanics.pose_of` stays.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import torch  # type: ignore[import-not-found, unused-ignore]

from robid_core import FloatArray
from robid_core.mechanics import PRISMATIC, REVOLUTE, Chain, Pose, pose_of
from robid_torch.trees import tensor

if TYPE_CHECKING:
    import pytorch_kinematics

POINT = "point"


def pose_by_chain(
    chain: Chain,
    position: FloatArray,
    body: str,
    point: npt.ArrayLike,
    device: torch.device,
    memory_bytes: int,
) -> Pose:
    """Pose and Jacobian of a point that is fixed to a body.

    Arguments as of `robid_core.mechanics.pose_of`, and of `TorchDynamics`.
    """
    if not expressible(chain, body):
        return pose_of(chain, position, body, point)
    lineage = lineage_of(chain, body)
    place = tuple(np.asarray(point, dtype=np.float64).tolist())
    serial = _serial_chain(chain, body, place, str(device))
    q = np.asarray(position, dtype=np.float64)
    rows = q.reshape(-1, chain.n_coordinate)
    rotation, end = np.empty((len(rows), 3, 3)), np.empty((len(rows), 3))
    jacobian = np.zeros((len(rows), 6, chain.n_coordinate))
    at_once = max(1, memory_bytes // (FRAME_BYTES * (2 + len(lineage))))
    for start in range(0, len(rows), at_once):
        part = slice(start, start + at_once)
        slopes, pose = serial.jacobian(tensor(rows[part][:, lineage], device), ret_eef_pose=True)
        rotation[part], end[part] = pose[:, :3, :3].cpu().numpy(), pose[:, :3, 3].cpu().numpy()
        whole = slopes.cpu().numpy()
        jacobian[part, :3, lineage] = whole[:, 3:]  # theirs has velocities first
        jacobian[part, 3:, lineage] = whole[:, :3]
    leading = q.shape[:-1]
    return Pose(
        rotation.reshape(*leading, 3, 3),
        end.reshape(*leading, 3),
        jacobian.reshape(*leading, 6, chain.n_coordinate),
    )


FRAME_BYTES = 6 * 16 * 8  # transforms of one frame of one configuration, with what is made on the way


def lineage_of(chain: Chain, body: str) -> list[int]:
    """Return the joints from the base to a body, in order."""
    found = [chain.index(body)]
    while chain.parent[found[0]] >= 0:
        found.insert(0, int(chain.parent[found[0]]))
    return found


def expressible(chain: Chain, body: str) -> bool:
    """Tell whether all joints up to a body are revolute or prismatic."""
    return bool(np.isin(chain.joint_type[lineage_of(chain, body)], (REVOLUTE, PRISMATIC)).all())


@functools.lru_cache(maxsize=64)
def _serial_chain(
    chain: Chain, body: str, point: tuple[float, ...], device: str
) -> pytorch_kinematics.SerialChain:
    """Return the joints up to a body, and a last frame at a point of it; a chain is known by its identity."""
    import pytorch_kinematics  # here, since it loads matplotlib: what takes no pose does not wait for it

    frame, joint = pytorch_kinematics.chain.Frame, pytorch_kinematics.chain.Joint
    transform = pytorch_kinematics.Transform3d

    def placed(rotation: FloatArray, translation: npt.ArrayLike) -> pytorch_kinematics.Transform3d:
        parts = (torch.tensor(np.asarray(part), dtype=torch.float64) for part in (rotation, translation))
        turned, moved = parts
        return transform(rot=turned, pos=moved, dtype=torch.float64)

    root = frame("base", joint=joint("base", dtype=torch.float64))
    last = root
    for j in lineage_of(chain, body):
        name = chain.names[j]
        kind = "prismatic" if chain.joint_type[j] == PRISMATIC else "revolute"
        offset = placed(chain.rotation[j], chain.translation[j])
        axis = torch.tensor(chain.axis[j])
        here = frame(name, joint=joint(name, offset, kind, axis, dtype=torch.float64))
        last.add_child(here)
        last = here
    end = placed(np.eye(3), point)
    last.add_child(frame(POINT, joint=joint(POINT, end, "fixed", dtype=torch.float64)))
    whole = pytorch_kinematics.Chain(root, dtype=torch.float64)
    serial = pytorch_kinematics.SerialChain(whole, POINT, dtype=torch.float64)
    return serial.to(dtype=torch.float64, device=device)
