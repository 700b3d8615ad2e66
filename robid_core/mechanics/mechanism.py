"""A chain with its motors, gears and springs: the coordinates of the extended flexible joint model.

Joint angles q of the chain follow from the generalised coordinates z = [motor angles; every joint that is not
geared rigidly] by a constant map, q = T z. A gear spring acts on (gear @ motor angle) - (arm joint), a bearing
spring on its elastic joint (thesis eq. 2.2), so that spring s sees the deflection e_s^T z. Rigid axes, coupled
wrists and elastic arms differ in T and e_s only.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.chain import Chain


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A chain of bodies with motors, gears and springs.

    Raises
    ------
    ConfigurationError
        Where sizes do not fit, or an axis or coordinate is named twice.
    """

    chain: Chain
    """The bodies."""
    gear: FloatArray
    """Joint angle = gear @ motor angle: inverse gear ratios r_g; shape (n_axis, n_axis)."""
    rotor_inertia: FloatArray
    """kg m^2 at the motor shaft; shape (n_axis,)."""
    arm: IntArray
    """Joint of the chain that each axis drives; shape (n_axis,)."""
    elastic: IntArray
    """Joints of the chain that a bearing spring holds; shape (n_elastic,)."""
    elastic_gear: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
    """Whether a gear spring stands between motor and arm; without it the gear is rigid; shape (n_axis,)."""
    constraint_map: FloatArray = field(init=False)
    """T, shape (n_joint, n_coordinate)."""
    spring_directions: FloatArray = field(init=False)
    """Rows e_s, gear springs in the order of axes and then bearings; shape (n_spring, n_coordinate)."""
    coordinate_names: tuple[str, ...] = field(init=False)
    """"motor.<axis>" and names of joints; length n_coordinate."""

    def __post_init__(self) -> None:
        for name, kind in _KINDS.items():
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=kind, order="C"))
        n_axis, n_joint = len(self.arm), self.chain.n_coordinate
        for name, shape in {
            "gear": (n_axis, n_axis),
            "rotor_inertia": (n_axis,),
            "elastic_gear": (n_axis,),
        }.items():
            value = getattr(self, name)
            if value.shape != shape or not np.isfinite(value).all():
                raise ConfigurationError(
                    f"mechanism: {name} needs {shape} finite numbers for {n_axis} axes, it has shape {value.shape}"
                )
        driven = [*self.arm.tolist(), *self.elastic.tolist()]
        if sorted(driven) != list(range(n_joint)):
            raise ConfigurationError(
                f"mechanism: joints {driven} are driven or elastic, the chain has joints 0 to {n_joint - 1}; every "
                "joint is either the arm joint of one axis or one elastic joint"
            )
        if (self.rotor_inertia < 0).any() or ((self.rotor_inertia == 0) & self.elastic_gear).any():
            axis = self.axis_names[int(np.argmin(self.rotor_inertia))]
            raise ConfigurationError(
                f"mechanism: {axis}: rotor inertia {self.rotor_inertia.min():.6g} kg m^2; give a positive one "
                "(zero is possible where the gear is rigid)"
            )
        if n_axis and np.linalg.matrix_rank(self.gear) < n_axis:
            raise ConfigurationError(
                "mechanism: the gear matrix is singular; every motor must move its own axis"
            )
        self._derive()

    def _derive(self) -> None:
        n_axis, n_joint = len(self.arm), self.chain.n_coordinate
        rigid = {int(joint): a for a, joint in enumerate(self.arm) if not self.elastic_gear[a]}
        free = [j for j in range(n_joint) if j not in rigid]
        place = {joint: n_axis + i for i, joint in enumerate(free)}
        joints = np.zeros((n_joint, n_axis + len(free)))
        for joint in range(n_joint):
            if joint in rigid:
                joints[joint, :n_axis] = self.gear[rigid[joint]]
            else:
                joints[joint, place[joint]] = 1.0
        springs = [
            np.r_[self.gear[a], -joints[self.arm[a], n_axis:]] for a in np.flatnonzero(self.elastic_gear)
        ]
        springs += [joints[j] for j in self.elastic]
        names = (*(f"motor.{name}" for name in self.axis_names), *(self.chain.names[j] for j in free))
        object.__setattr__(self, "constraint_map", joints)
        object.__setattr__(self, "spring_directions", np.array(springs).reshape(-1, joints.shape[1]))
        object.__setattr__(self, "coordinate_names", names)

    def with_bodies(self, chain: Chain) -> Mechanism:
        """Return the mechanism on a chain with the same joints and other bodies."""
        other = copy.copy(self)
        object.__setattr__(other, "chain", chain)
        return other

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the arm joints, one an axis."""
        return tuple(self.chain.names[joint] for joint in self.arm)

    @property
    def n_axis(self) -> int:
        """Number of motors."""
        return len(self.arm)

    @property
    def n_coordinate(self) -> int:
        """Number of generalised coordinates."""
        return int(self.constraint_map.shape[1])

    @property
    def n_spring(self) -> int:
        """Number of gear and bearing springs."""
        return int(self.spring_directions.shape[0])

    def check_springs(self, **values: FloatArray) -> None:
        """Refuse spring constants of the wrong number, negative or not finite."""
        for name, value in values.items():
            if (
                np.shape(value) != (self.n_spring,)
                or not (np.isfinite(value) & (np.asarray(value) >= 0)).all()
            ):
                raise ConfigurationError(
                    f"mechanism: {name} needs {self.n_spring} finite numbers >= 0, one a spring; it is {value}"
                )


_KINDS: dict[str, type] = {
    "gear": np.float64,
    "rotor_inertia": np.float64,
    "arm": np.int64,
    "elastic": np.int64,
    "elastic_gear": np.bool_,
}
