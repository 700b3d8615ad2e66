"""A wrong gear ratio in the robot file: three findings that have one cause.

With a ratio too large by a factor f in the file, motors turn f times less than the model expects for the same motion of
the arm, take f times the torque for what acts on the arm, and their rotors count f^2 times less at the arm.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid_core import Finding, ParameterTable

SURE = 3.0  # standard errors: what differs by less is alike, and what is none itself is not there
TORQUE_SIGN = {"sensing.gain_error": 1, "drive.torque_constant": -1}  # of the logarithm, in what is reported

Logarithm = tuple[float, float]
"""Of the factor by which a ratio is told too large, as one quantity says, and its standard error."""


def gear_ratio_lines(findings: Sequence[Finding], values: ParameterTable) -> list[str]:
    """Say of which axes gains of angle and torque and the rotor are together a wrong gear ratio."""
    found = []
    for axis in dict.fromkeys(one.on for one in findings):
        told = [*_of_gains(findings, axis), *_of_rotor(values, axis)]
        if len(told) != 3:
            continue
        size, error = np.array(told).T
        weight = error**-2 / (error**-2).sum()
        mean, spread = float(weight @ size), float((error**-2).sum() ** -0.5)
        alike = np.abs(size - mean) < SURE * np.sqrt(np.maximum(error**2 - spread**2, 0.0))
        if alike.all() and (np.abs(size) > SURE * error).all():
            factor = np.exp(mean)
            found.append(
                f"{axis}: gains of angle and torque and the rotor inertia together suggest that the robot file's gear "
                f"ratio is {100 * abs(factor - 1):.3g} ± {100 * factor * spread:.1g} % too "
                f"{'large' if mean > 0 else 'small'}."
            )
    return found


def _of_gains(findings: Sequence[Finding], axis: str) -> Iterator[Logarithm]:
    """What a gain of the reported angle says, and one of the reported torque."""
    for one in findings:
        if one.on != axis or len(one.value) != 1:
            continue
        logarithm, error = np.log1p(one.value[0]), one.standard_error[0] / (1 + one.value[0])
        if (one.effect, one.side) == ("sensing.gain_error", "position"):
            yield float(-logarithm), float(error)
        elif one.side in ("torque", "torque_measurement") and one.effect in TORQUE_SIGN:
            yield float(TORQUE_SIGN[one.effect] * logarithm), float(error)


def _of_rotor(values: ParameterTable, axis: str) -> Iterator[Logarithm]:
    name = f"rotor_inertia.{axis}"
    if name in values.names:
        i = values.names.index(name)
        yield (
            float(-0.5 * np.log(values.estimate[i] / values.start[i])),
            float(0.5 * values.standard_error[i] / values.estimate[i]),
        )
