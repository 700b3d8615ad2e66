"""What to write for units that the table does not have: factor and SI unit of those that data sheets use."""

from __future__ import annotations

import difflib
import re

from robid_core import UNITS

FACTORS = {
    "oz in": (0.00706155181, "N m"),
    "lb ft": (1.35581795, "N m"),
    "lb in": (0.112984829, "N m"),
    "kg m": (9.80665, "N m"),
    "kg cm": (0.0980665, "N m"),
    "g cm": (9.80665e-5, "N m"),
    "n cm": (0.01, "N m"),
    "n mm": (0.001, "N m"),
    "lb": (4.44822162, "N"),
    "kg": (9.80665, "N"),
    "kp": (9.80665, "N"),
    "arcmin": (2.90888209e-4, "rad"),
    "arcsec": (4.84813681e-6, "rad"),
    "gon": (0.0157079633, "rad"),
    "in": (0.0254, "m"),
    "inch": (0.0254, "m"),
    "ft": (0.3048, "m"),
    "cm": (0.01, "m"),
}
WORDS = {"ozf": "oz", "lbf": "lb", "kgf": "kg", "kp": "kg", "gf": "g", "'": "arcmin", '"': "arcsec"}
DEGREES = (
    "\N{DEGREE SIGN}",
    "degree",
    "degrees",
    "grad",
    "grade",
    "grados",
    "gradi",
    "degr\u00e9",
    "degr\u00e9s",
)
PERCENT = ("%", "percent", "per cent", "permille")


def unit_advice(unit: str) -> str:
    """Say what to write in place of a unit that is not known."""
    words = [WORDS.get(word, word) for word in re.split(r"[\s*.·_-]+", unit.strip().lower()) if word]
    for name in (" ".join(words), " ".join(reversed(words))):
        if name in FACTORS:
            factor, symbol = FACTORS[name]
            return f"write scale: {factor:.9g} and unit_to: {symbol}"
    if unit.strip().lower() in DEGREES:
        return (
            f"for degrees write deg; gons, 400 a turn, take scale: {FACTORS['gon'][0]:.9g} and unit_to: rad"
        )
    if unit.strip().lower() in PERCENT:
        return "of what? Give scale: what one of them is in SI units, and unit_to: N m (or A)"
    near = difflib.get_close_matches(unit, UNITS, n=1)
    return f"did you mean '{near[0]}'? Else give scale and unit_to" if near else "give scale and unit_to"
