"""How nonlinear a plant is, from bins that were not excited: level of odd and of even distortion.

A linear plant in periodic steady state answers at excited bins only. What stands at the other bins of the band
is noise and distortion: with odd lines excited, even nonlinearities (asymmetric friction, gravity springs) answer
at even bins and odd ones (Coulomb friction, stiffening) at odd bins, those left out among them (R. Pintelon and
J. Schoukens, System Identification, 2012, section 4.3). The controller feeds it back, so that the input is not
silent there either: the level is that of ``Y - G U``, G interpolated between the lines.
"""

from __future__ import annotations

import numpy as np

from robid_core.arrays import BoolArray, ComplexArray, FloatArray, IntArray

FEWEST = 6  # bins that a level is pooled over, where there are as many: its standard error is below 25 %
NEIGHBOURS = 4  # lines of the polynomial that interpolates: cubic


def interpolate_response(
    response: ComplexArray, frequency_hz: FloatArray, valid: BoolArray, at_hz: FloatArray
) -> ComplexArray:
    """Response between its lines: at each frequency the cubic through the four nearest usable lines.

    Entry by entry, complex; the polynomial of lower degree where a configuration has fewer lines.

    Parameters
    ----------
    response
        Shape (n_config, n_freq, n_out, n_in); lines that are not valid are not looked at.
    frequency_hz, at_hz
        Where it is known (ascending) and where it is wanted, (n_freq,) and (n_at,).
    valid
        Usable lines, shape (n_config, n_freq).

    Returns
    -------
    Shape (n_config, n_at, n_out, n_in); NaN in a configuration without a usable line.
    """
    result = np.full((len(response), len(at_hz), *response.shape[2:]), np.nan + 0j)
    for i, lines in enumerate(map(np.flatnonzero, valid)):
        count = min(NEIGHBOURS, len(lines))
        if count == 0:
            continue
        known = frequency_hz[lines]
        first = np.clip(np.searchsorted(known, at_hz) - count // 2, 0, len(lines) - count)
        near = first[:, None] + np.arange(count)
        weight = lagrange_weights(known[near], at_hz)
        result[i] = np.einsum("bn,bnij->bij", weight, response[i, lines[near]])
    return result


def lagrange_weights(known: FloatArray, at: FloatArray) -> FloatArray:
    """Weights with which values at `known` (n_at, n) give the interpolating polynomial at `at` (n_at,)."""
    n = known.shape[1]
    weight = np.ones(known.shape)
    for a in range(n):
        for b in range(n):
            if a != b:
                weight[:, a] *= (at - known[:, b]) / (known[:, a] - known[:, b])
    return weight


def residual_power(u: ComplexArray, y: ComplexArray, response: ComplexArray) -> FloatArray:
    """Mean of ``|Y - G U|^2`` over blocks and experiments at each bin.

    Parameters
    ----------
    u, y
        Spectra, shape (n_config, n_block, n_exp, n_bin, n_axis).
    response
        G at the bins, shape (n_config, n_bin, n_out, n_in).

    Returns
    -------
    Shape (n_config, n_bin, n_out).
    """
    residual = y - (response[:, None, None] @ u[..., None])[..., 0]
    result: FloatArray = np.mean(residual.real**2 + residual.imag**2, axis=(1, 2))
    return result


def level_at_lines(power: FloatArray, quiet: IntArray, line: IntArray) -> FloatArray:
    """Root mean square at each line of what was found at the bins around it.

    Over the bins that are nearer to a line than to its neighbours, and at least over the six nearest.

    Parameters
    ----------
    power
        Power at each bin, shape (n_config, n_bin, n_out), n_bin > 0.
    quiet, line
        The bins, and the lines, both ascending, shapes (n_bin,) and (n_freq,).

    Returns
    -------
    Shape (n_config, n_freq, n_out).
    """
    middle = 0.5 * (line[1:] + line[:-1])
    first = np.searchsorted(quiet, np.concatenate(([-np.inf], middle)))
    last = np.searchsorted(quiet, np.concatenate((middle, [np.inf])))
    count = min(FEWEST, len(quiet))
    nearest = np.clip(np.searchsorted(quiet, line) - count // 2, 0, len(quiet) - count)
    few = last - first < count
    first, last = np.where(few, nearest, first), np.where(few, nearest + count, last)
    # Sums over slices, each of its own: a difference of running sums would lose what is small beside the rest.
    total = np.add.reduceat(
        np.concatenate((power, np.zeros_like(power[:, :1])), axis=1),
        np.stack((first, last), axis=1).ravel(),
        axis=1,
    )[:, ::2]
    result: FloatArray = np.sqrt(total / (last - first)[:, None])
    return result


def distortion_levels(
    u: ComplexArray,
    y: ComplexArray,
    quiet: IntArray,
    response: ComplexArray,
    valid: BoolArray,
    line: IntArray,
) -> tuple[FloatArray | None, FloatArray | None]:
    """Levels of odd and of even distortion at the lines, noise included.

    Parameters
    ----------
    u, y, quiet
        Spectra averaged over periods at bins of the band that were not excited, shape
        (n_config, n_block, n_exp, n_bin, n_axis), and these bins (n_bin,).
    response, valid, line
        Response at the lines, which of them are usable, and their bins.

    Returns
    -------
    (odd, even), each (n_config, n_freq, n_out) in the unit of y, root mean square of the coefficient in one
    experiment, NaN at lines that are not usable; None where no bin of that parity is left in the band.
    """
    if len(quiet) == 0:
        return None, None
    between = interpolate_response(response, line.astype(float), valid, quiet.astype(float))
    power = residual_power(u, y, between)
    levels: list[FloatArray | None] = []
    for parity in (1, 0):
        bins = np.flatnonzero(quiet % 2 == parity)
        if len(bins) == 0:
            levels.append(None)
            continue
        level = level_at_lines(power[:, bins], quiet[bins], line)
        levels.append(np.where(valid[..., None], level, np.nan))
    return levels[0], levels[1]
