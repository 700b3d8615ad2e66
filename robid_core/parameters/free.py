"""Free parameters as a vector without units, zero at the nominal robot, and the robots that such vectors mean.

Positive numbers change by their logarithm. A centre of mass moves in radii of gyration. The six moments of a body
change together: with the second moments ``S = tr(I) / 2 - I`` about the centre of mass, ``S = R exp(E) R`` with R the
root of the nominal one and E symmetric, so that no vector leads to a body that cannot be (P. M. Wensing, S. Kim, J.-J.
Slotine, Linear matrix inequalities for physically consistent inertial parameter identification, 2018: S is positive).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.parameters.choice import prior_of
from robid_core.parameters.scales import (
    LARGEST_CHANGE,
    LINEAR,
    LOGARITHM,
    MOMENT,
    default_prior,
    is_not_negative,
    linear_scale,
    scale_kind,
)
from robid_core.robot import Robot
from robid_core.robot.file.parameter_places import MOMENTS

SMALLEST_SHARE = 1e-6  # of the largest second moment: below it a body counts as flat, and stays so

NEAR = 1e-5  # of eigenvalues: the mean of two exponentials is their divided difference to 1e-11
INSIDE = 2e-3  # of coordinates: a difference may still be taken beside a bound


@dataclass(frozen=True, eq=False)
class FreeParameters:
    """Names, start values, priors and bounds of what a fit may change, in the order of the robot's names.

    >>> import robid_core as robid
    >>> robot = robid.Robot.load("one_axis")
    >>> free = robid.FreeParameters.of_robot(robot, ["gear_stiffness.axis_1", "gear_damping.axis_1"])
    >>> free.names, free.kinds, free.start.tolist()
    (('gear_stiffness.axis_1', 'gear_damping.axis_1'), ('logarithm', 'logarithm'), [80000.0, 60.0])
    """

    robot: Robot
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    """How each is changed: logarithm, linear or moment."""
    start: FloatArray
    """Nominal values, shape (n,)."""
    scale: FloatArray
    """Unit of those that are changed by adding; 1 for the others."""
    prior: FloatArray
    """Standard deviation in the natural scale, shape (n,)."""
    root: Mapping[str, FloatArray]
    """Root of the second moments of each body whose moments are free, (3, 3), by its joint."""

    @classmethod
    def of_robot(
        cls, robot: Robot, names: Sequence[str], priors: Mapping[str, float] | None = None
    ) -> FreeParameters:
        """Free some parameters of a robot; `priors` are standard deviations by pattern.

        Raises
        ------
        ConfigurationError
            Where a body has only some of its moments free, or a prior is given to what is held.
        """
        layout = robot.layout
        given = prior_of(names, dict(priors or {}), list(layout))
        start = np.array([robot.parameter(name) for name in names])
        kinds = tuple(scale_kind(layout[name], value) for name, value in zip(names, start, strict=True))
        root = {}
        for body in held_moments(names):
            raise ConfigurationError(all_or_none(body))
        for joint in dict.fromkeys(n.split(".")[1] for n, k in zip(names, kinds, strict=True) if k == MOMENT):
            root[joint] = _root(_second_moments(robot, joint))
        scale = np.array(
            [
                1.0
                if kind != LINEAR
                else _gyration(robot, name)
                if name.startswith("centre_of_mass.")
                else linear_scale(layout[name], value)
                for name, kind, value in zip(names, kinds, start, strict=True)
            ]
        )
        prior = np.array([given.get(name, default_prior(layout[name])) for name in names])
        return cls(robot, tuple(names), kinds, start, scale, prior, root)

    def without(self, held: Callable[[str], bool]) -> FreeParameters:
        """Return those of which `held` is not true; moments of a body are held together or not at all."""
        keep = [i for i, name in enumerate(self.names) if not held(name)]
        rows = np.array(keep, dtype=np.int64)
        names, kinds = (tuple(values[i] for i in keep) for values in (self.names, self.kinds))
        root = {joint: value for joint, value in self.root.items() if f"inertia.{joint}.xx" in names}
        return replace(
            self, names=names, kinds=kinds, start=self.start[rows], scale=self.scale[rows],
            prior=self.prior[rows], root=root,
        )  # fmt: skip

    @property
    def lower(self) -> FloatArray:
        """Smallest coordinates, shape (n,): as far as anything changes, and within the tables of effects."""
        return np.maximum(-LARGEST_CHANGE, np.minimum(self._ends(0) + INSIDE, 0.0))

    @property
    def upper(self) -> FloatArray:
        """Largest coordinates, shape (n,)."""
        return np.minimum(LARGEST_CHANGE, np.maximum(self._ends(1) - INSIDE, 0.0))

    def _ends(self, end: int) -> FloatArray:
        """Coordinates of the lower or the upper bounds in the tables of effects, infinite elsewhere, shape (n,)."""
        found = np.full(len(self.names), (-np.inf, np.inf)[end])
        layout = self.robot.layout
        for i, (name, kind, start) in enumerate(zip(self.names, self.kinds, self.start, strict=True)):
            row = layout[name].row
            if row is None:
                if not end and kind == LINEAR and is_not_negative(layout[name]):
                    found[i] = -start / self.scale[i]
                continue
            bound = (row.lower, row.upper)[end]
            if kind != LOGARITHM:
                found[i] = (bound - start) / self.scale[i]
            elif bound > 0:
                found[i] = np.log(bound / start)
        return found

    def values(self, point: FloatArray) -> dict[str, float]:
        """Return the parameters at a vector of coordinates, in their own units."""
        value = np.where(
            np.array(self.kinds) == LOGARITHM, self.start * np.exp(point), self.start + self.scale * point
        )
        found = dict(zip(self.names, value.tolist(), strict=True))
        index = {name: i for i, name in enumerate(self.names)}
        for joint, root in self.root.items():
            eigen, axes = np.linalg.eigh(self._change(joint, point, index))
            second = root @ (axes * np.exp(eigen)) @ axes.T @ root
            inertia = np.trace(second) * np.eye(3) - second
            found |= {f"inertia.{joint}.{moment}": float(inertia[entry]) for moment, entry in MOMENTS.items()}
        return found

    def slopes(self, point: FloatArray) -> FloatArray:
        """Derivative of each value for its own coordinate, shape (n,), but of moments: they change together."""
        logarithmic = np.array(self.kinds) == LOGARITHM
        slopes: FloatArray = np.where(logarithmic, self.start * np.exp(point * logarithmic), self.scale)
        return slopes

    def robot_at(self, point: FloatArray) -> Robot:
        """Return the robot that a vector of coordinates means."""
        return self.robot.with_parameters(self.values(point))

    def set_on(self, robot: Robot, point: FloatArray) -> Robot:
        """Return another robot with the parameters of a vector; what it does not have (a payload) leaves it alone."""
        known = robot.layout
        return robot.with_parameters(
            {name: value for name, value in self.values(point).items() if name in known}
        )

    def jacobian(self, point: FloatArray) -> FloatArray:
        """Derivative of the values for the coordinates, shape (n, n)."""
        result = np.diag(self.slopes(point))
        index = {name: i for i, name in enumerate(self.names)}
        for joint, root in self.root.items():
            rows = [index[f"inertia.{joint}.{moment}"] for moment in MOMENTS]
            eigen, axes = np.linalg.eigh(self._change(joint, point, index))
            growth = np.exp(eigen)
            apart = eigen[:, None] - eigen
            # Divided differences of the exponential (Daleckii and Krein); (e^a - e^b) / (a - b) without cancelling.
            mean = np.exp((eigen[:, None] + eigen) / 2)
            ratio = np.where(
                np.abs(apart) < NEAR, mean, (growth[:, None] - growth) / np.where(apart == 0, 1.0, apart)
            )
            for column, (i, j) in zip(rows, MOMENTS.values(), strict=True):
                unit = np.zeros((3, 3))
                unit[i, j] = unit[j, i] = 1.0
                second = root @ axes @ (ratio * (axes.T @ unit @ axes)) @ axes.T @ root
                inertia = np.trace(second) * np.eye(3) - second
                result[rows, column] = [inertia[entry] for entry in MOMENTS.values()]
        return result

    def _change(self, joint: str, point: FloatArray, index: Mapping[str, int]) -> FloatArray:
        """Symmetric E of a body, (3, 3)."""
        change = np.zeros((3, 3))
        for moment, (i, j) in MOMENTS.items():
            change[i, j] = change[j, i] = point[index[f"inertia.{joint}.{moment}"]]
        return change


def held_moments(names: Sequence[str]) -> dict[str, list[str]]:
    """Return the moments that are held of each body of which others are free, by `inertia.<joint>`."""
    bodies = dict.fromkeys(name.rpartition(".")[0] for name in names if name.startswith("inertia."))
    moments = {body: [f"{body}.{moment}" for moment in MOMENTS] for body in bodies}
    held = {body: [name for name in all_six if name not in names] for body, all_six in moments.items()}
    return {body: lacking for body, lacking in held.items() if lacking}


def all_or_none(body: str) -> str:
    """Say what is wrong where only some moments of a body are free."""
    return f"{body}: its moments are free together or not at all; free {body}.*"


def _second_moments(robot: Robot, joint: str) -> FloatArray:
    """Second moments of a body about its centre of mass, kg m^2, shape (3, 3)."""
    inertia = np.array(next(body.inertia for body in robot.description.bodies if body.joint == joint))
    result: FloatArray = np.trace(inertia) / 2 * np.eye(3) - inertia
    return result


def _root(second: FloatArray) -> FloatArray:
    """Symmetric root; flat bodies get a little thickness."""
    eigen, axes = np.linalg.eigh(second)
    root: FloatArray = (axes * np.sqrt(np.maximum(eigen, SMALLEST_SHARE * eigen[-1]))) @ axes.T
    return root


def _gyration(robot: Robot, name: str) -> float:
    """Radius of gyration of the body that a centre of mass belongs to, m."""
    joint = name.split(".")[1]
    mass = robot.parameter(f"mass.{joint}")
    radius = float(np.sqrt(max(np.trace(_second_moments(robot, joint)), 0.0) / mass))
    return radius if radius > 0 else 0.1  # a point mass: a decimetre
