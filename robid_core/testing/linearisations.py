"""What an effect says of itself in the frequency domain: equivalent spring and damper, complex gain, noise."""

from __future__ import annotations

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.effect import Equivalent, ForceEffect, Motion, Place, SignalEffect
from robid_core.testing.broken import ContractBroken

OMEGA = 2 * np.pi * 20.0  # rad/s, where a gain with memory is asked for
AGREEMENT = 0.02  # of the gain: the default is a realisation's regression where a law has a state


def motions() -> tuple[Motion, ...]:
    """Return three motions of a motor or an arm, slow to fast."""
    turning = ((0.02, True, 2e-4, 10.0), (2.0, True, 0.1, 0.0), (20.0, False, -0.3, -3.0))
    return tuple(
        Motion(
            velocity_rms=speed,
            sine_speed=3 * speed if slow else 0.0,
            position_bias=bias,
            position_rms=speed / OMEGA,
            sine_omega=2 * np.pi * 2.0,
            load=load,
            omega=OMEGA,
            signal_rms=0.3,
        )
        for speed, slow, bias, load in turning
    )


def check_equivalent(
    name: str, effect: type[ForceEffect], values: FloatArray, place: Place, compare: bool
) -> None:
    """Check that a linearisation is finite, broadcasts, and is that of the law.

    `compare` asks for the latter: where the effect has a closed form of its own, for a law of the place's coordinate.
    """
    spread = Motion(
        velocity_rms=np.array([[0.5], [2.0]]),
        sine_speed=np.array([0.0, 1.0, 6.0]),
        position_rms=np.array([[0.5], [2.0]]) / OMEGA,
        sine_omega=4.0 * np.pi,
        omega=OMEGA,
    )
    _finite(name, effect.linearize(values.copy(), place, spread), (2, 3))
    for motion in motions():
        own = effect.linearize(values.copy(), place, motion)
        _finite(name, own, ())
        if not compare:
            continue
        default = ForceEffect.linearize.__func__(effect, values, place, motion)  # type: ignore[attr-defined]
        pair = [complex(float(gain.stiffness), OMEGA * float(gain.damping)) for gain in (own, default)]
        if not abs(pair[0] - pair[1]) <= AGREEMENT * max(map(abs, pair)):
            raise ContractBroken(
                f"{name}: linearize gives stiffness {float(own.stiffness):.6g} and damping {float(own.damping):.6g}, "
                f"the law itself has {float(default.stiffness):.6g} and {float(default.damping):.6g} under {motion}"
            )


def _finite(name: str, gain: Equivalent, shape: tuple[int, ...]) -> None:
    for word in ("stiffness", "damping"):
        part = np.asarray(getattr(gain, word))
        try:
            fits = np.broadcast_shapes(part.shape, shape) == shape
        except ValueError:
            fits = False
        if not fits or not np.isfinite(part).all():
            raise ContractBroken(
                f"{name}: linearize gives a {word} of shape {part.shape} for motions of shape {shape}: {part}; "
                "finite numbers that broadcast are expected"
            )


def check_gain(name: str, effect: type[SignalEffect], values: FloatArray, place: Place) -> None:
    """Check that a complex gain has a finite value a frequency, standstill of the signal included."""
    omega = np.array([0.0, 1.0, OMEGA, 2 * np.pi * 400.0])
    for motion in (Motion(), *motions()):
        gain = np.asarray(effect.gain(values.copy(), place, omega, motion))
        if gain.shape != omega.shape or gain.dtype != np.complex128 or not np.isfinite(gain).all():
            raise ContractBroken(
                f"{name}: gain is {gain!r} under {motion}; {len(omega)} finite complex numbers are expected, one a "
                "frequency, 0 included"
            )
        if abs(gain[0].imag) > 1e-9 * abs(gain[0]):
            raise ContractBroken(
                f"{name}: gain at frequency 0 is {gain[0]:.6g} under {motion}, a constant has no phase"
            )


def check_noise(name: str, effect: type[SignalEffect], values: FloatArray, place: Place) -> None:
    """Check that drawn noise has its shape, differs between lanes and is the same for the same seed."""
    shape = (3, 50)
    first, again, other = (
        effect.draw(values.copy(), place, shape, np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    if first is None:
        return
    if first.shape != shape or not np.isfinite(first).all():
        raise ContractBroken(
            f"{name}: draw gives shape {first.shape}, {shape} (n_lane, n_sample) is expected"
        )
    if again is None or not np.array_equal(first, again):
        raise ContractBroken(
            f"{name}: draw gives other noise for the same seed; take chance from `generator`"
        )
    if other is None or np.array_equal(first, other) or np.array_equal(first[0], first[1]):
        raise ContractBroken(f"{name}: draw gives the same noise for another seed or another lane")
