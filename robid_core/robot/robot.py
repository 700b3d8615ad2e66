"""The nominal model, all that stages see: it can be linearised, simulated and written back.

A `Robot` is a description (what robot.yaml says) with the arrays made from it once. Everything of the motors
is at the motor shaft; `angle` is always the motor angle seen through the gear (r_g q_m, joint side).
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.errors import ConfigurationError, MotionRefused, PluginError
from robid_core.gate import MotionLimits
from robid_core.mechanics.terms import CHANNELS, ForceTerm, SignalTerm
from robid_core.registered import load_plugin
from robid_core.registry import DYNAMICS
from robid_core.robot import effects as laws
from robid_core.robot.arrays import DriveArrays, chain_of, drive_arrays, mechanism_of
from robid_core.robot.batched_dynamics import BatchedDynamics
from robid_core.robot.file.description import RobotDescription
from robid_core.robot.file.left_out import AxisKey, left_out
from robid_core.robot.file.named_parameters import with_parameters
from robid_core.robot.file.reading import find_robot, read_description
from robid_core.robot.identified import Identified
from robid_core.robot.inheritance import inherited
from robid_core.robot.motions import Motions
from robid_core.robot.unknowns import NamedUnknowns
from robid_core.robot.variants import Variants

if TYPE_CHECKING:
    from robid_core import mechanics

LIMITS: tuple[AxisKey, ...] = ("torque_limit", "speed_limit")  # without which nothing moves
KERNEL = "kernel"  # the compiled functions of robid_core.mechanics


@dataclass(frozen=True, repr=False)
class Robot(NamedUnknowns, Variants, Motions, Identified):
    """Chain, drives and elastic coordinates of one robot, with names for its unknowns.

    >>> robot = Robot.load("one_axis")
    >>> robot
    <Robot one_axis: axis_1, 29 parameters, effects: none>
    >>> robot.parameters()["gear_stiffness.axis_1"], robot.to_yaml().splitlines()[0]
    (80000.0, 'robid_robot: 1')
    >>> robot.to_urdf().splitlines()[1], robot.to_mjcf().splitlines()[0]
    ('<robot name="one_axis">', '<mujoco model="one_axis">')
    >>> robot.motor_angle([[0.5]]).round(3).tolist(), robot.joint_angle([[50.0]]).tolist()
    ([[50.0]], [[0.5]])
    >>> robot.gravity_torque([[0.5], [1.0]]).round(3).tolist()
    [[-1.115], [-1.759]]
    >>> rough = robot.with_effect("grease", "friction.stribeck", "axis_1", values={"breakaway": 1.2})
    >>> rough.without_effect("grease") == robot, rough.without_friction().parameter("friction.axis_1.coulomb")
    (True, 0.0)
    >>> from robid_core.mechanics import MotorMotion
    >>> still = MotorMotion(np.zeros((1, 1)), np.zeros((1, 1)), np.zeros((1, 40, 1)))  # for 40 steps, 10 samples
    >>> robot.prescribe(still).torque.shape
    (1, 10, 1)
    """

    description: RobotDescription
    dynamics: str = KERNEL
    """What computes equilibria, linear models, responses, derivatives and poses: kernel, or a plugin of robid.dynamics,
    which rounds otherwise: whatever depends on the robot depends on this name too."""
    base: RobotDescription | None = field(default=None, compare=False, repr=False)
    """What the robot file said, for a robot with other numbers or effects; null: this is no robot of a file."""
    file: Path | None = field(default=None, compare=False, repr=False)
    """The robot file that it was loaded from, for what is only drawn (`link_meshes`); null: none."""

    @classmethod
    def load(cls, name_or_path: str, folder: Path | None = None, dynamics: str = KERNEL) -> Robot:
        """Load a packaged robot by name, or a robot.yaml by path (relative to `folder`).

        >>> Robot.load("six_axis").axis_names[:2]
        ('axis_1', 'axis_2')
        """
        file = find_robot(name_or_path, folder)
        description = read_description(file)
        robot = cls(description, dynamics, description, file.absolute())
        _ = robot.mechanism, robot.drives, robot.batches  # wrong inertias and missing libraries are told now
        return robot

    def __repr__(self) -> str:
        effects = ", ".join(self.description.effects) or "none"
        return f"<Robot {self.name}: {', '.join(self.axis_names)}, {len(self.layout)} parameters, effects: {effects}>"

    @property
    def batches(self) -> BatchedDynamics:
        """The functions that `dynamics` names.

        Raises ConfigurationError where no plugin has that name, PluginError where it cannot be imported, or is none.
        """
        if self.dynamics == KERNEL:
            from robid_core import mechanics

            return mechanics
        try:
            plugin: BatchedDynamics = load_plugin(DYNAMICS, self.dynamics)
        except PluginError as error:
            raise PluginError(f"robot uses dynamics '{self.dynamics}': {error}") from error
        return plugin

    @property
    def name(self) -> str:
        """Name of the robot."""
        return self.description.name

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the motors' axes, in order."""
        return tuple(self.description.axes)

    @property
    def n_axis(self) -> int:
        """Number of motors."""
        return len(self.description.axes)

    def left_out(self, keys: Iterable[AxisKey]) -> str:
        """Say which of these keys of `axes` the robot file left out, and where; empty where it has all of them."""
        return left_out(self.description, keys)

    @property
    def sample_time_s(self) -> float:
        """Control, torque hold and trace share this time."""
        return self.description.sample_time_s

    @property
    def step_s(self) -> float:
        """Integration step of the simulator."""
        return self.description.step_s

    @functools.cached_property
    def structure(self) -> RobotDescription:
        """Description with the structure effects in it: what chain, mechanism and drives are made from."""
        return laws.structured(self) if self.description.effects else self.description

    @functools.cached_property
    def effects(self) -> tuple[laws.BoundEffect, ...]:
        """Force and signal effects at their places."""
        return laws.bound_effects(self)

    @functools.cached_property
    def terms_of_effects(self) -> dict[str, tuple[ForceTerm | SignalTerm, ...]]:
        """The laws of each force and signal effect by its label, as they were bound; filled when they are asked for."""
        return {}

    @functools.cached_property
    def forces(self) -> tuple[ForceTerm, ...]:
        """Laws that exert forces: the motors' friction and the force effects."""
        return laws.force_terms(self)

    @functools.cached_property
    def bending_forces(self) -> tuple[ForceTerm, ...]:
        """Laws that see something behind the motors: they decide where the arm rests."""
        return tuple(term for term in self.forces if term.coordinate[self.n_axis :].any())

    @functools.cached_property
    def signals(self) -> tuple[SignalTerm, ...]:
        """Laws on commands and measurements."""
        return laws.signal_terms(self)

    @functools.cached_property
    def is_possible(self) -> bool:
        """Whether the laws of its effects have these numbers: some ask that one of two is not above the other."""
        try:
            return self.forces is not None and self.signals is not None
        except ConfigurationError:
            return False

    @functools.cached_property
    def chain(self) -> mechanics.Chain:
        """Joints and bodies as arrays, elastic coordinates included."""
        return chain_of(self.structure)

    @functools.cached_property
    def mechanism(self) -> mechanics.Mechanism:
        """Chain with motors and gears: the map from motors to joints."""
        return mechanism_of(self.structure, self.chain)

    @functools.cached_property
    def drives(self) -> DriveArrays:
        """Numbers of the drives as arrays over the axes."""
        return drive_arrays(self.structure)

    def with_parameters(self, values: Mapping[str, float]) -> Robot:
        """Return a robot with some named parameters changed.

        Raises ConfigurationError for a name that this robot does not have, or a value it cannot have.

        >>> stiffer = Robot.load("one_axis").with_parameters({"gear_stiffness.axis_1": 1e5})
        >>> stiffer.parameter("gear_stiffness.axis_1")
        100000.0
        """
        description = with_parameters(self.description, values, self.layout)
        changed = replace(self, description=description)
        changed.__dict__.update(inherited(self, description, (self.layout[name] for name in values)))
        return changed

    def to_urdf(self) -> str:
        """Write the robot as URDF, elastic joints as joints of their own (see robot.urdf)."""
        from robid_core.robot.urdf import robot_to_urdf

        return robot_to_urdf(self)

    def to_mjcf(self) -> str:
        """Write the robot as MJCF, MuJoCo's description (see robot.mjcf)."""
        from robid_core.robot.mjcf import robot_to_mjcf

        return robot_to_mjcf(self)

    def motor_angle(self, angle: npt.ArrayLike) -> FloatArray:
        """Motor angles (shaft side) of joint-side angles, shape (..., n_axis)."""
        solved = np.linalg.solve(self.drives.gear, self._angles(angle)[..., None])
        return np.asarray(solved[..., 0], dtype=np.float64)

    def joint_angle(self, motor: npt.ArrayLike) -> FloatArray:
        """Joint-side angles of motor angles, shape (..., n_axis)."""
        result: FloatArray = self._angles(motor) @ self.drives.gear.T
        return result

    def _angles(self, angle: npt.ArrayLike) -> FloatArray:
        """Angles as an array; ConfigurationError where there is not one for each motor."""
        found, n = np.asarray(angle, dtype=float), self.n_axis
        if found.shape[-1:] != (n,):
            told = f"shape {found.shape}, expected (..., {n}): one angle for each of its {n} axes"
            raise ConfigurationError(f"{self.name}: angles of {told}")
        return found

    @property
    def limits(self) -> MotionLimits:
        """Limits at the motors, as the safety gate takes them.

        Raises MotionRefused where the robot file states no speed or torque limit: what is not known is no permission.
        """
        missing = self.left_out(LIMITS)
        if missing:
            raise MotionRefused(f"D03: {missing}; nothing was sent")
        ends = np.stack([self.motor_angle(self.drives.lower), self.motor_angle(self.drives.upper)])
        speed, acceleration = self.drives.speed_limit, self.drives.acceleration_limit
        return MotionLimits(self.axis_names, ends.min(axis=0), ends.max(axis=0), speed, acceleration)

    def gravity_torque(self, angle: npt.ArrayLike) -> FloatArray:
        """Motor torque that holds the arm against gravity, shape (n_config, n_axis)."""
        return self.equilibrium(angle).torque

    def equilibrium(self, angle: npt.ArrayLike, partial: bool = False) -> mechanics.Equilibrium:
        """Rest position under gravity at joint-side motor angles (n_config, n_axis), nonlinear springs included.

        Raises NotTrustworthy where a configuration has no stable rest; with `partial` such rows are NaN, and
        `Equilibrium.refused` says why.

        >>> Robot.load("one_axis").equilibrium([[0.5]]).position.round(4).tolist()  # motor, arm
        [[50.0, 0.5014]]
        """
        from robid_core.mechanics import solve_equilibrium

        motor, bent = self.motor_angle(angle), self.bending_forces
        at = (self.mechanism, self.spring_arrays()[0], motor)
        if partial:
            return solve_equilibrium(*at, bent, partial)
        key = (motor.shape, motor.tobytes())
        if (found := self._rest.get(key)) is None:
            found = solve_equilibrium(*at, bent) if bent else self.batches.solve_equilibrium(*at)
            for values in (found.position, found.joint, found.torque):
                values.setflags(write=False)
            self._rest.clear()  # threads may ask for others meanwhile: what is returned is not read from here
            self._rest[key] = found
        return found

    @functools.cached_property
    def _rest(self) -> dict[tuple[tuple[int, ...], bytes], mechanics.Equilibrium]:
        """The last rest by motor angles: linear model and weight ask for the same one after the other."""
        return {}

    def second_order(
        self,
        angle: npt.ArrayLike,
        motor_damping: FloatArray | None = None,
        motor_speed: tuple[FloatArray, FloatArray] | None = None,
    ) -> mechanics.SecondOrderModel:
        """Mass, damping and stiffness at the gravity equilibrium of each configuration, springs deflected.

        >>> Robot.load("one_axis").second_order([[0.5]]).stiffness[0, 0].round().tolist()
        [8.0, -800.0]

        Parameters
        ----------
        angle
            Joint-side motor angles, shape (n_config, n_axis).
        motor_damping
            Replaces the robot's viscous friction at the motors, N m s/rad, shape (n_config, n_axis).
        motor_speed
            (rms of the small signal, amplitude of the slow sine) of the motors' speeds, rad/s, shape (n_config, n_axis)
            each: what friction on the arm is linearised under. Left out, such friction has its viscous part only.
            Nonlinear springs have their slope at rest either way.
        """
        stiffness, damping = self.spring_arrays()
        rest = self.equilibrium(angle)
        own = laws.motor_viscosity(self) if self.effects else self.drives.viscous
        extra = own if motor_damping is None else motor_damping
        extra = np.broadcast_to(extra, (*rest.position.shape[:-1], self.n_axis)).copy()
        model = self.batches.second_order_model(self.mechanism, stiffness, damping, rest.position, extra)
        if not self.bending_forces:
            return model
        more = laws.added_terms(self, rest.position, motor_speed)
        return replace(
            model, stiffness=model.stiffness + more.stiffness, damping=model.damping + more.damping
        )

    def linearize(
        self,
        angle: npt.ArrayLike,
        outputs: Sequence[str] = ("motor_acceleration",),
        motor_damping: FloatArray | None = None,
    ) -> mechanics.LinearModel:
        """State space (2.5)-(2.7) at one configuration, shape (n_axis,), with named inputs and outputs.

        Outputs: motor_angle, motor_speed, motor_acceleration, arm_angle, joint_torque,
        frame_acceleration.<body>. Viscous friction is in it; Coulomb friction only through `motor_damping`
        (see `equivalent_motor_damping`), which replaces the viscous one.

        >>> Robot.load("one_axis").linearize([0.5], ["motor_speed", "joint_torque"]).output_names
        ('motor_speed.axis_1', 'joint_torque.axis_1')
        """
        from robid_core.mechanics import linear_model

        model, pose = self.second_order(angle, motor_damping), self.batches.pose_of
        at = (self.mechanism, *self.spring_arrays(), self.equilibrium(angle).position)
        return linear_model(*at, tuple(outputs), second_order=model, pose=pose)

    def response(
        self,
        angle: npt.ArrayLike,
        frequency_hz: FloatArray,
        motor_damping: FloatArray | None = None,
        hold: str = "zero_order_hold",
    ) -> ComplexArray:
        """Response from motor torque to motor acceleration, shape (n_config, n_freq, n_axis, n_axis).

        `motor_damping`, (n_config, n_axis), is what friction is under the motion (`equivalent_motor_damping`); without
        it there is only viscous friction, and a measured robot's stiffness comes out wrong. With
        ``hold="zero_order_hold"`` torque is held between samples and position sampled at the instant; ``"continuous"``
        is the plain (2.7). Signal effects (lag, delay, gain...) are in it as reported torque and
        measured position see them.

        >>> Robot.load("one_axis").response([[0.0]], np.array([10.0, 20.0])).shape
        (1, 2, 1, 1)
        """
        omega = 2 * np.pi * np.asarray(frequency_hz, dtype=float)
        plain = self.batches.response(self.second_order(angle, motor_damping), omega, self._hold_time(hold))
        if not self.signals:
            return plain
        acting, measured, reported = (laws.channel_gain(self, channel, omega) for channel in CHANNELS)
        distorted: ComplexArray = measured[:, :, None] * plain * (acting / reported)[:, None, :]
        return distorted

    def response_with_gradient(
        self,
        angle: npt.ArrayLike,
        frequency_hz: FloatArray,
        motor_damping: FloatArray | None = None,
        hold: str = "zero_order_hold",
    ) -> mechanics.ResponseGradient:
        """Response and the factors of its derivatives at a fixed equilibrium (see mechanics.response).

        Of the plant alone: signal effects are not in it.

        >>> Robot.load("one_axis").response_with_gradient([[0.5]], np.array([10.0, 20.0])).spring_vectors.shape
        (1, 2, 1, 1)
        """
        model = self.second_order(angle, motor_damping)
        return self.batches.response_with_gradient(model, 2 * np.pi * frequency_hz, self._hold_time(hold))

    def _hold_time(self, hold: str) -> float | None:
        if hold not in ("zero_order_hold", "continuous"):
            raise ConfigurationError(f"hold: '{hold}' is neither zero_order_hold nor continuous")
        return self.sample_time_s if hold == "zero_order_hold" else None

    def equivalent_motor_damping(
        self, speed_rms: FloatArray, slow_sine_speed: FloatArray, frequency_hz: npt.ArrayLike | None = None
    ) -> FloatArray:
        """Gain E[df/dv] of the motors' friction, effects included, that a multisine on top of a slow sine sees.

        Shapes (..., n_axis), rad/s in, N m s/rad out (statistical linearisation). The gain of a law with memory (Dahl,
        LuGre) depends on frequency: it is taken at the geometric mean of the lines, `frequency_hz`.
        """
        from robid_core.mechanics import equivalent_damping

        d = self.drives
        own = equivalent_damping(speed_rms, slow_sine_speed, d.coulomb, d.viscous, d.friction_speed)
        if not self.effects:
            return own
        return own + laws.motor_damping(self, speed_rms, slow_sine_speed, frequency_hz)
