"""Some of the experiments of a dense array as a dense array again: configurations x blocks x experiments."""

from __future__ import annotations

import numpy as np

from robid_core.arrays import BoolArray, IntArray
from robid_core.errors import DataRejected


def packed(kept: BoolArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the index of the kept experiments, closed up in their order.

    Parameters
    ----------
    kept
        Which experiments are kept, shape (n_config, n_block, n_exp). A block of which none is kept goes, a
        configuration without blocks too; block numbers of different configurations mean nothing to one another.

    Returns
    -------
    (configuration, block, experiment) of shapes (k, 1, 1), (k, m, 1) and (k, m, e), so that ``values[index]`` has
    the shape (k, m, e, ...).

    Raises
    ------
    DataRejected
        If nothing is kept, or unequal numbers of blocks or experiments.
    """
    configurations = np.flatnonzero(kept.any(axis=(1, 2)))
    if not len(configurations):
        raise DataRejected(
            "no experiment of the record is left: all are held out for tests; set one to train"
        )
    counts = {(int(c), int(b)): int(kept[c, b].sum()) for c, b in np.argwhere(kept.any(axis=2))}
    sizes = {c: [n for (i, _), n in counts.items() if i == c] for c in configurations.tolist()}
    first = sizes[int(configurations[0])]
    odd = next((c for c, found in sizes.items() if found != first or len(set(found)) > 1), None)
    if odd is not None:
        raise DataRejected(
            f"the experiments of the record that are left have no common shape: configuration {configurations[0] + 1} "
            f"keeps blocks of {_listed(first)} experiments, configuration {odd + 1} of {_listed(sizes[odd])}; hold out "
            "whole configurations, or equally many blocks of each"
        )
    block = np.array([np.flatnonzero(kept[c].any(axis=1)) for c in configurations])
    experiment = np.array(
        [[np.flatnonzero(kept[c, b]) for b in row] for c, row in zip(configurations, block, strict=True)]
    )
    return configurations[:, None, None], block[:, :, None], experiment


def _listed(sizes: list[int]) -> str:
    return " and ".join(str(size) for size in sizes)
