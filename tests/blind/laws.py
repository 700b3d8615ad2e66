"""Hidden laws of the blind cases, written anew from the literature: they share nothing with the catalogue of effects.

Each is a number. A force law gives the force along its coordinate and may keep two numbers as its memory, which it
moves on once a step; what acts on signals stands in `foreign_plant.py`.
"""

from __future__ import annotations

import math

import numba as nb

(NOTHING, ASYMMETRIC, STRIBECK, BY_LOAD, DAHL, LUGRE, BACKLASH, STIFFENING, HYSTERESIS, RIPPLE, RESOLVER, GEAR_WAVE,
 LAG, CABLE, SATURATION, GAIN) = range(16)  # fmt: skip
(FIRST, SECOND, THIRD, FOURTH, WIDTH, SPRING, DAMPER) = range(7)  # numbers of a law


@nb.njit
def force(law, number, x, v, load, memory):  # type: ignore[no-untyped-def]
    """Force against the motion of the law's coordinate, N m."""
    sign = math.tanh(v / number[WIDTH])
    if law == ASYMMETRIC:
        return number[FIRST] * max(sign, 0.0)
    if law == STRIBECK:
        return number[FIRST] * math.exp(-((abs(v) / number[SECOND]) ** number[THIRD])) * sign
    if law == BY_LOAD:
        return number[FIRST] * abs(load) * sign
    if law in (DAHL, HYSTERESIS):
        return memory[0]
    if law == LUGRE:
        level = number[FIRST] + number[THIRD] * math.exp(-((v / number[FOURTH]) ** 2))
        return memory[0] + 1e-4 * number[SECOND] * (v - abs(v) * memory[0] / level)
    if law == BACKLASH:
        half = 0.5 * number[FIRST]
        beyond = x - half if x > half else (x + half if x < -half else 0.0)
        contact = 1.0 if abs(x) > half else 0.0
        return number[SPRING] * (beyond - x) + number[DAMPER] * (contact - 1.0) * v
    if law == STIFFENING:
        return number[FIRST] * x * x * x
    if law == CABLE:
        return number[FIRST] * (x - number[SECOND]) + number[THIRD] * v
    return 0.0


@nb.njit
def move_on(law, number, v, memory, step):  # type: ignore[no-untyped-def]
    """Advance the memory by a step of constant speed: bristles that yield at a level."""
    if law in (DAHL, HYSTERESIS):
        level = number[FIRST]
    elif law == LUGRE:
        level = number[FIRST] + number[THIRD] * math.exp(-((v / number[FOURTH]) ** 2))
    else:
        return
    end = level if v > 0 else -level
    memory[0] = end + (memory[0] - end) * math.exp(-number[SECOND] * abs(v) * step / level)
