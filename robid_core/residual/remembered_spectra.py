"""Spectra of records that many fits ask for: of those that do not repeat each is transformed once."""

from __future__ import annotations

from collections.abc import Sequence

from robid_core.artifacts import Record
from robid_core.estimation.torque.periodic import PeriodicMotion
from robid_core.estimation.torque.windowed import WindowedMotion
from robid_core.residual.measured import spectra_of


class RememberedSpectra:
    """`spectra_of` some records, of one band and one robot; a motion remembers what was derived from it, too."""

    def __init__(self, records: Sequence[Record]) -> None:
        self.records = tuple(records)
        self._known: dict[int, WindowedMotion] = {}

    def __call__(
        self, record: Record, discard: int, highest_hz: float, sample_time_s: float
    ) -> PeriodicMotion | WindowedMotion:
        """As `spectra_of`: a part of a record, as of a variant, is transformed each time."""
        number = next((i for i, one in enumerate(self.records) if one is record), -1)
        if number in self._known:
            return self._known[number]
        found = spectra_of(record, discard, highest_hz, sample_time_s)
        if number >= 0 and isinstance(found, WindowedMotion):
            self._known[number] = found
        return found
