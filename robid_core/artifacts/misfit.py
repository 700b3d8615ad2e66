"""Where a model misfits: per axis and band, on the excited lines and in the bins between them.

Apart, because causes show apart: friction and ripple live between the lines, springs on them (a gear that is loaded
shows below 3 Hz on its own axis only, a stiffening one at the resonance, backlash in between).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.evidence_tables import misfit_rows
from robid_core.artifacts.tables import Table
from robid_core.errors import DataRejected


@dataclass(frozen=True, eq=False)
class MisfitTable(Artifact):
    """Misfit per degree of freedom (1 where the model is right) by axis and band; NaN where a band has no such bin.

    Band b reaches from `band_edges_hz[b]` to `band_edges_hz[b + 1]`; `lines` is of the excited lines, `other` of all
    other bins. `line_freedom` and `other_freedom` are the degrees of freedom of each, where they are known.

    >>> import numpy as np, robid_core as robid
    >>> misfit = robid.MisfitTable(("axis_1",), np.array([0.0, 3.0, 10.0]), np.array([[1.1, 4.0]]), np.ones((1, 2)))
    >>> misfit.band_names
    ('below 3 Hz', '3-10 Hz')
    """

    axis_names: tuple[str, ...]
    band_edges_hz: FloatArray = array("n_edge", "Hz")
    lines: FloatArray = array("n_axis n_band", finite=False)
    other: FloatArray = array("n_axis n_band", finite=False)
    line_freedom: FloatArray | None = array("n_axis n_band", optional=True, least=0.0)
    other_freedom: FloatArray | None = array("n_axis n_band", optional=True, least=0.0)

    def __post_init__(self) -> None:
        """Check that axes and bands are as many as the rows and columns."""
        super().__post_init__()
        if self.lines.shape != (len(self.axis_names), len(self.band_edges_hz) - 1):
            raise DataRejected(
                f"{self.place('lines')}: shape {self.lines.shape}, but there are {len(self.axis_names)} axes and "
                f"{len(self.band_edges_hz)} edges of bands; n bands have n + 1 edges"
            )
        if not (np.diff(self.band_edges_hz) > 0).all():
            raise DataRejected(f"{self.place('band_edges_hz')}: {self.band_edges_hz} do not rise")

    @property
    def band_names(self) -> tuple[str, ...]:
        """The bands in words: `below 3 Hz`, `3-10 Hz`."""
        pairs = zip(self.band_edges_hz[:-1].tolist(), self.band_edges_hz[1:].tolist(), strict=True)
        return tuple(f"{low:.3g}-{high:.3g} Hz" if low > 0 else f"below {high:.3g} Hz" for low, high in pairs)

    def table(self) -> Table:
        """Return a row for each axis and band: misfit on the excited lines and in the other bins.

        >>> import numpy as np, robid_core as robid
        >>> misfit = robid.MisfitTable(("axis_1",), np.array([0.0, 3.0, 10.0]), np.array([[1.1, 4.0]]), np.ones((1, 2)))
        >>> misfit.table()["band"], misfit.table()["lines"]
        (['below 3 Hz', '3-10 Hz'], [1.1, 4.0])
        """
        return misfit_rows(self)

    def worst(self, above: float, most: int = 3) -> tuple[str, ...]:
        """Say where the misfit is largest, the worst first.

        >>> import numpy as np, robid_core as robid
        >>> misfit = robid.MisfitTable(("axis_1",), np.array([0.0, 3.0, 10.0]), np.array([[1.1, 4.0]]), np.ones((1, 2)))
        >>> misfit.worst(above=2.0)
        ('4 on axis_1 at 3-10 Hz (lines)',)
        """
        found = [
            (float(values[axis, band]), f"on {name} {where if 'below' in where else f'at {where}'} ({bins})")
            for values, bins in ((self.lines, "lines"), (self.other, "other bins"))
            for axis, name in enumerate(self.axis_names)
            for band, where in enumerate(self.band_names)
            if values[axis, band] > above
        ]
        found.sort(key=lambda entry: -entry[0])
        return tuple(f"{value:.3g} {place}" for value, place in found[:most])
