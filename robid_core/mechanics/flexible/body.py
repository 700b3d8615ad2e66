"""A flexible body: its rigid body, and modes that hold its root still.

The floating frame is fixed to the root interface, so that the root's motion is the joint's and modal coordinates
only bend the body away from it. Constructors: `flexible_body` (finite elements), `assumed_modes` (beam).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy.linalg

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError

_SAME = 1e-7  # relative difference of w^2 below which two modes may be mixed
_MASSLESS = (
    1e-13  # 1 / w^2 relative to the lowest mode: stiffness without mass, which no time step can follow
)


@dataclass(frozen=True, eq=False)
class FlexibleBody:
    """An elastic body with its root at the origin; everything in axes of the root frame.

    The constructors give modes of the body clamped at the root, normalised to unit modal mass: a modal coordinate is
    in sqrt(kg) m, modal mass is 1, stiffness diag(w^2), damping diag(2 ratio w).

    Raises
    ------
    ConfigurationError
        For a wrong shape or a number that is not finite.
    """

    mass: float
    """kg."""
    centre_of_mass: FloatArray
    """m, undeformed, shape (3,)."""
    inertia: FloatArray
    """kg m^2 about the centre of mass, undeformed, shape (3, 3)."""
    tip: FloatArray
    """Where the tip interface stands, undeformed, m, shape (3,)."""
    tip_modes: FloatArray
    """Motion of the tip per unit modal coordinate, [rotation; translation], shape (6, n_mode)."""
    momentum: FloatArray
    """Momentum of the body per unit modal rate, [angular about the root; linear], shape (6, n_mode)."""
    modal_mass: FloatArray
    """(n_mode, n_mode)."""
    modal_stiffness: FloatArray
    """(n_mode, n_mode)."""
    modal_damping: FloatArray
    """(n_mode, n_mode)."""
    inertia_slope: FloatArray
    """Change of the inertia about the root per unit modal coordinate, shape (n_mode, 3, 3)."""

    def __post_init__(self) -> None:
        n = np.shape(self.modal_mass)[0]
        shapes: dict[str, tuple[int, ...]] = {
            "mass": (), "centre_of_mass": (3,), "inertia": (3, 3), "tip": (3,), "tip_modes": (6, n),
            "momentum": (6, n), "modal_mass": (n, n), "modal_stiffness": (n, n), "modal_damping": (n, n),
            "inertia_slope": (n, 3, 3),
        }  # fmt: skip
        for name, shape in shapes.items():
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.shape != shape or not np.isfinite(value).all():
                raise ConfigurationError(
                    f"flexible body: {name} has shape {value.shape}, expected {shape} finite numbers for {n} modes"
                )
            object.__setattr__(self, name, value if shape else float(value))

    @property
    def n_mode(self) -> int:
        """Number of modal coordinates."""
        return len(self.modal_mass)

    @property
    def frequency_hz(self) -> FloatArray:
        """Natural frequencies with the root clamped and the tip free, ascending, shape (n_mode,)."""
        square = scipy.linalg.eigvalsh(self.modal_stiffness, self.modal_mass)
        return np.asarray(np.sqrt(square) / (2 * np.pi), dtype=np.float64)

    def tip_stiffness(self, load: npt.ArrayLike) -> float:
        """Stiffness that the tip shows to a load [moment; force] with the root clamped: 1 / (load.compliance.load)."""
        answer = self.tip_modes.T @ np.asarray(load, dtype=np.float64)
        return float(1 / (answer @ np.linalg.solve(self.modal_stiffness, answer)))

    def placed(self, rotation: npt.ArrayLike, translation: npt.ArrayLike = (0.0, 0.0, 0.0)) -> FlexibleBody:
        """Return the same body seen from another frame, rigidly joined to the root.

        Parameters
        ----------
        rotation
            Axes of the root frame, as columns, in the new frame, shape (3, 3).
        translation
            Root in the new frame, m, shape (3,).
        """
        turn, shift = np.asarray(rotation, dtype=np.float64), np.asarray(translation, dtype=np.float64)
        if abs(turn @ turn.T - np.eye(3)).max() > 1e-6 or np.linalg.det(turn) < 0:
            raise ConfigurationError(
                "flexible body: its placement is no rotation matrix; give a right-handed one"
            )
        linear = turn @ self.momentum[3:]
        lever = shift[:, None] * linear.T[:, None, :]  # (n_mode, 3, 3) shift p^T
        inner = np.trace(lever, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        return replace(
            self,
            centre_of_mass=turn @ self.centre_of_mass + shift,
            inertia=turn @ self.inertia @ turn.T,
            tip=turn @ self.tip + shift,
            tip_modes=np.concatenate((turn @ self.tip_modes[:3], turn @ self.tip_modes[3:])),
            momentum=np.concatenate((turn @ self.momentum[:3] + np.cross(shift, linear.T).T, linear)),
            inertia_slope=turn @ self.inertia_slope @ turn.T + 2 * inner - lever - lever.transpose(0, 2, 1),
        )

    def truncated(self, n_mode: int, loads: npt.ArrayLike | None = None) -> FlexibleBody:
        """Return the body with its lowest modes only, and as many more as static tip loads need.

        What the modes left out would give to each load statically becomes one more shape (a residual attachment mode,
        R. H. MacNeal, Computers & Structures 1, 1971; S. Rubin, AIAA J. 13, 1975): the answer of the tip to a constant
        load stays exact. Shapes are made orthogonal again, so the springs stay diagonal; of the damping the diagonal is
        kept.

        Parameters
        ----------
        n_mode
            Lowest modes to keep.
        loads
            Tip loads [moment; force] as columns, shape (6, n_load), for example ``np.eye(6)``; none if left out.
        """
        if not 0 < n_mode <= self.n_mode:
            raise ConfigurationError(
                f"flexible body: {n_mode} modes to keep of {self.n_mode}; ask for 1 to {self.n_mode}"
            )
        square, modes = scipy.linalg.eigh(self.modal_stiffness, self.modal_mass)
        kept, rest = modes[:, :n_mode], modes[:, n_mode:]
        basis = kept
        if loads is not None and rest.shape[1]:
            answers = (rest.T @ self.tip_modes.T @ np.asarray(loads, dtype=np.float64)) / square[
                n_mode:, None
            ]
            answers = answers / np.maximum(np.linalg.norm(answers, axis=0), np.finfo(float).tiny)
            span, size, _unused = np.linalg.svd(answers, full_matrices=False)
            basis = np.column_stack((kept, rest @ span[:, size > 1e-9]))
        return _in_modes(self, basis)


def body_of_shapes(
    mass: float, centre_of_mass: FloatArray, inertia: FloatArray, tip: FloatArray,
    tip_shapes: FloatArray, momentum: FloatArray, shape_mass: FloatArray, shape_stiffness: FloatArray,
    inertia_slope: FloatArray, damping_ratio: float,
) -> FlexibleBody:  # fmt: skip
    """Flexible body from any shapes that hold the root still: modes are made of them, massless shapes left out.

    Parameters
    ----------
    mass, centre_of_mass, inertia, tip
        As in `FlexibleBody`.
    tip_shapes, momentum, shape_mass, shape_stiffness, inertia_slope
        As the modal fields of `FlexibleBody`, per unit of each shape.
    damping_ratio
        Of every mode, Lehr's D; 0.01 for welded steel, more with bolted joints.

    Raises
    ------
    ConfigurationError
        For a negative damping ratio, or where the shapes are not held by a positive definite stiffness.
    """
    if not 0 <= damping_ratio < 1:
        raise ConfigurationError(f"flexible body: damping ratio {damping_ratio:g}; give one of 0 to below 1")
    whole = FlexibleBody(
        mass, centre_of_mass, inertia, tip, tip_shapes, momentum, shape_mass, shape_stiffness,
        np.zeros_like(shape_mass), inertia_slope,
    )  # fmt: skip
    body = _in_modes(whole, np.eye(len(shape_mass)))
    return replace(body, modal_damping=2 * damping_ratio * np.sqrt(body.modal_stiffness))


def _in_modes(body: FlexibleBody, basis: FloatArray) -> FlexibleBody:
    """Body with the modes of a subspace of its modal coordinates, ascending, of unit modal mass."""
    inverse, modes = _inverse_squares(
        basis.T @ body.modal_mass @ basis, basis.T @ body.modal_stiffness @ basis
    )
    square = 1 / inverse
    modes = basis @ (modes * np.sqrt(square))
    length = max(float(np.linalg.norm(body.tip)), np.finfo(float).tiny)
    for start, stop in _equal_runs(square):
        turned = _turned((body.tip_modes @ modes[:, start:stop])[[3, 4, 5, 0, 1, 2]], length)
        modes[:, start:stop] = modes[:, start:stop] @ turned
    stiffness = np.diag(square)
    damping = np.einsum("ik,ij,jk->k", modes, body.modal_damping, modes)
    return replace(
        body,
        tip_modes=body.tip_modes @ modes,
        momentum=body.momentum @ modes,
        modal_mass=np.eye(len(square)),
        modal_stiffness=stiffness,
        modal_damping=np.diag(damping),
        inertia_slope=np.einsum("ik,iab->kab", modes, body.inertia_slope),
    )


def _inverse_squares(mass: FloatArray, stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
    """1 / w^2, descending, and modes of unit stiffness."""
    scale = 1 / np.sqrt(np.maximum(np.diag(stiffness), np.finfo(float).tiny))
    try:
        inverse, modes = scipy.linalg.eigh(mass * np.outer(scale, scale), stiffness * np.outer(scale, scale))
    except np.linalg.LinAlgError:
        raise ConfigurationError(
            "flexible body: with the root clamped its stiffness is not positive definite; is the tip connected to the "
            "root?"
        ) from None
    with_mass = np.flatnonzero(inverse > _MASSLESS * inverse[-1])[::-1]
    return inverse[with_mass], scale[:, None] * modes[:, with_mass]


def _equal_runs(square: FloatArray) -> list[tuple[int, int]]:
    """Begin and end of each run of equal frequencies."""
    ends = np.flatnonzero(np.diff(square) > _SAME * square[1:]) + 1
    return list(zip([0, *ends.tolist()], [*ends.tolist(), len(square)], strict=True))


def _turned(tip: FloatArray, length: float) -> FloatArray:
    """Rotation that gives modes of one frequency (bending of a square section) directions of the root frame.

    The first mode alone moves the tip in the first direction in which any of them does, and so on; signs are such that
    it does so positively. Rows are translations and then rotations of the tip.
    """
    tip = tip * np.array([1.0, 1.0, 1.0, length, length, length])[:, None]
    rows = tip[np.linalg.norm(tip, axis=1) > 1e-6 * np.linalg.norm(tip)]
    if not len(rows):
        return np.eye(tip.shape[1])
    turn, triangle = np.linalg.qr(rows.T, mode="complete")
    size = min(triangle.shape)
    signs = np.ones(len(turn))
    signs[:size] = np.where(np.diag(triangle) < 0, -1.0, 1.0)
    return np.asarray(turn * signs, dtype=np.float64)
