"""Units as people write them, and which of them a quantity may have."""

from __future__ import annotations

import numpy as np

# Written unit -> (SI symbol, factor).
UNITS: dict[str, tuple[str, float]] = {
    "rad": ("rad", 1.0), "mrad": ("rad", 1e-3), "deg": ("rad", np.pi / 180), "turn": ("rad", 2 * np.pi),
    "m": ("m", 1.0), "mm": ("m", 1e-3), "um": ("m", 1e-6),
    "rad/s": ("rad/s", 1.0), "deg/s": ("rad/s", np.pi / 180), "rpm": ("rad/s", 2 * np.pi / 60),
    "m/s": ("m/s", 1.0), "mm/s": ("m/s", 1e-3),
    "rad/s^2": ("rad/s^2", 1.0), "deg/s^2": ("rad/s^2", np.pi / 180), "m/s^2": ("m/s^2", 1.0), "g": ("m/s^2", 9.80665),
    "N m": ("N m", 1.0), "Nm": ("N m", 1.0), "mN m": ("N m", 1e-3), "kN m": ("N m", 1e3),
    "N": ("N", 1.0), "kN": ("N", 1e3),
    "A": ("A", 1.0), "mA": ("A", 1e-3), "V": ("V", 1.0), "mV": ("V", 1e-3), "degC": ("degC", 1.0), "K": ("K", 1.0),
    "1": ("1", 1.0),
}  # fmt: skip

# Word in a channel's name -> SI symbols it may have (of a revolute or of a prismatic axis).
QUANTITIES: dict[str, tuple[str, ...]] = {
    "position": ("rad", "m"),
    "speed": ("rad/s", "m/s"),
    "acceleration": ("rad/s^2", "m/s^2"),
    "turn_rate": ("rad/s",),
    "torque": ("N m", "N"),
    "current": ("A",),
    "voltage": ("V",),
    "temperature": ("degC", "K"),
}


def symbols_of(name: str) -> tuple[str, ...]:
    """Return the SI symbols that a channel of this name may have, none where its name says no quantity.

    >>> symbols_of("motor_torque")
    ('N m', 'N')
    """
    return tuple(symbol for word, symbols in QUANTITIES.items() if word in name for symbol in symbols)
