"""What was recorded, over time: `robid.plot.record(record)`, a row for each axis, a column for each channel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robid_core.arrays import BoolArray, FloatArray, IntArray
from robid_core.artifacts import DenseRun, Record
from robid_core.artifacts.record import MOTOR_POSITION, MOTOR_TORQUE
from robid_core.errors import ConfigurationError
from robid_core.plot.arguments import axis_number, check_kind, check_number
from robid_core.plot.rounding import rounded_to
from robid_core.plot.style import MEASURED, axis, heading_over, layout, plain, shown, title
from robid_core.plot.traces import kept_samples

SHOWN = (MOTOR_POSITION, "motor_speed", MOTOR_TORQUE)  # of the channels, where nothing is asked for
ROW = 170  # pixels


def record(
    record: Record,
    axis: str | None = None,
    *,
    channels: Sequence[str] = (),
    configuration: int = 0,
    block: int = 0,
    experiment: int = 0,
    run: int = 0,
) -> Any:
    """Return a figure of the channels of one experiment over time, its periods one after another.

    Parameters
    ----------
    record
        What was recorded.
    axis
        Name of the axis; by default all, a row each.
    channels
        Names; by default the motors' angle, speed and torque, those that were recorded.
    configuration, block, experiment, run
        Counted from zero.

    Raises
    ------
    ConfigurationError
        Where there is no such axis, channel or experiment.

    Examples
    --------
    >>> import robid_core as robid
    >>> from robid_core.testing import example_record
    >>> figure = robid.plot.record(example_record(robid.Robot.load("one_axis")))
    >>> [trace.name for trace in figure.data], figure.layout.yaxis2.title.text
    (['motor_position of axis_1', 'motor_torque of axis_1'], 'N m')
    """
    check_kind("record: record", record, Record)
    check_number("run", run, len(record.runs))
    chosen = record.runs[run]
    counts = zip(("configuration", "block", "experiment"), chosen.valid.shape[:3], strict=True)
    at = (configuration, block, experiment)
    for (what, count), number in zip(counts, at, strict=True):
        check_number(what, number, count)
    names = list(channels) or [one for one in SHOWN if one in chosen.channels] or list(chosen.channels)
    for name in names:
        if name not in chosen.channels:
            known = ", ".join(chosen.channels)
            raise ConfigurationError(f"there is no channel '{name}'; there are: {known}")
    places = range(len(record.axis_names)) if axis is None else [axis_number(record.axis_names, axis)]
    return shown(_figure(record, chosen, at, list(places), names))


def _figure(
    record: Record, run: DenseRun, at: tuple[int, int, int], places: Sequence[int], names: Sequence[str]
) -> dict[str, Any]:
    """Return rows of axes and columns of channels."""
    n_row, n_column = len(places), len(names)
    gap_x, gap_y = 0.08, 0.3 / n_row if n_row > 1 else 0.0
    width, tall = (1 - gap_x * (n_column - 1)) / n_column, (1 - gap_y * (n_row - 1)) / n_row
    found: dict[str, Any] = {"data": [], "layout": layout(60 + ROW * n_row, 56, 24, 38, annotations=[])}
    n_period, n_sample = run.valid.shape[3:]
    time = np.add.outer(np.arange(n_period) * n_sample * run.sample_time_s, run.time_s).ravel()
    for row, place in enumerate(places):
        for column, name in enumerate(names):
            number = row * n_column + column + 1
            suffix = "" if number == 1 else str(number)
            left, bottom = column * (width + gap_x), 1 - (row + 1) * tall - row * gap_y
            channel = run.channels[name]
            values = np.where(run.valid[at], channel.values[at][..., place], np.nan).ravel()
            told, unit = f"{name} of {record.axis_names[place]}", plain(channel.unit_symbol)
            found["data"].append(_trace(time, values, told, unit, suffix))
            span = [round(left, 4), round(min(left + width, 1.0), 4)]
            top = round(min(bottom + tall, 1.0), 4)
            under = {"title": title("s")} if row == n_row - 1 else {}
            found["layout"][f"xaxis{suffix}"] = axis(domain=span, anchor=f"y{suffix}", **under)
            found["layout"][f"yaxis{suffix}"] = axis(
                domain=[round(max(bottom, 0.0), 4), top],
                anchor=f"x{suffix}",
                title=title(channel.unit_symbol),
            )
            found["layout"]["annotations"].append(heading_over(told, span[0], top))
    return found


def _trace(time: FloatArray, values: FloatArray, name: str, unit: str, suffix: str) -> dict[str, Any]:
    """Return a line that is broken where samples are missing."""
    kept = _drawn(values)
    return {
        "x": rounded_to(time[kept], 6),
        "y": rounded_to(values[kept], 6),
        "mode": "lines",
        "name": name,
        "line": {"color": MEASURED, "width": 1.2},
        "hovertemplate": "%{x:.4g} s, %{y:.5g} " + unit + "<extra>" + plain(name) + "</extra>",
        "xaxis": f"x{suffix}",
        "yaxis": f"y{suffix}",
    }


def _drawn(values: FloatArray) -> IntArray:
    """Return the samples worth drawing, one of each gap among them."""
    missing: BoolArray = np.isnan(values)
    if missing.all():
        return np.arange(len(values))[:1]
    kept = kept_samples(np.where(missing, values[~missing].mean(), values))
    begins = np.flatnonzero(missing & ~np.concatenate(([False], missing[:-1])))
    return np.union1d(kept, begins)
