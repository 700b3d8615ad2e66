"""Speed of the local rational method against a loop of `numpy.linalg.lstsq`, as a table.

    python tests/bench/local_rational.py [--rounds 9] [--noise 1e-3]

Six inputs, six outputs, a full matrix fraction of second order, windows of 41 lines (30 unknowns per output),
with 1, 6 and 24 experiments. Contestants take turns in this process on one thread; figures are medians over
rounds, per line. Both start from spectra; the loop forms the regressors of each window by numpy and calls
lstsq, ours is `estimation.local.kernel.solve_lines`, moments included. Data are the responses of `six_axis` in one
configuration to random inputs, with white noise relative to each output's root mean square. Then differences
to the loop on *every* line, with noise and without, on an even, a logarithmic and a random grid, ends of the
band included; the time of 20 000 lines x 24 experiments on two threads; and the cost per line over the number
of lines.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported
if str(Path(__file__).parent) not in sys.path:
    sys.path.append(str(Path(__file__).parent))

import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
from stopwatch import Contestant, Race  # noqa: E402

from robid_core import Robot  # noqa: E402
from robid_core.estimation.response.local.kernel import LineFits, solve_lines  # noqa: E402
from robid_core.estimation.response.local.model import LocalModel  # noqa: E402
from robid_core.estimation.response.local.window import Windows, windows_of_lines  # noqa: E402

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
IntArray = npt.NDArray[np.int64]

MODEL = LocalModel("mimo", 2, 2)
WINDOW = 41
WANTED = {1: 8, 6: 30, 24: 60}
BAND = (4.0, 80.0)


def spectra(
    frequency: FloatArray, n_exp: int, noise: float, generator: np.random.Generator
) -> tuple[ComplexArray, ComplexArray]:
    """Inputs and outputs of the robot at the lines, each (n_freq, 6, n_exp)."""
    robot = Robot.load("six_axis")
    angle = 0.4 * robot.drives.lower + 0.6 * robot.drives.upper
    response = robot.response(angle[None], frequency)[0]

    def gaussian(*shape: int) -> ComplexArray:
        parts = generator.standard_normal((2, *shape))
        result: ComplexArray = (parts[0] + 1j * parts[1]) / np.sqrt(2)
        return result

    u = gaussian(len(frequency), 6, n_exp)
    y = response @ u
    level = np.sqrt(np.mean(np.abs(y) ** 2, axis=(0, 2)))
    return u, y + noise * level[:, None] * gaussian(*y.shape)


def loop(u: ComplexArray, y: ComplexArray, windows: Windows, lines: IntArray) -> ComplexArray:
    """What one writes without robid, for some lines: (n_line, 6, 6)."""
    result = []
    for line in lines:
        inside = slice(windows.first[line], windows.last[line] + 1)
        t = (windows.frequency_hz[inside] - windows.frequency_hz[line]) / windows.half_width_hz[line]
        t = np.repeat(t, u.shape[2])[:, None]
        rows_u = u[inside].transpose(0, 2, 1).reshape(-1, 6)
        rows_y = y[inside].transpose(0, 2, 1).reshape(-1, 6)
        k = np.concatenate((rows_u, t * rows_u, t**2 * rows_u, -t * rows_y, -(t**2) * rows_y), axis=1)
        result.append(np.linalg.lstsq(k, rows_y, rcond=None)[0][:6].T)
    return np.array(result)


def difference(fits: LineFits, other: ComplexArray) -> FloatArray:
    """Largest difference of an entry at each line, relative to the largest entry there."""
    g = fits.theta[:, :6].swapaxes(1, 2)
    result: FloatArray = np.abs(g - other).max(axis=(1, 2)) / np.abs(other).max(axis=(1, 2))
    return result


def grids(n_line: int, generator: np.random.Generator) -> dict[str, FloatArray]:
    """Even, logarithmic and random lines."""
    return {
        "even": np.linspace(*BAND, n_line),
        "logarithmic": np.geomspace(*BAND, n_line),
        "random": np.sort(generator.uniform(*BAND, n_line)),
    }


def race(rounds: int, noise: float) -> None:
    """Print the race against the loop."""
    frequency = np.linspace(*BAND, 2000)
    windows = windows_of_lines(frequency, WINDOW)
    for n_exp, wanted in WANTED.items():
        u, y = spectra(frequency, n_exp, noise, np.random.default_rng(n_exp))
        few = np.linspace(0, len(frequency) - 1, 480 // (8 + n_exp)).astype(np.int64)
        calls: dict[str, tuple[Callable[[], object], int]] = {
            "ours": (lambda u=u, y=y: solve_lines(u, y, windows, MODEL), len(frequency)),  # type: ignore[misc]
            "loop": (lambda u=u, y=y, few=few: loop(u, y, windows, few), len(few)),  # type: ignore[misc]
        }
        turns = Race({name: Contestant(run, work) for name, (run, work) in calls.items()}, rounds)
        print(
            f"{n_exp:3d} experiments: {1e6 / turns.rate('ours'):7.1f} us a line, loop {1e6 / turns.rate('loop'):8.1f}: "
            f"{turns.ratio('ours', 'loop'):6.1f} x (wanted: {wanted} x)"
        )


def largest_differences(n_line: int) -> float:
    """Print differences to the loop on every line, and return the largest."""
    generator, worst = np.random.default_rng(0), 0.0
    for name, frequency in grids(n_line, generator).items():
        windows = windows_of_lines(frequency, WINDOW)
        for n_exp in WANTED:
            for noise in (1e-1, 1e-3, 1e-6, 1e-9, 0.0):
                u, y = spectra(frequency, n_exp, noise, generator)
                fits = solve_lines(u, y, windows, MODEL)
                away = difference(fits, loop(u, y, windows, np.arange(n_line))).max()
                worst = max(worst, float(away))
                ways = [int((fits.corrections == 0).sum()), int((fits.corrections > 0).sum())]
                print(
                    f"{name:12s} {n_exp:3d} experiments, noise {noise:5.0e}: {away:.1e} (lines by moments {ways[0]}, "
                    f"refined {ways[1]}, orthogonalised {n_line - sum(ways)})"
                )
    return worst


def main() -> None:
    """Run the race and print its tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--noise", type=float, default=1e-3)
    parser.add_argument("--lines", type=int, default=300, help="lines of each comparison")
    given = parser.parse_args()
    print(
        f"six_axis, 41 lines a window, 30 unknowns, noise {given.noise:g}, {given.rounds} rounds, one thread"
    )
    race(given.rounds, given.noise)
    print(f"largest difference to the loop {largest_differences(given.lines):.1e} (wanted: 1e-9)")
    for n_freq in (2500, 5000, 10_000, 20_000):
        frequency = np.linspace(*BAND, n_freq)
        windows = windows_of_lines(frequency, WINDOW)
        u, y = spectra(frequency, 24, given.noise, np.random.default_rng(0))
        taken = []
        for _ in range(3):
            start = time.perf_counter()
            solve_lines(u, y, windows, MODEL, threads=2)
            taken.append(time.perf_counter() - start)
        print(
            f"{n_freq} lines x 24 experiments on two threads: {min(taken):.2f} s, "
            f"{1e6 * min(taken) / n_freq:.1f} us a line" + (" (wanted: 2 s)" if n_freq == 20_000 else "")
        )


if __name__ == "__main__":
    main()
