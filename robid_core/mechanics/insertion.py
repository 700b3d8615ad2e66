"""Joints inserted into a chain: a series behind a joint, an elastic coordinate before a body.

What is inserted stands directly behind its joint in the order of coordinates, so that parents stay before children.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.chain import ABSENT, SHAPES, Chain


def insert_series(chain: Chain, after: str, names: tuple[str, ...], **rows: npt.ArrayLike) -> Chain:
    """Insert joints in series behind a joint: its body stays, its children move behind the last new joint.

    Parameters
    ----------
    chain
        The mechanism.
    after
        Joint behind which the series stands.
    names
        Of the new joints, k of them.
    rows
        Any fields of `Chain` for the new joints, (k, ...), save parent; `modal_mass` is their (k, k) block. Left out:
        revolute, placed on their parent without a turn, no mass, no modes.

    Raises
    ------
    ConfigurationError
        Where the new chain is no mechanism, for example without `axis`.
    """
    return Chain(**_inserted(chain, chain.index(after), names, rows))


def insert_elastic(chain: Chain, after: str, name: str, axis: FloatArray) -> Chain:
    """Insert a revolute coordinate behind a joint; the joint's body moves behind it, with what hangs on it.

    Parameters
    ----------
    chain
        The mechanism.
    after, name, axis
        As in `Chain.with_elastic`.
    """
    joint = chain.index(after)
    if name in chain.names:
        raise ConfigurationError(f"chain: body '{name}': an elastic coordinate needs a name of its own")
    values = _inserted(chain, joint, (name,), {"axis": axis[None]})
    for field in ("mass", "centre_of_mass", "inertia"):
        values[field][joint + 1], values[field][joint] = values[field][joint].copy(), 0.0
    root = values["flexible_root"]
    root[root == joint] = joint + 1  # the modes are those of the body
    return Chain(**values)


def _inserted(
    chain: Chain, joint: int, names: tuple[str, ...], rows: dict[str, npt.ArrayLike]
) -> dict[str, Any]:
    """Fields of the chain with a series inserted behind a joint."""
    k, first = len(names), joint + 1
    kept = np.r_[:first, first + k : chain.n_coordinate + k]
    values: dict[str, Any] = {"names": (*chain.names[:first], *names, *chain.names[first:])}
    for field in SHAPES:
        old = getattr(chain, field)
        if field == "gravity":
            values[field] = old
        elif field == "modal_mass":
            values[field] = np.zeros((len(kept) + k,) * 2)
            values[field][np.ix_(kept, kept)] = old
            values[field][first : first + k, first : first + k] = rows.get(field, 0.0)
        else:
            if field in ("parent", "flexible_root"):
                old = np.where(old > joint, old + k, old)
            absent = np.eye(3) if field == "rotation" else ABSENT.get(field, 0)
            new = np.broadcast_to(np.asarray(rows.get(field, absent), dtype=old.dtype), (k, *old.shape[1:]))
            values[field] = np.concatenate((old[:first], new, old[first:]))
    parent = values["parent"]
    parent[parent == joint] = joint + k
    parent[first : first + k] = np.arange(joint, joint + k)
    return values
