"""What was asked of a motor and what it took: reference and torque over time, and their spectra (thesis fig. 4.1-4.4).

For every experiment of a measurement, small enough for a page: over time the smallest and largest value of every few
samples, as 16-bit integers. The figures come empty; the page's script fills in the experiment that is chosen.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go

from robid_core import FloatArray, IntArray, Record, Robot, mean_travel
from studies.frf_methods.figures_style import EVEN, INK, ODD, UNUSED, USED, laid_out, plain_ticks
from studies.frf_methods.measurement import BLOCKS, SETTLE_PERIODS, ExcitationClass, measure, references

BUCKETS = 500  # a period, each drawn as its smallest and its largest value
FLOOR_DB = 120.0  # below the largest line: rounding, not signal
TOP, NOTHING = 32_000, -32_768  # of 16-bit integers


@dataclass(frozen=True, eq=False)
class Shown:
    """A measurement as the page shows it: the record, and the torque of the periods that it left out.

    `settling_torque` (n_block, n_exp, SETTLE_PERIODS, n_sample, n_axis) in N m; the others (n_axis,) in N m.
    """

    record: Record
    settling_torque: FloatArray
    torque_limit: FloatArray
    gravity: FloatArray
    """Of the nominal robot in the configuration."""
    friction: FloatArray
    """Coulomb friction of the nominal robot."""


def measured(
    robot: Robot,
    nominal: Robot,
    angle: FloatArray,
    excitation: ExcitationClass,
    generator: np.random.Generator,
) -> Shown:
    """Measure one configuration, joint side, rad, (n_axis,), and what is before the record beside it."""
    reference = references(excitation, BLOCKS, generator)
    seed = int(generator.integers(2**62))
    record = measure(robot, angle, excitation, reference, seed)
    lanes = reference.reshape(-1, *reference.shape[2:])
    start = robot.motor_angle(angle) - mean_travel(lanes, excitation.sample_time_s)
    first = robot.simulate(np.tile(lanes, (1, SETTLE_PERIODS, 1)), robot.joint_angle(start), seed)
    return Shown(
        record,
        first.torque.reshape(*reference.shape[:2], SETTLE_PERIODS, *reference.shape[2:]),
        nominal.drives.torque_limit,
        nominal.gravity_torque(angle[None])[0],
        nominal.drives.coulomb,
    )


# Packing ----------------------------------------------------------------------------------------------------------


def envelope(values: FloatArray, buckets: int = BUCKETS) -> FloatArray:
    """Smallest and largest value of each of `buckets` stretches of the last axis, in the order in which they come.

    Shape (..., n_sample) to (..., 2 buckets); as it is where there are no more samples than that.
    """
    width = values.shape[-1] // buckets
    if width <= 2:
        return values
    parts = values[..., : width * buckets].reshape(*values.shape[:-1], buckets, width)
    low, high = parts.min(axis=-1), parts.max(axis=-1)
    rising = parts.argmin(axis=-1) <= parts.argmax(axis=-1)
    pairs = np.where(rising[..., None], np.stack([low, high], -1), np.stack([high, low], -1))
    result: FloatArray = pairs.reshape(*values.shape[:-1], -1)
    return result


def packed(values: FloatArray) -> dict[str, Any]:
    """Values (n_block, n_exp, n_axis, n) as base64 of 16-bit integers with one unit for all; NaN as NOTHING."""
    unit = float(np.nanmax(np.abs(values))) / TOP or 1.0
    data = np.where(np.isnan(values), NOTHING, np.round(values / unit)).astype("<i2")
    return {
        "unit": float(f"{unit:.9g}"),
        "length": values.shape[-1],
        "data": base64.b64encode(data.tobytes()).decode(),
    }


def amplitude_db(values: FloatArray, bins: IntArray) -> FloatArray:
    """Amplitudes of cosines at some bins, dB, NaN where it is FLOOR_DB below the largest; (..., n) to (..., n_bin)."""
    amplitude = 2 * np.abs(np.fft.rfft(values, axis=-1)[..., bins]) / values.shape[-1]
    decibel = 20 * np.log10(np.maximum(amplitude, 1e-30))
    return np.where(decibel > decibel.max() - FLOOR_DB, decibel, np.nan)


def signals(shown: Shown) -> dict[str, Any]:
    """What the page's script fills the figures with: times in s, reference in rad/s, torque in N m, spectra in dB."""
    run = shown.record.run
    line = np.asarray(shown.record.line)
    n_sample = len(run.time_s)
    period_s = n_sample * run.sample_time_s
    torque = np.moveaxis(run.values("motor_torque")[0], -1, 2)  # block, exp, axis, period, sample
    settling = np.moveaxis(shown.settling_torque, -1, 2)
    reference = np.moveaxis(run.values("speed_reference")[0, :, :, 0], -1, 2)
    periods = np.concatenate([settling, torque], axis=3)
    drawn = envelope(periods)
    bins = np.arange(1, min(int(1.25 * line[-1]), n_sample // 2))
    kind = np.where(np.isin(bins, line), 0, np.where(bins % 2 == 1, 1, 2))
    n_block, n_exp = reference.shape[:2]
    return {
        "shape": [n_block, n_exp, len(shown.record.axis_names)],
        "period": period_s,
        "settling": settling.shape[3],
        "periods": periods.shape[3],
        "frequency": [float(f"{f:.6g}") for f in bins / period_s],
        "kind": kind.tolist(),
        "reference": packed(envelope(reference)),
        "torque": packed(drawn.reshape(*drawn.shape[:3], -1)),
        "reference_spectrum": packed(amplitude_db(reference, bins)),
        "torque_spectrum": packed(amplitude_db(torque.mean(axis=3), bins)),
        "limit": shown.torque_limit.tolist(),
        "gravity": [float(f"{value:.5g}") for value in shown.gravity],
        "friction": shown.friction.tolist(),
    }


# Figures ----------------------------------------------------------------------------------------------------------


def over_time(quantity: str, *, dashed: bool) -> go.Figure:
    """Empty figure over time: before it settled, the part that is used, and for torque limit and friction level."""
    figure = go.Figure()
    for name, tone in (("settling, not used", UNUSED), ("used for the response", USED)):
        figure.add_scatter(x=[], y=[], name=name, mode="lines", line={"color": tone, "width": 0.9})
    if dashed:
        halo = {"color": "rgba(255,255,255,.75)", "width": 3}
        figure.add_scatter(x=[], y=[], mode="lines", line=halo, showlegend=False)
        for name, dash in (("torque limit", "9px,5px"), ("gravity ± Coulomb friction", "4px,3px")):
            line = {"color": INK, "width": 1.8, "dash": dash}
            figure.add_scatter(x=[], y=[], name=name, mode="lines", line=line, connectgaps=False)
    figure.update_xaxes(title_text="time, s")
    figure.update_yaxes(title_text=quantity)
    return laid_out(figure, 320, hovermode=False)


def spectrum(quantity: str) -> go.Figure:
    """Empty figure of amplitudes: excited lines, odd bins between them, even bins."""
    figure = go.Figure()
    for name, tone, size in (("excited", USED, 6), ("odd, not excited", ODD, 4), ("even", EVEN, 4)):
        figure.add_scatter(x=[], y=[], name=name, mode="markers", marker={"color": tone, "size": size})
    ticks = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200]
    figure.update_xaxes(title_text="frequency, Hz", type="log", tickvals=ticks)
    figure.update_yaxes(title_text=quantity, type="log", exponentformat="power", dtick=1)
    return laid_out(figure, 320, hovermode="closest")


def signal_figures(shown: Shown) -> dict[str, go.Figure]:
    """The four figures by the names under which the script finds them."""
    asked = 2 * np.abs(shown.record.reference_spectra())
    reference = spectrum("amplitude, rad/s")
    reference.update_yaxes(**plain_ticks([0.5 * float(asked.min()), 4 * float(asked.max())]))
    return {
        "reference-time": over_time("speed reference, rad/s", dashed=False),
        "reference-spectrum": reference,
        "torque-time": over_time("motor torque, N m", dashed=True),
        "torque-spectrum": spectrum("amplitude, N m"),
    }
