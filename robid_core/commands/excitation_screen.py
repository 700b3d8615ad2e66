"""What an excitation will do to the robot and to the measurement, as text for people: `robid plan` and `robid show`.

Every number is a field of the artifact, from the simulation that cleared it. The worst configuration counts: for
peaks the largest, for the multisine's torque the smallest; shares of time and deviations are medians over the
configurations, the worst line is the worst of all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from robid_core.artifacts import Excitation

WEAK = 0.5  # relative standard deviation: 6 dB, below which averages of logarithms are biased
STANDSTILL = (
    0.1  # share of the time; a sine alone stays below it from an amplitude of 6.4 standstill speeds on
)


def advice_lines(excitation: Excitation) -> list[str]:
    """Tables of motion and response, the time, and warnings that begin with '!'; nothing where nothing is predicted."""
    if excitation.predicted_torque is None:
        return []
    many = excitation.n_config
    of = "" if many == 1 else f", worst of {many} configurations"
    count = excitation.simulated_experiments
    rests_on = f"{count} simulated experiments" if count > 1 else "a simulated experiment"
    return [
        f"predicted by {rests_on} of the nominal robot{of}:",
        *_aligned(motion_rows(excitation)),
        *_aligned(response_rows(excitation)),
        *notes(excitation),
        time_line(excitation),
        *(f"! {warning}" for warning in warnings(excitation)),
    ]


def motion_rows(excitation: Excitation) -> list[list[str]]:
    """Torque, load, travel and speed: a heading, its units, and a row for each axis."""
    e, n_axis = excitation, len(excitation.axis_names)
    columns = [("axis", "", list(e.axis_names))]

    def add(head: str, unit: str, values: object, form: str = ".3g") -> None:
        if values is not None:
            numbers = np.broadcast_to(np.asarray(values, dtype=float), n_axis)
            columns.append((head, unit, [format(number, form) for number in numbers]))

    add("torque", "peak N m", _largest(e.predicted_torque))
    add("", "limit", e.torque_limit)
    band = "excited" if len(e.line) else "changing"
    add(band, "rms N m", None if e.predicted_torque_rms is None else e.predicted_torque_rms.min(axis=0))
    add("friction", "N m", _largest(e.friction_torque))
    load = _largest(e.predicted_gear_load)
    add("gear load", "peak N m", load, ".4g")
    if load is not None and e.motor_gear_load is not None:
        add("", "of motor's", load / e.motor_gear_load, ".0%")
    add("travel", "rad", _largest(e.predicted_travel))
    add("speed", "peak rad/s", _largest(e.predicted_speed))
    if e.quantile is not None and e.predicted_speed_quantile is not None:
        middle = np.median(e.predicted_speed_quantile, axis=0)
        for probability, values in zip(e.quantile, middle, strict=True):
            add("", f"{probability:.0%}", values)
    if e.predicted_standstill is not None:
        add("near", "standstill", np.median(e.predicted_standstill, axis=0), ".1%")
    return [list(row) for row in zip(*([head, unit, *cells] for head, unit, cells in columns), strict=True)]


def response_rows(excitation: Excitation) -> list[list[str]]:
    """Standard deviation of the response: a heading and a row for each axis; nothing where none is predicted."""
    total, noise = excitation.predicted_deviation, excitation.predicted_noise_deviation
    if total is None or noise is None or not np.isfinite(total).any():
        return []
    rows = [["response", "std median", "noise alone", "largest", "at Hz", f"lines above {WEAK:.0%}"]]
    for axis, name in enumerate(excitation.axis_names):
        values = total[:, :, axis]
        worst = int(np.nanargmax(np.nan_to_num(values, nan=-1.0).max(axis=0)))
        rows.append(
            [
                name,
                f"{np.nanmedian(values):.2%}",
                f"{np.nanmedian(noise[:, :, axis]):.2%}",
                f"{np.nanmax(values):.3g}" if np.nanmax(values) > 1 else f"{np.nanmax(values):.1%}",
                f"{excitation.frequency_hz[worst]:.4g}",
                f"{int((np.nan_to_num(values).max(axis=0) > WEAK).sum())} of {values.shape[1]}",
            ]
        )
    return rows


def notes(excitation: Excitation) -> list[str]:
    """How the numbers are meant."""
    lines = []
    if excitation.motor_gear_load is not None:
        lines.append(
            "gear load at the joint, beside what the motor's torque limit would pass; the gear's own limit is in its "
            "data sheet"
        )
    if excitation.predicted_deviation is not None:
        lines.append(
            "std: relative standard deviation of the response's diagonal by H1 from all experiments, one period each; "
            f"largest of all lines, and how many lines have more than {WEAK:.0%}"
        )
    elif len(excitation.line):
        lines.append(
            "no std of the response: fewer experiments than axes give none by averages; local methods may"
        )
    return lines


def time_line(excitation: Excitation) -> str:
    """Return the experiment time."""
    n_block, n_exp = excitation.reference.shape[1:3]
    counts = [(excitation.n_config, "configuration"), (n_block, "block"), (n_exp, "experiment")]
    product = " x ".join(f"{count} {noun}{'' if count == 1 else 's'}" for count, noun in counts)
    return (
        f"experiment time: {product} x {excitation.period_s:g} s = {excitation.experiment_time_s:g} s with one period "
        "each; settling and further periods come on top"
    )


def warnings(excitation: Excitation) -> list[str]:
    """What a person should look at before the robot moves."""
    e, found = excitation, list[str]()
    if not len(e.line):
        return found
    if e.predicted_torque_rms is not None and e.friction_torque is not None:
        weak = np.any(e.predicted_torque_rms < e.friction_torque, axis=0)
        if weak.any():
            found.append(
                f"{_names(e, weak)}: the torque in the excited band is below the friction level; motors stick "
                "when they turn back, and the robot looks heavier than it is: more amplitude, or fewer lines"
            )
    if e.predicted_standstill is not None and e.standstill_speed is not None:
        share = np.median(e.predicted_standstill, axis=0)
        slow = np.asarray(share > STANDSTILL)
        if slow.any():
            cure = "a slow sine" if e.slow_sine_bin == 0 else "a faster slow sine"
            found.append(
                f"{_names(e, slow)}: {share[slow].max():.0%} of the time below "
                f"{e.standstill_speed[slow].max():g} rad/s, where friction is no slope; {cure} keeps the motors moving"
            )
    if e.predicted_deviation is not None and e.predicted_noise_deviation is not None:
        for axis, name in enumerate(e.axis_names):
            total, noise = e.predicted_deviation[:, :, axis], e.predicted_noise_deviation[:, :, axis]
            poor = np.nan_to_num(total) > WEAK
            if poor.any():
                noisy = float(np.median(noise[poor] / total[poor])) > 0.7  # half of the variance
                cure = "noise: more periods" if noisy else "distortion: more blocks"
                where = e.frequency_hz[poor.any(axis=0)]
                lines = f"{len(where)} lines from {where.min():.4g} to {where.max():.4g} Hz are"
                found.append(
                    f"{name}: {lines if len(where) > 1 else f'the line at {where[0]:.4g} Hz is'} weaker than twice the "
                    f"scatter, mostly {cure}, or more amplitude"
                )
    return found


def _names(excitation: Excitation, which: npt.NDArray[np.bool_]) -> str:
    return ", ".join(excitation.axis_names[axis] for axis in np.flatnonzero(which))


def _largest(values: npt.NDArray[np.float64] | None) -> npt.NDArray[np.float64] | None:
    return None if values is None else np.asarray(values.max(axis=0))


def _aligned(rows: list[list[str]]) -> list[str]:
    if not rows:
        return []
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        "  "
        + "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
