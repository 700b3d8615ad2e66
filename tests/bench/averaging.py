"""Speed of the averaging estimators against loops over the lines in plain numpy, as a table.

    python tests/bench/averaging.py [--rounds 15] [--lines 2000] [--blocks 4] [--axes 6]

Contestants take turns in this process on one thread; times are medians over rounds, per line of one configuration.
All begin with spectra of the blocks and end with the response; ours also refuses singular lines, and comes with the
inverse Gram matrix that the covariance is made of. The loops are what one writes down from the equations of the
thesis: (3.10), (3.11), (3.12) with (3.13), the harmonic mean, (3.14); for (3.10) and (3.14) the experiments of all
blocks are put side by side once, before the loop.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported
if str(Path(__file__).parent) not in sys.path:
    sys.path.append(str(Path(__file__).parent))

import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
from stopwatch import Contestant, Race  # noqa: E402

from robid_core.estimation.excitation.multisine import orthogonal_matrix  # noqa: E402
from robid_core.estimation.response.means import harmonic_mean, logarithmic_mean_matrix  # noqa: E402
from robid_core.estimation.response.spectra import divide_by_reference, divide_spectra, side_by_side  # noqa: E402

ComplexArray = npt.NDArray[np.complex128]

NAMES = ("H1", "ARI", "harmonic", "JIO", "LOG")
STACKED = "JIO, blocks side by side"
"""The best a loop over lines can do: blocks side by side before it begins, two products and an inverse a line."""


def spectra(
    n_block: int, n_freq: int, n: int, seed: int = 0
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Inputs, outputs and references of a closed loop at n_freq lines, each (n_block, n_freq, n, n)."""
    generator = np.random.default_rng(seed)

    def noise(size: float) -> ComplexArray:
        parts = generator.standard_normal((2, n_block, n_freq, n, n))
        return size * (parts[0] + 1j * parts[1])

    s = 2j * np.pi * np.geomspace(4, 80, n_freq)[:, None, None]
    root = generator.standard_normal((n, n))
    mass, spring = np.eye(n) + 0.2 * root @ root.T / n, np.diag(np.geomspace(2e3, 2e5, n))
    plant = s**2 * np.linalg.inv(mass * s**2 + spring * (1 + 2e-3 * s)) @ (np.eye(n) + 0.3 * root / n)
    phase = np.exp(2j * np.pi * generator.random((n_block, n_freq, n)))
    reference = phase[..., None] * orthogonal_matrix(n).T
    sensitivity = np.linalg.inv(np.eye(n) + 10 / s * plant)
    disturbance = noise(0.03)
    u = sensitivity @ (reference - 10 / s * disturbance) + noise(0.01)
    y = plant @ (sensitivity @ (reference - 10 / s * disturbance)) + disturbance
    return np.ascontiguousarray(u), np.ascontiguousarray(y), np.ascontiguousarray(reference)


def ours(u: ComplexArray, y: ComplexArray, r: ComplexArray) -> dict[str, Callable[[], ComplexArray]]:
    """Each estimator as its stage calls it."""
    return {
        "H1": lambda: divide_spectra(u, y, joined=True).value,
        "ARI": lambda: divide_spectra(u, y).value.mean(axis=0),
        "harmonic": lambda: harmonic_mean(divide_spectra(y, u).value),
        "JIO": lambda: divide_by_reference(u, y, r).value,
        "LOG": lambda: logarithmic_mean_matrix(divide_spectra(u, y).value),
    }


def loops(u: ComplexArray, y: ComplexArray, r: ComplexArray) -> dict[str, Callable[[], ComplexArray]]:
    """The same, line by line."""
    n_block, n_freq = u.shape[:2]
    inv = np.linalg.inv

    def logarithm(k: int) -> ComplexArray:
        blocks = [y[m, k] @ inv(u[m, k]) for m in range(n_block)]
        value, vector = np.linalg.eig(blocks[0])
        rotation = vector @ np.diag(np.exp(-1j * np.angle(value))) @ inv(vector)
        mean = np.zeros_like(rotation)
        for block in blocks:
            value, vector = np.linalg.eig(rotation @ block)
            mean += vector @ np.diag(np.log(value)) @ inv(vector) / n_block
        value, vector = np.linalg.eig(mean)
        result: ComplexArray = inv(rotation) @ (vector @ np.diag(np.exp(value)) @ inv(vector))
        return result

    def least_squares(k: int) -> ComplexArray:  # (3.10) as it reads
        both = sum(y[m, k] @ u[m, k].conj().T for m in range(n_block))
        return np.asarray(both @ inv(sum(u[m, k] @ u[m, k].conj().T for m in range(n_block))))

    def joint(k: int) -> ComplexArray:  # (3.14) as it reads
        both = sum(y[m, k] @ r[m, k].conj().T for m in range(n_block))
        return np.asarray(both @ inv(sum(u[m, k] @ r[m, k].conj().T for m in range(n_block))))

    def stacked() -> ComplexArray:
        both = zip(side_by_side(u), side_by_side(y), side_by_side(r), strict=True)
        return np.array([b @ c.conj().T @ inv(a @ c.conj().T) for a, b, c in both])

    def arithmetic(k: int) -> ComplexArray:
        result: ComplexArray = np.mean([y[m, k] @ inv(u[m, k]) for m in range(n_block)], axis=0)
        return result

    def harmonic(k: int) -> ComplexArray:
        return inv(np.mean([u[m, k] @ inv(y[m, k]) for m in range(n_block)], axis=0))

    def over_lines(line: Callable[[int], ComplexArray]) -> Callable[[], ComplexArray]:
        return lambda: np.array([line(k) for k in range(n_freq)])

    by_line = {"H1": least_squares, "ARI": arithmetic, "harmonic": harmonic, "JIO": joint, "LOG": logarithm}
    found = {name: over_lines(line) for name, line in by_line.items()}
    return {**found, STACKED: stacked}


def main() -> None:
    """Run the race and print its table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--lines", type=int, default=2000)
    parser.add_argument("--blocks", type=int, default=4)
    parser.add_argument("--axes", type=int, default=6)
    given = parser.parse_args()
    data = spectra(given.blocks, given.lines, given.axes)
    fast, slow = ours(*data), loops(*data)
    long = ours(*spectra(given.blocks, 4 * given.lines, given.axes))
    race, growth = (
        Race(
            {name + suffix: Contestant(calls[name], work) for name in NAMES for suffix, calls, work in both},
            given.rounds,
        )
        for both in (
            (("", fast, given.lines), (", loop", slow, given.lines)),
            (("", fast, given.lines), (", more", long, 4 * given.lines)),
        )
    )
    print(
        f"{given.axes} x {given.axes}, {given.blocks} blocks, {given.lines} lines, {given.rounds} rounds; "
        "microseconds a line"
    )
    for name in NAMES:
        ratio, more = race.ratio(name, f"{name}, loop"), growth.ratio(name, f"{name}, more")
        error = np.abs(fast[name]() - slow[name]()) / np.abs(slow[name]()).max(axis=(1, 2), keepdims=True)
        print(
            f"{name:9s} {1e6 / race.rate(name):7.2f}   loop {1e6 / race.rate(f'{name}, loop'):7.1f}   "
            f"{ratio:5.1f} x (wanted: 8 x)   a line of 4 x as many: {more:4.2f} x   "
            f"largest difference {error.max():.0e}"
        )
    side = Race(
        {"JIO": Contestant(fast["JIO"], given.lines), STACKED: Contestant(slow[STACKED], given.lines)},
        given.rounds,
    )
    print(f"{STACKED}: loop {1e6 / side.rate(STACKED):.1f}, {side.ratio('JIO', STACKED):.1f} x")


if __name__ == "__main__":
    main()
