"""Long recordings in parts: what one motion tells must hold in parts of it that were held out."""

from __future__ import annotations

import numpy as np

from robid_core import DataRejected, DenseRun, Record, frozen


def cut_into_parts(record: Record, n_part: int, skip_s: float = 0.0) -> Record:
    """Return a record that does not repeat with each experiment cut into parts of equal length, experiments themselves.

    Parameters
    ----------
    record
        Of one length; with one part and nothing to skip it is returned as it is.
    n_part
        Of each experiment; what does not fill a sample of each is left out at the end.
    skip_s
        Left out at the beginning of each experiment.

    Raises
    ------
    DataRejected
        Where the record has periods, which would be torn apart, or is too short.
    """
    if n_part == 1 and not skip_s:
        return record
    run = record.run
    if record.line is not None or run.n_period > 1:
        raise DataRejected(
            "blocks: a record of periods stays whole; leave blocks and skip_s away, or read one long motion without "
            "periods (period_s: null)"
        )
    first = round(skip_s / run.sample_time_s)
    length = (len(run.time_s) - first) // n_part
    if length < 2:
        raise DataRejected(
            f"blocks: an experiment of {len(run.time_s)} samples cannot be cut into {n_part} after {skip_s:g} s"
        )
    return record.replace(runs=(_cut(run, n_part, first, length),))


def _cut(run: DenseRun, n_part: int, first: int, length: int) -> DenseRun:
    kept = slice(first, first + n_part * length)
    n_config, n_block, n_exp = run.valid.shape[:3]
    shape = (n_config, n_block, n_exp * n_part, 1, length)

    def repeated(values: np.ndarray) -> np.ndarray:
        return np.repeat(values, n_part, axis=2)

    return run.replace(
        channels={
            name: channel.replace(values=frozen(channel.values[:, :, :, :, kept].reshape(*shape, -1)))
            for name, channel in run.channels.items()
        },
        time_s=run.time_s[:length],
        valid=run.valid[..., kept].reshape(shape),
        test=None if run.test is None else repeated(run.test),
        constants=None if run.constants is None else repeated(run.constants),
    )
