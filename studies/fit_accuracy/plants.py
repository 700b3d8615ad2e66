"""Plants of the study: a robot with springs 25-40 % off, and what else a scenario hides."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid_core import FloatArray, FreeParameters, Robot, chosen_names

OTHERS = 0.3  # dampers and friction are off by as much at most
INERTIA = ("mass.*", "centre_of_mass.*", "inertia.*", "rotor_inertia.*")
PAYLOAD = {"x": 0.03, "y": -0.02, "z": 0.1, "radius_of_gyration": 0.06}  # m, of what a tool carries


@dataclass(frozen=True)
class Hidden:
    """What is not in a plant's robot file, or changed in it, beside springs, dampers and friction."""

    inertia: float = 0.0
    """Standard deviation of all inertial numbers, in natural scales."""
    stribeck: bool = False
    """Friction falls with speed, by a law of random shape."""
    late: float = 0.0
    """Samples between the measured torque and its action."""
    torque_ripple: float = 0.0
    """Amplitude over the torque limit."""
    resolver_ripple: float = 0.0
    """Amplitude, rad at the motor."""

    def __or__(self, other: Hidden) -> Hidden:
        """Return both together."""
        return replace(self, **{key: value for key, value in vars(other).items() if value})


@dataclass(frozen=True, eq=False)
class Plant:
    """A true robot, what it hides, and what is told of it."""

    nominal: Robot
    robot: Robot
    hidden: Hidden
    breakaway: FloatArray
    """Excess of friction at standstill, N m, shape (n_axis,); likewise the others."""
    stribeck_speed: FloatArray
    exponent: FloatArray
    torque_ripple: FloatArray
    torque_order: FloatArray
    resolver_ripple: FloatArray
    resolver_order: FloatArray

    @property
    def true_stiffness(self) -> FloatArray:
        """In the order of the nominal robot's springs."""
        return np.array([self.robot.parameter(name) for name in self.nominal.stiffness_names])

    def loaded(self, mass: float) -> Plant:
        """Return the plant with a payload at the tool, which is told: kg."""
        nominal, robot = (
            one.with_effect(
                "payload", "load.payload", on=one.axis_names[-1], values={"mass": mass, **PAYLOAD}
            )
            for one in (self.nominal, self.robot)
        )
        return replace(self, nominal=nominal, robot=robot)


def drawn(seed: tuple[int, ...], hidden: Hidden, told: str = "six_axis", as_told: bool = False) -> Plant:
    """Draw a plant.

    Parameters
    ----------
    seed
        Of the generator.
    hidden
        What is not told.
    told
        The nominal robot, by name or path.
    as_told
        Springs, dampers and friction are the nominal ones; otherwise springs are 25 to 40 % off, upwards or downwards.
    """
    nominal, generator = Robot.load(told), np.random.default_rng(seed)
    robot, n = nominal if as_told else _moved(nominal, generator), nominal.n_axis
    if hidden.inertia:
        names = chosen_names(list(nominal.layout), INERTIA)
        free = FreeParameters.of_robot(robot, names)
        robot = free.robot_at(hidden.inertia * generator.standard_normal(len(names)))
    coulomb = np.array([robot.parameter(f"friction.{axis}.coulomb") for axis in robot.axis_names])
    return Plant(
        nominal,
        robot,
        hidden,
        breakaway=coulomb * generator.uniform(0.2, 0.8, n) * hidden.stribeck,
        stribeck_speed=generator.uniform(2.0, 20.0, n),
        exponent=generator.uniform(1.0, 2.0, n),
        torque_ripple=hidden.torque_ripple * np.array(robot.drives.torque_limit),
        torque_order=generator.choice([4.0, 6.0, 12.0], n),
        resolver_ripple=np.full(n, hidden.resolver_ripple),
        resolver_order=generator.choice([1.0, 2.0, 4.0], n),
    )


def _moved(nominal: Robot, generator: np.random.Generator) -> Robot:
    """Return a robot with other springs, dampers and friction."""
    moved = {}
    for name, value in nominal.parameters().items():
        kind = nominal.parameter_kind(name)
        if kind == "stiffness":
            moved[name] = value * (1 + generator.choice([-1, 1]) * generator.uniform(0.25, 0.4))
        elif kind == "damping" or (kind == "friction" and not name.endswith((".speed", ".offset"))):
            moved[name] = value * (1 + generator.uniform(-OTHERS, OTHERS))
    return nominal.with_parameters(moved)
