"""Lengths of recordings whose Fourier transforms are quick: a large prime in a length makes them ten times slower."""

from __future__ import annotations

LEFT_OUT = 0.01  # of a recording, at most
MOST = 500  # samples, likewise: enough to find a quick length, however long a recording is
WORTH_IT = 0.5  # of the work: what saves less is not worth a sample


def quick_length(n_sample: int) -> int:
    """Return how many samples to keep, a hundredth less at most, for transforms of them and of their odd continuation.

    All of them, unless that halves the work at least. A continuation has 2 (n - 1) samples (`windowed.py`).
    """
    fewest = max(2, n_sample - min(MOST, int(LEFT_OUT * n_sample)))
    best = min(range(n_sample, fewest - 1, -1), key=_work)
    return best if _work(best) < WORTH_IT * _work(n_sample) else n_sample


def _work(n_sample: int) -> int:
    """Operations of both, up to a factor: length times the sum of its prime factors (Cooley and Tukey 1965)."""
    return sum(length * sum(_prime_factors(length)) for length in (n_sample, 2 * (n_sample - 1)))


def _prime_factors(number: int) -> list[int]:
    found, factor = [], 2
    while factor * factor <= number:
        while number % factor == 0:
            found.append(factor)
            number //= factor
        factor += 1
    return [*found, number] if number > 1 else found
