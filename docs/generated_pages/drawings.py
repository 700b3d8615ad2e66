"""Charts of what stages make: one function for each kind of result, one row of charts each."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from generated_pages.chart import Curve, chart, row_of
from robid_core import (
    Configurations,
    Design,
    Diagnosis,
    Excitation,
    Fit,
    Frf,
    FrictionCurve,
    Record,
    TimeComparison,
    plot,
)

WIDE = (480, 260)
HERTZ = "frequency, Hz"
MOST_POINTS = 600

Array = npt.NDArray[np.float64]


def excitation(made: Excitation, caption: str, seen_s: float = 2.0) -> list[str]:
    """Reference of one experiment over time, and its spectrum where it repeats."""
    reference = made.reference[0, 0, 0, :, 0]
    shown = min(len(reference), round(seen_s / made.sample_time_s))
    seen = slice(0, shown, max(1, shown // MOST_POINTS))
    time = made.sample_time_s * np.arange(len(reference))
    title = f"The first {seen_s:g} seconds" if len(made.line) else "An experiment"
    charts = [
        chart(title, "time, s", "speed reference, rad/s", [Curve(time[seen], reference[seen])], size=WIDE)
    ]
    if len(made.line):
        charts.append(_spectrum(reference, made.sample_time_s, made.line))
    return row_of(charts, caption)


def _spectrum(reference: Array, step: float, line: npt.NDArray[np.int64]) -> str:
    amplitude = 2 * np.abs(np.fft.rfft(reference)) / len(reference)
    frequency = np.fft.rfftfreq(len(reference), step)
    band = (frequency > 0.2) & (frequency < 100)
    others = band & ~np.isin(np.arange(len(frequency)), line)
    decibel = 20 * np.log10(np.maximum(amplitude, 1e-4))
    curves = [Curve(frequency[others], decibel[others], "reference", "not excited", dots=True)]
    curves.append(Curve(frequency[line], decibel[line], "second", "excited lines", dots=True))
    up = "amplitude, dB of rad/s"
    return chart("Its spectrum", HERTZ, up, curves, logarithmic=True, size=WIDE)


def configurations(chosen: Configurations, caption: str, recorded: Configurations | None = None) -> list[str]:
    """Joint angle of each configuration, behind those that were recorded before."""
    parts = [] if recorded is None else [(recorded.angle[:, 0], "first", "recorded before")]
    parts.append((chosen.angle[:, 0], "second", "chosen" if parts else ""))
    curves, first = [], 1.0
    for angle, style, name in parts:
        curves.append(Curve(first + np.arange(len(angle)), angle, style, name, dots=True))
        first += len(angle)
    return row_of([chart("Configurations", "number", "angle of axis_1, rad", curves, size=WIDE)], caption)


def design(chosen: Design, caption: str) -> list[str]:
    """Share of the experiments over the angle of the configurations."""
    order = np.argsort(chosen.angle[:, 0])
    angle, weight = chosen.angle[order, 0], chosen.weight[order]
    up_and_down = np.stack([0 * weight, weight, 0 * weight], axis=1).ravel()
    curves = [Curve(np.repeat(angle, 3), up_and_down, "second")]
    title, across = "Chosen configurations", "angle of axis_1, rad"
    return row_of([chart(title, across, "share of the experiments", curves, size=WIDE)], caption)


def record(measured: Record, caption: str, seen_s: float = 2.0) -> list[str]:
    """Angle and torque of one experiment."""
    run = measured.runs[0]
    every = max(1, round(seen_s / run.sample_time_s) // MOST_POINTS)
    seen = slice(0, round(seen_s / run.sample_time_s), every)
    charts = [
        chart(title, "time, s", up, [Curve(run.time_s[seen], _signal(measured, name)[seen])], size=WIDE)
        for title, name, up in (
            ("Motor angle", "motor_position", "rad"),
            ("Motor torque", "motor_torque", "N m"),
        )
    ]
    return row_of(charts, caption)


def taken_off(before: Record, after: Record, caption: str, over_turns: bool = False) -> list[str]:
    """Torque that a compensation has taken off, over time or over turns of the motor."""
    removed = _signal(before, "motor_torque") - _signal(after, "motor_torque")
    run = before.runs[0]
    across, x = (
        ("turns of the motor", _signal(before, "motor_position") / (2 * np.pi))
        if over_turns
        else ("time, s", run.time_s)
    )
    every = max(1, len(removed) // (2 * MOST_POINTS))
    curves = [Curve(x[::every], removed[::every], "second", dots=over_turns)]
    return row_of([chart("Torque taken off", across, "torque, N m", curves, size=WIDE)], caption)


def _signal(measured: Record, name: str) -> Array:
    """First period of the first experiment, first axis."""
    values: Array = measured.runs[0].channels[name].values[0, 0, 0, 0, :, 0]
    return values


def responses(frf: Frf, caption: str) -> list[str]:
    """Response of one configuration, and its uncertainty beside the spread of blocks."""
    frequency, response = frf.frequency_hz, frf.response[0, :, 0, 0]
    charts = [
        chart(
            "Response",
            HERTZ,
            "magnitude, dB",
            [Curve(frequency, 20 * np.log10(np.abs(response)))],
            logarithmic=True,
            size=WIDE,
        )
    ]
    deviation = np.sqrt(frf.input_gram_inverse[0, :, 0, 0].real * frf.output_covariance[0, :, 0, 0].real)
    relative = [
        Curve(frequency, _decibel(deviation / np.abs(response)), "second", "stated standard deviation")
    ]
    if frf.block_response is not None and frf.block_response.shape[1] > 1:
        blocks = frf.block_response[0, :, :, 0, 0]
        spread = np.abs(blocks - blocks.mean(axis=0)).max(axis=0)
        name = "blocks, from their mean"
        relative.append(Curve(frequency, _decibel(spread / np.abs(response)), "reference", name, dots=True))
    up = "relative to the response, dB"
    charts.append(chart("Uncertainty", HERTZ, up, relative, logarithmic=True, size=WIDE))
    return row_of(charts, caption)


def _decibel(ratio: Array) -> Array:
    return np.asarray(20 * np.log10(np.maximum(ratio, 1e-6)))


def fitted_response(fit: Fit, caption: str) -> list[str]:
    """Measured response of one configuration beside that of the robot file and of the fit."""
    assert fit.response is not None
    frequency = fit.response.frequency_hz
    measured, modelled, start = (
        _decibel(np.abs(values[0, :, 0, 0]))
        for values in (fit.response.measured, fit.response.modelled, fit.response.start)
    )
    curves = [
        Curve(frequency, start, "reference", "robot file"),
        Curve(frequency, modelled, "second", "fitted model"),
        Curve(frequency, measured, "first", "measured", dots=True),
    ]
    return row_of([chart("Response", HERTZ, "magnitude, dB", curves, logarithmic=True, size=WIDE)], caption)


def over_time(compared: TimeComparison, caption: str) -> list[str]:
    """Measured and modelled values over time, and their difference."""
    n_sample = len(compared.time_s)
    every = max(1, n_sample // MOST_POINTS)
    measured, modelled = (
        values.reshape(n_sample, -1)[::every, 0] for values in (compared.measured, compared.modelled)
    )
    time, up = compared.time_s[::every], f"{compared.channel.replace('_', ' ')}, {compared.unit_symbol}"
    curves = [Curve(time, measured, "first", "measured"), Curve(time, modelled, "reference", "model")]
    left = [Curve(time, measured - modelled, "second")]
    charts = [
        chart("Measured and modelled", "time, s", up, curves, size=WIDE),
        chart("Measured less model", "time, s", up, left, size=WIDE),
    ]
    return row_of(charts, caption)


def friction(curve: FrictionCurve, caption: str) -> list[str]:
    """Friction of each plateau over speed, and the law that was fitted."""
    order = np.argsort(curve.speed)
    curves = [
        Curve(curve.speed[order], curve.fitted[order], "second", "fitted law"),
        Curve(curve.speed, curve.measured, "first", "measured at constant speed", dots=True),
    ]
    across = f"speed, {curve.speed_unit}"
    return row_of([chart("Friction", across, f"friction, {curve.unit_symbol}", curves, size=WIDE)], caption)


def bristles(measured: Record, fit: Fit, caption: str) -> list[str]:
    """Torque over angle in a motion that does not slide, and the slope of the spring that was found."""
    angle, torque = (_slow(_signal(measured, name)) for name in ("motor_position", "motor_torque"))
    angle, torque = angle - angle.mean(), torque - torque.mean()
    ends = np.array([angle.min(), angle.max()])
    stiffness = float(fit.parameters.estimate[0])
    every = max(1, len(angle) // MOST_POINTS)
    curves = [
        Curve(1e3 * angle[::every], torque[::every], "first", "measured", dots=True),
        Curve(1e3 * ends, stiffness * ends, "second", "spring that was found"),
    ]
    return row_of([chart("Motor torque", "motor angle, mrad", "torque, N m", curves, size=WIDE)], caption)


def gear_deflection(measured: Record, ratio: float, caption: str) -> list[str]:
    """Motor angle through the gear less link angle, over the motor's torque through the gear."""
    motor, link, torque = (
        _slow(_signal(measured, name)) for name in ("motor_position", "joint_position", "motor_torque")
    )
    bent = motor / ratio - link
    every = max(1, len(bent) // MOST_POINTS)
    curves = [Curve(ratio * torque[::every], 1e3 * (bent - bent.mean())[::every], "second", dots=True)]
    across = "motor torque through the gear, N m"
    return row_of([chart("Deflection", across, "deflection, mrad", curves, size=WIDE)], caption)


def _slow(values: Array) -> Array:
    """A period without its frequencies above 1/200 of the sampling frequency."""
    spectrum = np.fft.rfft(values)
    spectrum[len(values) // 200 :] = 0
    return np.fft.irfft(spectrum, len(values))


def cause(diagnosis: Diagnosis, caption: str) -> list[str]:
    """The picture of the first finding, as on the page."""
    found = diagnosis.findings[0]
    curves = [
        Curve(found.abscissa, found.explained, "second", f"{found.effect}, as found"),
        Curve(found.abscissa, found.residual, "first", "torque that the rest of the model leaves", dots=True),
    ]
    return row_of([chart("The cause", found.variable, "torque, N m", curves, size=WIDE)], caption)


def page(file: str, caption: str) -> list[str]:
    """A page in a frame, with a link to it."""
    body = (
        f'<figure class="charts"><iframe class="page" src="../../{file}" title="{caption}" loading="lazy"></iframe>'
        f'<figcaption><a href="../../{file}">{caption}</a></figcaption></figure>'
    )
    return [".. raw:: html", "", f"   {body}", ""]


def modelled_response(frf: Frf, fit: Fit, caption: str) -> list[str]:
    """Measured response of one configuration beside that of a fit to something else."""
    traces = {trace.name: trace for trace in plot.response(frf, fit).data if trace.yaxis == "y"}
    curves = [
        Curve(
            *(np.asarray(traces[name][key], dtype=np.float64) for key in "xy"),
            style,
            name,
            dots=name == "measured",
        )
        for name, style in (("fitted model", "second"), ("measured", "first"))
    ]
    return row_of([chart("Response", HERTZ, "magnitude, dB", curves, logarithmic=True, size=WIDE)], caption)
