"""Blind cases: a drawn robot, a drawn plant on MuJoCo with nothing, one or two hidden laws, and what its sensors show.

One number draws all: what is told, by how much springs, friction and inertia are off, poses, phases, controller, the
fraction of a sample by which torques act late, and the law with its size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from blind import laws
from blind.foreign_plant import ForeignPlant, HiddenLaw
from robid_core import Channel, DenseRun, FreeParameters, Record, Robot

PERIOD, SETTLE, KEPT = 3000, 1, 2  # samples; periods
CONFIGURATIONS, EXPERIMENTS = 6, 2
NOISE = 0.001  # of the torque limit
TOLD_OFF, INERTIA_OFF = 0.3, 0.01

FAMILIES = {
    "friction.asymmetric": ("friction.asymmetric",),
    "friction.stribeck": ("friction.stribeck",),
    "friction.load_dependent": ("friction.load_dependent",),
    "friction.dahl": ("friction.dahl", "friction.lugre", "friction.elasto_plastic"),
    "friction.lugre": ("friction.lugre", "friction.elasto_plastic"),
    "transmission.backlash": ("transmission.backlash", "transmission.soft_zone"),
    "transmission.stiffening": ("transmission.stiffening",),
    "transmission.hysteresis": ("transmission.maxwell_slip", "transmission.bouc_wen", "friction.dahl"),
    "drive.torque_ripple": ("drive.torque_ripple", "drive.cogging"),
    "sensing.resolver_ripple": ("sensing.resolver_ripple",),
    "transmission.kinematic_error": ("transmission.kinematic_error",),
    "drive.current_loop": ("drive.current_loop",),
    "load.cable_spring": ("load.cable_spring",),
    "drive.saturation": ("drive.saturation",),
    "body": ("body", "load.payload"),
    "rotor": ("rotor", "drive.rotor_inertia"),
}
"""Kinds that are hidden, and the names that are right: a law and its special cases."""


@dataclass(frozen=True, eq=False)
class BlindCase:
    """What a diagnosis is given, and what it should find."""

    seed: int
    kind: str
    """Of what is hidden; empty: nothing."""
    told: Robot
    record: Record
    late: float
    """Samples."""
    size: float
    """Of the law, in its own unit."""


def blind_case(seed: int, kind: str, base: str = "one_axis") -> BlindCase:
    """Draw and measure a case."""
    generator = np.random.default_rng([seed, sorted(["", *FAMILIES]).index(kind)])
    told = _told(Robot.load(base), generator)
    truth = _true(told, generator)
    size, hidden = 0.0, list[HiddenLaw]()
    axis = int(generator.integers(truth.n_axis))
    if kind in ("body", "rotor"):
        size = float(generator.choice([-1, 1]) * generator.uniform(0.08, 0.3))
        body = f"mass.{truth.description.bodies[-1].joint}"
        name = body if kind == "body" else f"rotor_inertia.{truth.axis_names[axis]}"
        truth = truth.with_parameters({name: truth.parameter(name) * (1 + size)})
    elif kind:
        one = _law(kind, truth, axis, generator)
        size, hidden = one.numbers[0], [one]
    late = float(generator.integers(0, 5)) / 8
    plant = ForeignPlant(truth, hidden, late)
    lower, upper = np.maximum(truth.drives.lower, -2.0) * 0.6, np.minimum(truth.drives.upper, 2.0) * 0.6
    poses = generator.uniform(lower, upper, (CONFIGURATIONS, truth.n_axis))
    lines = np.unique(
        2 * np.round((np.geomspace(3.0, 80.0, 60) * PERIOD * truth.sample_time_s - 1) / 2).astype(int) + 1
    )
    shown = []
    for pose in np.repeat(poses, EXPERIMENTS, axis=0):
        reference = np.tile(_reference(lines, truth, generator), (SETTLE + KEPT, 1))
        limit = np.array(truth.drives.torque_limit)
        shown.append(plant.measure(reference, pose, generator, NOISE * limit))
    position, torque = (np.stack(one)[:, SETTLE * PERIOD :] for one in zip(*shown, strict=True))
    shape = (CONFIGURATIONS, 1, EXPERIMENTS, KEPT, PERIOD, truth.n_axis)
    channels = {
        "motor_position": Channel("motor", "rad", position.reshape(shape)),
        "motor_torque": Channel("motor", "N m", torque.reshape(shape)),
    }
    time = truth.sample_time_s * np.arange(PERIOD)
    run = DenseRun(truth.sample_time_s, channels, time, np.ones(shape[:5], dtype=bool))
    record = Record(told.axis_names, "MuJoCo", "zero_order_hold", (run,), poses, line=lines)
    return BlindCase(seed, kind, told, record, late, size)


def _told(robot: Robot, generator: np.random.Generator) -> Robot:
    """A robot of its own: masses, springs, rotors and friction by up to a factor of two, another controller."""
    heads = (
        "mass",
        "gear_stiffness",
        "gear_damping",
        "bearing_stiffness",
        "bearing_damping",
        "rotor_inertia",
    )
    values = {
        name: robot.parameter(name) * 2 ** generator.uniform(-0.7, 0.7)
        for name in robot.layout
        if name.split(".")[0] in heads or name.endswith((".coulomb", ".viscous"))
    }
    values |= {
        name: robot.parameter(name) * 2 ** generator.uniform(-0.4, 0.4)
        for name in robot.layout
        if name.startswith("controller.") and name.endswith("_gain") and robot.parameter(name) > 0
    }
    return robot.with_parameters(values)


def _true(told: Robot, generator: np.random.Generator) -> Robot:
    """The plant: springs, dampers and friction a third off, all inertial numbers one percent."""
    off = [
        name
        for name in told.layout
        if told.parameter_kind(name) in ("stiffness", "damping")
        or (name.startswith("friction.") and not name.endswith("offset"))
    ]
    values = {n: told.parameter(n) * np.exp(TOLD_OFF * generator.uniform(-1, 1)) for n in off}
    heads = ("mass", "centre_of_mass", "inertia", "rotor_inertia")
    free = FreeParameters.of_robot(told, [n for n in told.layout if n.split(".")[0] in heads])
    values |= free.values(INERTIA_OFF * generator.standard_normal(len(free.names)))
    return told.with_parameters(values)


def _reference(lines: np.ndarray, robot: Robot, generator: np.random.Generator) -> np.ndarray:
    """One period of motor speeds, rad/s, (PERIOD, n_axis): a multisine on a slow sine."""
    time = robot.sample_time_s * np.arange(PERIOD)
    period = PERIOD * robot.sample_time_s
    columns = []
    for _ in range(robot.n_axis):
        phase = generator.uniform(0, 2 * np.pi, len(lines))
        wave = np.cos(2 * np.pi * np.outer(time, lines / period) + phase).sum(axis=1)
        slow = np.sin(4 * np.pi * time / period + generator.uniform(0, 2 * np.pi))
        columns.append(4.0 * wave / wave.std() + 10.0 * slow)
    return np.stack(columns, axis=1)


def _law(kind: str, robot: Robot, axis: int, generator: np.random.Generator) -> HiddenLaw:
    """Draw a law's size, over a factor of four."""
    size = float(2 ** generator.uniform(-1, 1))
    n = robot.mechanism.n_coordinate
    motor, gear = np.eye(n)[axis], robot.mechanism.spring_directions[axis]
    joint = robot.mechanism.constraint_map[robot.mechanism.arm[axis]]
    level = float(robot.drives.coulomb[axis])
    ratio = 1 / float(robot.drives.gear[axis, axis])
    stiffness = robot.parameter(f"gear_stiffness.{robot.axis_names[axis]}")
    order, phase = float(generator.integers(2, 13)), float(generator.uniform(0, 2 * np.pi))
    bent = 2.0 * level * ratio / stiffness  # rad, of a gear under some times its friction
    slow, power = float(generator.uniform(2, 6)), float(generator.uniform(1, 2))
    drawn: dict[str, tuple[int, tuple[float, ...], np.ndarray]] = {
        "friction.asymmetric": (laws.ASYMMETRIC, (0.1 * size * level,), motor),
        "friction.stribeck": (laws.STRIBECK, (0.3 * size * level, slow, power), motor),
        "friction.load_dependent": (laws.BY_LOAD, (0.03 * size,), motor),
        "friction.dahl": (laws.DAHL, (0.3 * size * level, 60 * size * level), motor),
        "friction.lugre": (laws.LUGRE, (0.3 * size * level, 60 * size * level, 0.1 * size * level, 1.5), motor),
        "transmission.backlash": (laws.BACKLASH, (0.1 * size * bent,), gear),
        "transmission.stiffening": (laws.STIFFENING, (0.1 * size * stiffness / bent**2,), gear),
        "transmission.hysteresis": (laws.HYSTERESIS, (0.02 * size * stiffness * bent, 0.05 * size * stiffness), gear),
        "drive.torque_ripple": (laws.RIPPLE, (0.03 * size * level, order, phase), motor),
        "sensing.resolver_ripple": (laws.RESOLVER, (2e-3 * size, order, phase), motor),
        "transmission.kinematic_error": (laws.GEAR_WAVE, (0.03 * size * bent, order, phase), gear),
        "drive.current_loop": (laws.LAG, (1e-3 * size,), motor),
        "load.cable_spring": (laws.CABLE, (20 * size, 0.0, 0.0), joint),
        "drive.saturation": (laws.SATURATION, (6.0 * size * level,), motor),
    }  # fmt: skip
    number, numbers, row = drawn[kind]
    return HiddenLaw(number, axis, tuple(float(value) for value in numbers), row)
