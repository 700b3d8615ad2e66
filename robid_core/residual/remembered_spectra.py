"""Spectra of records that many fits ask for: of those that do not repeat each is transformed once."""

from __future__ import annotations

from collections.abc import Sequence

from robid_core.artifacts import Record
from robid_core.estimation.torque.periodic import PeriodicMotion
from robid_core.estimation.torque.windowed import WindowedMotion
from robid_core.residual.measured import spectra_of


class RememberedSpectra:
    """`spectra_of` some records, of one band and one robot; a motion remembers what was derived from it, too.

    Parameters
    ----------
    records
        Those that are remembered.
    held_s
        For how long a controller that is faster than the recording holds a torque, of which samples are a part; None:
        torques are as their record says.
    """

    def __init__(self, records: Sequence[Record], held_s: float | None = None) -> None:
        self.records, self.held_s = tuple(records), held_s
        self._known: dict[int, WindowedMotion] = {}

    def __call__(
        self, record: Record, discard: int, highest_hz: float, sample_time_s: float
    ) -> PeriodicMotion | WindowedMotion:
        """As `spectra_of`: a part of a record, as of a variant, is transformed each time."""
        number = next((i for i, one in enumerate(self.records) if one is record), -1)
        if number in self._known:
            return self._known[number]
        found = spectra_of(record, discard, highest_hz, sample_time_s)
        found = found if self.held_s is None else found.held_for(self.held_s)
        if number >= 0 and isinstance(found, WindowedMotion):
            self._known[number] = found
        return found
