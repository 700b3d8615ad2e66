"""One motor in an experiment that need not repeat, ready for order analysis: its torque beyond the rigid robot.

The torque residual is the measured torque less inverse dynamics, low-passed like the motion; friction over speed,
errors of gravity and a drift are nuisances. The motor's own acceleration is none: ripple moves the motor, and a loop
that is slow beside it leaves torque and acceleration in a fixed proportion, which a free inertia would explain. A wave
of the angle that is slow beside the filter passes it with the filter's gain at ``order |v| / (2 pi)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.estimation.distortion.order_analysis import FRICTION_SCALES, Kind
from robid_core.estimation.rigid.regression import differentiate, smooth

FILTER_ORDER = 4
OVERSAMPLING = 2.0  # samples that are kept, per period of the filter's edge


@dataclass(frozen=True, eq=False)
class Passage:
    """One motor in one experiment, low-passed; arrays over the samples kept."""

    angle: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    torque: FloatArray
    """As it was measured, N m: what ripple in proportion to the torque is a share of."""
    residual: FloatArray
    """Less inverse dynamics."""
    nuisance: FloatArray
    """Shape (n_sample, n_nuisance)."""
    inertia: float
    """That the motor feels, kg m^2."""
    cutoff_hz: float
    later_s: float
    """How much later than the angle was taken a torque acts: half a sample where it is held."""

    @property
    def turns(self) -> float:
        """How far the motor moves, in turns."""
        return float(np.ptp(self.angle)) / (2 * np.pi)


def kept_samples(n_sample: int, sample_time_s: float, cutoff_hz: float) -> slice:
    """Samples of an experiment that are looked at: as dense as the filter's edge asks, without its start-up."""
    stride = max(int(1.0 / (OVERSAMPLING * cutoff_hz * sample_time_s)), 1)
    edge = round(1.0 / (cutoff_hz * sample_time_s))
    return slice(edge, n_sample - edge, stride)


def passage_of(
    angle: FloatArray,
    torque: FloatArray,
    rigid: FloatArray,
    beside: FloatArray,
    inertia: float,
    sample_time_s: float,
    cutoff_hz: float,
    held: bool,
) -> Passage:
    """Prepare one motor in one experiment.

    Parameters
    ----------
    angle, torque
        rad and N m of the motor as measured, shape (n_sample,).
    rigid
        Torque of inverse dynamics without friction along the motion that is low-passed like here, N m, at the samples
        that `kept_samples` names.
    beside
        Signals whose share in the torque is not known well (weight), there, shape (n_kept, n_signal).
    inertia
        That the motor feels, kg m^2.
    cutoff_hz
        Edge of the low-pass, `regression.smooth` of order `FILTER_ORDER`.
    held
        Whether the torque is held from a sample to the next.
    """
    position, effort = (smooth(one, sample_time_s, cutoff_hz, FILTER_ORDER) for one in (angle, torque))
    speed = differentiate(position, sample_time_s)
    acceleration = differentiate(speed, sample_time_s)
    kept = kept_samples(len(angle), sample_time_s, cutoff_hz)
    v = speed[kept]
    scale = max(float(np.sqrt(np.mean(v**2))), 1e-300)
    shapes = [np.tanh(v / (share * scale)) for share in FRICTION_SCALES]
    shapes += [v / scale, np.abs(v) / scale, (v / scale) ** 2, np.tanh(v / (FRICTION_SCALES[0] * scale)) ** 2]
    time = np.linspace(-1.0, 1.0, len(v))
    nuisance = np.column_stack([np.ones(len(v)), time, *shapes, beside])
    return Passage(
        angle=position[kept],
        speed=v,
        acceleration=acceleration[kept],
        torque=effort[kept],
        residual=effort[kept] - rigid,
        nuisance=nuisance,
        inertia=inertia,
        cutoff_hz=cutoff_hz,
        later_s=0.5 * sample_time_s if held else 0.0,
    )


def wave_columns(passage: Passage, kind: Kind, orders: FloatArray) -> FloatArray:
    """Change of the torque residual by cosine and sine of unit size, shape (n_sample, n_order, 2).

    A torque that acts beside the measured one is lacking in that; an angle that is measured too large is taken for an
    acceleration: ``-J e''``.
    """
    late = 0.0 if kind == "resolver" else passage.later_s
    phase = (passage.angle + late * passage.speed)[:, None] * orders
    rate = passage.speed[:, None] * orders
    gain = 1.0 / (1.0 + (np.abs(rate) / (2 * np.pi * passage.cutoff_hz)) ** (2 * FILTER_ORDER))
    cosine, sine = np.cos(phase), np.sin(phase)
    if kind == "resolver":
        bend = passage.acceleration[:, None] * orders
        weight = passage.inertia * gain
        pair = weight * (rate**2 * cosine + bend * sine), weight * (rate**2 * sine - bend * cosine)
    else:
        size = -gain * (passage.torque[:, None] if kind == "current" else 1.0)
        pair = size * cosine, size * sine
    return np.stack(pair, axis=-1)
