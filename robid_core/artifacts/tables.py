"""Results as tables: columns by name, each a list, which `pandas.DataFrame(table)` and csv writers take as they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from robid_core.artifacts.configurations import Configurations
    from robid_core.artifacts.finding import Finding
    from robid_core.artifacts.fit import ParameterTable, TimeComparison
    from robid_core.artifacts.frf import Frf
    from robid_core.artifacts.record import Record

MOST_ROWS = 30  # that a notebook shows


class Table(dict[str, list[Any]]):
    """Columns by name, of one length, in order.

    Examples
    --------
    >>> from robid_core import Table
    >>> table = Table(name=["spring", "damper"], value=[2.0, 0.1])
    >>> list(table.rows())
    [{'name': 'spring', 'value': 2.0}, {'name': 'damper', 'value': 0.1}]
    """

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield each row, by column."""
        for row in zip(*self.values(), strict=True):
            yield dict(zip(self, row, strict=True))

    def _repr_html_(self) -> str:
        """Return the first rows as HTML, for notebooks."""
        n_row = len(next(iter(self.values()), []))
        head = "".join(f"<th>{escape(name)}</th>" for name in self)
        body = "".join(
            "<tr>" + "".join(_cell(column[index]) for column in self.values()) + "</tr>"
            for index in range(min(n_row, MOST_ROWS))
        )
        more = f"<p>{n_row - MOST_ROWS} more rows</p>" if n_row > MOST_ROWS else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def _cell(value: Any) -> str:
    if isinstance(value, float):
        shown = "–" if np.isnan(value) else f"{value:.5g}"
        return f'<td style="text-align:right">{shown}</td>'
    if isinstance(value, bool):
        return f"<td>{'yes' if value else 'no'}</td>"
    return f'<td style="text-align:left">{escape(str(value))}</td>'


def parameter_table(table: ParameterTable, everything: bool) -> Table:
    """Return named parameters, the reported rows or all."""
    shown = np.full(len(table.names), True) if everything else table.reported
    kept = np.flatnonzero(shown).tolist()
    columns = Table(
        parameter=[table.names[i] for i in kept],
        unit=[table.units[i] for i in kept],
        group=[table.groups[i] for i in kept],
    )
    for name in ("start", "estimate", "standard_error", "at_bound"):
        columns[name] = getattr(table, name)[kept].tolist()
    for name in ("prior", "spread"):
        if (more := getattr(table, name)) is not None:
            columns[name] = more[kept].tolist()
    return columns


def response_table(frf: Frf) -> Table:
    """Return a row for each entry of the matrix at each usable line."""
    deviation = np.sqrt(frf.variance()) if frf.has_covariance else np.full(frf.response.shape, np.nan)
    usable = np.broadcast_to(frf.valid_lines[..., None, None], frf.response.shape)
    config, line, out, into = (index.tolist() for index in np.nonzero(usable))
    entries = frf.response[usable]
    return Table(
        configuration=config,
        frequency_hz=frf.frequency_hz[line].tolist(),
        output=[frf.axis_names[i] for i in out],
        input=[frf.axis_names[i] for i in into],
        real=entries.real.tolist(),
        imaginary=entries.imag.tolist(),
        size=np.abs(entries).tolist(),
        phase_deg=np.degrees(np.angle(entries)).tolist(),
        deviation=deviation[usable].tolist(),
    )


def record_table(record: Record, configuration: int, block: int, experiment: int) -> Table:
    """Return the samples of one experiment, its periods one after another."""
    run = record.run
    n_period, n_sample = run.valid.shape[3:]
    period_s = n_sample * run.sample_time_s
    time_s = np.add.outer(np.arange(n_period) * period_s, run.time_s)
    table = Table(time_s=time_s.ravel().tolist())
    for name in run.channels:
        values = run.values(name)[configuration, block, experiment].reshape(n_period * n_sample, -1)
        for axis, column in zip(record.axis_names, values.T, strict=True):
            table[f"{name}.{axis}"] = column.tolist()
    return table


def configuration_table(configurations: Configurations) -> Table:
    """Return a row for each configuration: motor angles seen through the gear, rad."""
    table = Table(configuration=list(range(configurations.n_config)))
    for axis, column in zip(configurations.axis_names, configurations.angle.T, strict=True):
        table[axis] = column.tolist()
    return table


def finding_table(findings: Iterable[Finding]) -> Table:
    """Return a row for each number of each finding, in their order."""
    rows = [
        (one.kind, one.effect, one.where, name, unit, nominal, value, error, one.gain, one.p_value)
        for one in findings
        for name, unit, nominal, value, error in zip(
            one.names or ("",),
            one.units or ("",),
            one.nominal.tolist() or (float("nan"),),
            one.value.tolist() or (float("nan"),),
            one.standard_error.tolist() or (float("nan"),),
            strict=True,
        )
    ]
    names = (
        "kind",
        "effect",
        "where",
        "parameter",
        "unit",
        "nominal",
        "value",
        "standard_error",
        "gain",
        "p_value",
    )
    return Table({name: [row[column] for row in rows] for column, name in enumerate(names)})


def comparison_table(comparison: TimeComparison) -> Table:
    """Return a row for each sample: time, measured and modelled values of each axis."""
    table = Table(time_s=comparison.time_s.tolist())
    for axis, name in enumerate(comparison.axis_names):
        table[f"measured.{name}"] = comparison.measured[:, axis].tolist()
        table[f"modelled.{name}"] = comparison.modelled[:, axis].tolist()
    return table
