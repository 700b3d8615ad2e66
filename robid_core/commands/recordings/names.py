"""What the name of a column says: quantity, side of the gear, reference or measurement, unit.

Words are those of logs and data sets in English, some in German, French, Spanish and Italian; what a name does not say
stays empty.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

QUANTITIES = {
    "time": {"time", "t", "timestamp", "timestamps", "stamp", "clock", "tick", "ticks", "seconds", "secs", "zeit",
             "tiempo", "tempo"},
    "temperature": {"temp", "temps", "temperature", "temperatures", "temperatur"},
    "voltage": {"volt", "volts", "voltage", "voltages", "vin", "vbus", "spannung"},
    "torque": {"torque", "torques", "tau", "effort", "efforts", "trq", "moment", "drehmoment", "couple", "coppia",
               "force", "forces"},
    "current": {"cur", "curr", "current", "currents", "iq", "i", "amps", "strom", "courant", "corriente",
                "corrente"},
    "acceleration": {"acc", "accel", "acceleration", "accelerations", "ddq", "qdd", "qddot", "beschleunigung"},
    "speed": {"vel", "velocity", "velocities", "speed", "speeds", "dq", "qd", "qdot", "omega", "rpm", "geschwindigkeit",
              "drehzahl", "vitesse", "velocidad"},
    "position": {"pos", "position", "positions", "angle", "angles", "q", "qm", "theta", "phi", "enc", "encoder",
                 "winkel", "lage"},
}  # fmt: skip
DEFAULT_UNITS = {
    "time": "s", "temperature": "degC", "voltage": "V", "torque": "N m", "current": "A",
    "acceleration": "rad/s^2", "speed": "rad/s", "position": "rad",
}  # fmt: skip
REFERENCE = {
    "ref", "reference", "references", "goal", "desired", "des", "cmd", "command", "commanded", "setpoint", "target",
    "soll", "sollwert", "demand", "set", "sp", "consigne", "consigna",
}  # fmt: skip
MOTOR = {"motor", "mot", "motors", "drive", "rotor"}
JOINT = {"joint", "joints", "link", "arm", "load", "se", "secondary", "output", "gelenk"}
ENABLED = {"enable", "enabled", "enables"}
MEASURED = {"act", "actual", "measured", "meas", "ist", "istwert", "rec"}
# Not a measurement of what the other words say.
OTHER = {
    "enable", "enabled", "limit", "limits", "max", "min", "flag", "status", "mode", "id", "index", "resolution",
    "offset", "error", "err", "cmptd", "computed", "calculated", "model", "predicted", "simulated", "sim", "rate",
    "init", "gain", "constant", "nt", "dt", "filtered",
}  # fmt: skip
AXIS_WORDS = {
    "joint",
    "axis",
    "achse",
    "gelenk",
    "j",
    "motor",
    "a",
    "channel",
    "col",
    "column",
    "x",
    "values",
}

_UNITS = {
    "rad": "rad", "mrad": "mrad", "deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "turn": "turn",
    "rev": "turn", "mm": "mm", "um": "um", "µm": "um", "m": "m", "rad/s": "rad/s", "deg/s": "deg/s",
    "°/s": "deg/s", "rpm": "rpm", "1/min": "rpm", "m/s": "m/s", "mm/s": "mm/s", "rad/s^2": "rad/s^2",
    "rad/s2": "rad/s^2", "rad/s²": "rad/s^2", "deg/s^2": "deg/s^2", "deg/s2": "deg/s^2", "deg/s²": "deg/s^2",
    "m/s^2": "m/s^2", "m/s2": "m/s^2", "nm": "N m", "n m": "N m", "n*m": "N m", "n.m": "N m", "n·m": "N m",
    "mnm": "mN m", "knm": "kN m", "n": "N", "kn": "kN", "a": "A", "ma": "mA", "v": "V", "mv": "mV",
    "degc": "degC", "°c": "degC", "c": "degC", "k": "K", "s": "s", "sec": "s", "ms": "ms", "us": "us",
    "µs": "us", "ns": "ns",
}  # fmt: skip
_OF_QUANTITY = {
    "time": {"s", "ms", "us", "ns"},
    "temperature": {"degC", "K"},
    "voltage": {"V", "mV"},
    "torque": {"N m", "mN m", "kN m", "N", "kN"},
    "current": {"A", "mA"},
    "acceleration": {"rad/s^2", "deg/s^2", "m/s^2"},
    "speed": {"rad/s", "deg/s", "rpm", "m/s", "mm/s"},
    "position": {"rad", "mrad", "deg", "turn", "m", "mm", "um"},
}
_BRACKETS = re.compile(r"[\[(<]([^\[\]()<>]*)[\])>]")
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-zµ°]+|[0-9]+")
_TOGETHER = re.compile(
    r"(d?d?q|qd|qm|v|vel|pos|tau|i|cur)(ref|des|cmd|set|soll|act|meas|ist)"
)  # qref, taucmd


@dataclass(frozen=True)
class Said:
    """Meaning of a channel's name: quantity, side, unit; empty where the name does not say."""

    quantity: str = ""
    side: str = ""
    reference: bool = False
    unit: str = ""
    measured: bool = False
    by_current: bool = False
    """Whether it is a torque that was made of a measured current (`TorqueCur`)."""
    enabled: bool = False
    """Whether it says when a drive was enabled."""
    other: bool = False
    n_word: int = 0


def words_of(name: str) -> list[str]:
    """Return the words of a name in lower case: `TorqueCur1` is torque, cur, 1, and `qref` q, ref."""
    words = (word.lower() for word in _WORD.findall(name))
    parts = ((word, _TOGETHER.fullmatch(word)) for word in words)
    return [part for word, both in parts for part in (both.groups() if both else (word,))]


def said_by(name: str, unit: str = "", hint: str = "") -> Said:
    """Return what a name says.

    Parameters
    ----------
    name
        A column, or columns of several axes with their numbers taken out.
    unit
        What the file states as its unit, where it does.
    hint
        The name of the file: it counts where the column's says no more than an axis.
    """
    plain = _BRACKETS.sub(" ", name)
    parts = [part for part in re.split(r"[./]", plain) if part.strip()]
    last = [word for word in words_of(parts[-1] if parts else "") if not word.isdigit()]
    every = set(words_of(plain))
    if hint and set(last) <= AXIS_WORDS and not quantity_of(last):
        last = words_of(hint) + last
        every |= set(last)
    quantity = quantity_of(last) or quantity_of([word for word in words_of(plain) if not word.isdigit()])
    side = "motor" if every & MOTOR else "joint" if every & JOINT else ""
    stated = known_unit(unit) or next(
        (one for text in _BRACKETS.findall(name) if (one := known_unit(text))), ""
    )
    if quantity == "temperature" and stated in _OF_QUANTITY["time"]:
        quantity = "time"  # temps in French
    if quantity == "torque" and stated in _OF_QUANTITY["current"]:
        quantity = "current"  # the torque-producing one
    by_current = quantity == "torque" and bool(every & QUANTITIES["current"])
    found = stated or _unit_in(last, quantity)
    if not found and not quantity and every & (MEASURED | REFERENCE):
        found = _unit_at_end(last)
    if not quantity and found:
        quantity = next((one for one, units in _OF_QUANTITY.items() if found in units), "")
    return Said(
        quantity=quantity,
        side=side,
        reference=bool(every & REFERENCE),
        unit=found if quantity and found in _OF_QUANTITY[quantity] else "",
        measured=by_current or bool(every & MEASURED),
        by_current=by_current,
        enabled=bool(set(last) & ENABLED),
        other=bool(set(last) & OTHER),
        n_word=len(last),
    )


def quantity_of(words: list[str]) -> str:
    """Return the quantity that words name: the first in the order of `QUANTITIES`, empty where none does."""
    return next((name for name, known in QUANTITIES.items() if known & set(words)), "")


def known_unit(text: str) -> str:
    """Return a unit as channel maps write it, empty where it is not known."""
    return _UNITS.get(text.strip().lower(), "")


def _unit_at_end(words: list[str]) -> str:
    """Return the unit at the end of a name that says no quantity, as in `A1_ist_deg`; one letter is none."""
    found = [_unit_in(words, quantity) for quantity in _OF_QUANTITY]
    return next((unit for unit in found if unit and len(words[-1]) > 1), "")


def _unit_in(words: list[str], quantity: str) -> str:
    """Return the unit at the end of a name, as in `vel_deg_per_s` and `torque_nm`."""
    allowed = _OF_QUANTITY.get(quantity, set())
    for count in (3, 2, 1):
        tail = words[-count:]
        if count >= len(words) or len(tail) < count:
            continue
        together = "".join(tail)
        for text in (together.replace("per", "/"), "/".join(tail), together):
            if (unit := known_unit(text)) and unit in allowed:
                return unit
    return ""
