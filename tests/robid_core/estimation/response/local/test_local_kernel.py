"""The kernel, its plain form and numpy's least squares: three ways to the same numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robid_core.estimation.response.local.compiled import compiled_fit
from robid_core.estimation.response.local.kernel import solve_lines
from robid_core.estimation.response.local.model import LocalModel
from robid_core.estimation.response.local.plain import plain_fit
from robid_core.estimation.response.local.window import Windows, windows_of_lines, windows_of_width
from robid_core.testing.plants import MassSpringPlant

GRIDS = {
    "even": np.linspace(10, 80, 70),
    "logarithmic": np.geomspace(10, 80, 70),
    "random": np.sort(np.random.default_rng(3).uniform(10, 80, 70)),
}


def gaussian(generator: np.random.Generator, *shape: int) -> Any:
    parts = generator.standard_normal((2, *shape))
    return (parts[0] + 1j * parts[1]) / np.sqrt(2)


def spectra(frequency: Any, n_axis: int, n_exp: int, noise: float, seed: int = 0) -> tuple[Any, Any]:
    generator = np.random.default_rng(seed)
    u = gaussian(generator, len(frequency), n_axis, n_exp)
    y = MassSpringPlant.of(n_axis).response(frequency) @ u
    level = np.sqrt(np.mean(np.abs(y) ** 2, axis=(0, 2)))[:, None]
    return u, y + noise * level * gaussian(generator, *y.shape)


def least_squares(u: Any, y: Any, windows: Windows, model: LocalModel) -> tuple[Any, Any]:
    """Thesis (3.20) with (3.31) by numpy, line by line: responses and residual products."""
    responses, products = [], []
    n_in = u.shape[1]
    for line, (first, last) in enumerate(zip(windows.first, windows.last, strict=True)):
        t = (
            np.array(windows.frequency_hz[first : last + 1] - windows.frequency_hz[line])
            / windows.half_width_hz[line]
        )
        t = np.repeat(t, u.shape[2])[:, None]
        rows_u, rows_y = (x[first : last + 1].swapaxes(1, 2).reshape(-1, x.shape[1]) for x in (u, y))
        columns = [t**s * rows_u for s in range(model.numerator_order + 1)]
        columns += [-(t**s) * rows_y for s in range(1, model.denominator_order + 1)]
        k = np.concatenate(columns, axis=1)
        theta = np.linalg.lstsq(k, rows_y, rcond=None)[0]
        residual = rows_y - k @ theta
        responses.append(theta[:n_in].T)
        products.append(residual.T @ residual.conj())
    return np.array(responses), np.array(products)


def away(one: Any, other: Any) -> float:
    """Largest difference at a line relative to the largest entry there."""
    size = np.abs(other).max(axis=tuple(range(1, other.ndim)))
    return float((np.abs(one - other).max(axis=tuple(range(1, other.ndim))) / size).max())


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("noise", [1e-1, 1e-4, 1e-8, 0.0])
@pytest.mark.parametrize("n_exp", [1, 6, 24])
def test_kernel_agrees_with_least_squares_on_every_line(grid: str, noise: float, n_exp: int) -> None:
    # Six axes, second order, 41 lines: 30 unknowns. Without noise K is singular to rounding and normal
    # equations break.
    frequency = GRIDS[grid]
    u, y = spectra(frequency, 6, n_exp, noise)
    windows, model = windows_of_lines(frequency, 41), LocalModel("mimo")
    fits = solve_lines(u, y, windows, model)
    response, products = least_squares(u, y, windows, model)
    assert away(fits.theta[:, :6].swapaxes(1, 2), response) < 1e-9
    if noise >= 1e-4:
        # Normal equations serve down to residual powers of 1e-9 (`RESIDUAL`); differences of sums over 41 to 984 rows
        # with 1e-16 to 1e-14 of rounding leave five digits of them.
        assert away(fits.products, products) < 1e-5
    # 1e-9 is not reached by one way alone: little noise takes refinement or orthogonalisation.
    if noise == 0.1:
        assert (fits.corrections == 0).all()
    if noise == 0:
        assert (fits.corrections != 0).any()


@pytest.mark.parametrize(
    "model",
    [
        LocalModel("mimo", 2, 2),
        LocalModel("mimo", 3, 1),
        LocalModel("mimo", 1, 2),
        LocalModel("mimo", 2, 0),
        LocalModel("mimo", 0, 0),
    ],
    ids=str,
)
@pytest.mark.parametrize("n_axis", [1, 2, 3])
def test_kernel_agrees_with_its_plain_form_in_all_it_gives(model: LocalModel, n_axis: int) -> None:
    frequency = GRIDS["random"]
    u, y = spectra(frequency, n_axis, 2, 0.03)
    windows = windows_of_width(frequency, 30.0)  # windows of different size
    assert len(np.unique(windows.size)) > 3
    fast, plain = compiled_fit(u, y, windows, model), plain_fit(u, y, windows, model)
    for name in ("numerator", "denominator"):
        assert away(getattr(fast, name), getattr(plain, name)) < 1e-9, name
    assert away(fast.own_gram(), plain.own_gram()) < 1e-7
    freedom = np.array([model.freedom(int(size), n_axis, n_axis, 2) for size in windows.size])
    everything = np.ones(len(frequency), dtype=bool)
    gram, covariance = fast.factors(freedom, everything, None, None)
    plain_gram, plain_covariance = plain.factors(freedom, everything, None, None)
    ours, theirs = (
        np.einsum("fii,fjj->fij", c, g).real for c, g in ((covariance, gram), (plain_covariance, plain_gram))
    )
    # The same variances but for the Kronecker product, which the plain form fits to all entries and the kernel
    # to each output's own part.
    differences = np.abs(np.log(ours / theirs))
    assert np.median(differences) < 0.01
    assert differences.max() < 0.25  # a polynomial over a resonance, whose errors hang together most


def test_results_do_not_depend_on_threads_nor_on_the_lines_beside() -> None:
    frequency = GRIDS["even"]
    u, y = spectra(frequency, 3, 4, 1e-3)
    windows, model = windows_of_lines(frequency, 13), LocalModel("mimo")
    one, two = (solve_lines(u, y, windows, model, with_influence=True, threads=n) for n in (1, 2))
    for name in ("theta", "products", "influence", "free", "ratio"):
        assert np.asarray(getattr(one, name)).tobytes() == np.asarray(getattr(two, name)).tobytes()
    some = solve_lines(u[:30], y[:30], windows_of_lines(frequency[:30], 13), model, with_influence=True)
    assert some.theta[:20] == pytest.approx(one.theta[:20], rel=1e-12)


def test_an_input_that_never_moves_is_seen_in_the_pivots() -> None:
    frequency = GRIDS["even"]
    u, y = spectra(frequency, 2, 3, 1e-3)
    u[:, 1] = 0
    fits = solve_lines(u, y, windows_of_lines(frequency, 13), LocalModel("mimo"))
    assert (fits.ratio < 1e-12).all()
    assert np.isfinite(fits.theta).all()
