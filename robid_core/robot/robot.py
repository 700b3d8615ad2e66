"""The nominal model, all that stages see: it can be linearised, simulated and written back.

A `Robot` is a description (what robot.yaml says) with the arrays made from it once. Everything of the motors
is at the motor shaft; `angle` is always the motor angle seen through the gear (r_g q_m, joint side).
"""

from __future__ import annotations

import functools
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from robid_core.errors import ConfigurationError, PluginError
from robid_core.gate import MotionLimits
from robid_core.registry import DYNAMICS, load_plugin
from robid_core.robot.arrays import DriveArrays, chain_of, drive_arrays, mechanism_of
from robid_core.robot.description import RobotDescription, named_parameters, with_values
from robid_core.robot.reading import find_robot, read_description

if TYPE_CHECKING:
    from robid_core.mechanics import (
        Chain,
        Equilibrium,
        LinearModel,
        Mechanism,
        ResponseGradient,
        SecondOrderModel,
        Simulation,
    )
    from robid_core.robot.plant import RobotPlant

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

KERNEL = "kernel"  # the compiled functions of robid_core.mechanics


class BatchedDynamics(Protocol):
    """What is registered under `robid.dynamics`: functions of robid_core.mechanics, computed in another way."""

    @property
    def solve_equilibrium(self) -> Callable[..., Equilibrium]: ...
    @property
    def second_order_model(self) -> Callable[..., SecondOrderModel]: ...
    @property
    def response(self) -> Callable[..., ComplexArray]: ...
    @property
    def response_with_gradient(self) -> Callable[..., ResponseGradient]: ...


@dataclass(frozen=True)
class Robot:
    """Chain, drives and elastic coordinates of one robot, with names for its unknowns."""

    description: RobotDescription
    dynamics: str = KERNEL
    """What computes equilibria, second-order models and responses: kernel, or a plugin of robid.dynamics.

    Another one rounds otherwise: whatever depends on the robot depends on this name too.
    """

    @classmethod
    def load(cls, name_or_path: str, folder: Path | None = None, dynamics: str = KERNEL) -> Robot:
        """Load a packaged robot by name, or a robot.yaml by path (relative to `folder`)."""
        robot = cls(read_description(find_robot(name_or_path, folder)), dynamics)
        _ = robot.mechanism, robot.drives  # a wrong inertia or an unknown joint is told now
        _ = robot.batches  # and so is a library that is missing
        return robot

    @property
    def batches(self) -> BatchedDynamics:
        """The functions that `dynamics` names.

        Raises ConfigurationError where no plugin has that name, PluginError where it cannot be imported; the
        message names the extra to install.
        """
        if self.dynamics != KERNEL:
            try:
                plugin: BatchedDynamics = load_plugin(DYNAMICS, self.dynamics)
            except PluginError as error:
                raise PluginError(f"robot uses dynamics '{self.dynamics}': {error}") from error
            return plugin
        from robid_core import mechanics

        kernels: BatchedDynamics = mechanics
        return kernels

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

    @property
    def sample_time_s(self) -> float:
        """Control, torque hold and trace share this time."""
        return self.description.sample_time_s

    @property
    def step_s(self) -> float:
        """Integration step of the simulator."""
        return self.description.step_s

    @functools.cached_property
    def chain(self) -> Chain:
        """Joints and bodies as arrays, elastic coordinates included."""
        return chain_of(self.description)

    @functools.cached_property
    def mechanism(self) -> Mechanism:
        """Chain with motors and gears: the map from motors to joints."""
        return mechanism_of(self.description, self.chain)

    @functools.cached_property
    def drives(self) -> DriveArrays:
        """Numbers of the drives as arrays over the axes."""
        return drive_arrays(self.description)

    # Names of what can be estimated -----------------------------------------------------------------

    def parameters(self) -> dict[str, float]:
        """Return every named parameter with its value."""
        data: Any = self.description.model_dump()
        found = {}
        for name, parameter in named_parameters(self.description).items():
            node = data
            for key in parameter.path:
                node = node[key]
            found[name] = float(node)
        return found

    def parameter_unit(self, name: str) -> str:
        """Return the unit of a named parameter."""
        return named_parameters(self.description)[name].unit

    def parameter_group(self, name: str) -> str:
        """Return the group of a named parameter: stiffness, damping, inertia, friction or drive."""
        return named_parameters(self.description)[name].group

    @functools.cached_property
    def stiffness_names(self) -> tuple[str, ...]:
        """Names of the springs' stiffness: gears in the order of axes, then bearings."""
        return tuple(n for n, p in named_parameters(self.description).items() if p.group == "stiffness")

    @functools.cached_property
    def damping_names(self) -> tuple[str, ...]:
        """Names of the dampers beside the springs, in the order of `stiffness_names`."""
        return tuple(n for n, p in named_parameters(self.description).items() if p.group == "damping")

    def with_parameters(self, values: Mapping[str, float]) -> Robot:
        """Return a robot with some named parameters changed.

        Raises ConfigurationError for a name that this robot does not have, or a value it cannot have.
        """
        known = named_parameters(self.description)
        unknown = [name for name in values if name not in known]
        if unknown:
            raise ConfigurationError(
                f"{self.name} has no parameter {', '.join(unknown)}; it has {', '.join(known)}"
            )
        try:
            changed = replace(self, description=with_values(self.description, dict(values)))
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"])
            raise ConfigurationError(f"{self.name}: {place} = {first['input']}: {first['msg']}") from error
        if not any(known[name].group == "inertia" for name in values):
            # Springs, dampers and friction leave the chain as it is: a fit changes them thousands of times.
            changed.__dict__.update(
                {k: self.__dict__[k] for k in ("chain", "mechanism") if k in self.__dict__}
            )
        return changed

    def spring_arrays(self) -> tuple[FloatArray, FloatArray]:
        """Return (stiffness, damping), each (n_spring,), in the order of `stiffness_names`."""
        values = self.parameters()
        return (
            np.array([values[name] for name in self.stiffness_names]),
            np.array([values[name] for name in self.damping_names]),
        )

    def to_yaml(self) -> str:
        """Write the whole robot, bodies inline: equal robots give equal text."""
        from ruamel.yaml import YAML

        stream = io.StringIO()
        yaml = YAML(typ="safe", pure=True)
        yaml.default_flow_style = None
        yaml.width = 120
        yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
        yaml.dump(self.description.model_dump(mode="json"), stream)
        return stream.getvalue()

    # Angles and limits ------------------------------------------------------------------------------

    def motor_angle(self, angle: npt.ArrayLike) -> FloatArray:
        """Motor angles (shaft side) of joint-side angles, shape (..., n_axis)."""
        joint = np.asarray(angle, dtype=float)
        result: FloatArray = np.linalg.solve(self.drives.gear, joint[..., None])[..., 0]
        return result

    def joint_angle(self, motor: npt.ArrayLike) -> FloatArray:
        """Joint-side angles of motor angles, shape (..., n_axis)."""
        result: FloatArray = np.asarray(motor, dtype=float) @ self.drives.gear.T
        return result

    @property
    def limits(self) -> MotionLimits:
        """Limits at the motors, as the safety gate takes them."""
        ends = np.stack([self.motor_angle(self.drives.lower), self.motor_angle(self.drives.upper)])
        return MotionLimits(
            self.axis_names,
            ends.min(axis=0),
            ends.max(axis=0),
            self.drives.speed_limit,
            self.drives.acceleration_limit,
        )

    # Equilibrium, linear model, response --------------------------------------------------------------

    def gravity_torque(self, angle: npt.ArrayLike) -> FloatArray:
        """Motor torque that holds the arm against gravity, shape (n_config, n_axis)."""
        stiffness, _ = self.spring_arrays()
        return self.batches.solve_equilibrium(self.mechanism, stiffness, self.motor_angle(angle)).torque

    def second_order(self, angle: npt.ArrayLike, motor_damping: FloatArray | None = None) -> SecondOrderModel:
        """Mass, damping and stiffness at the gravity equilibrium of each configuration, springs deflected.

        `motor_damping` (n_config, n_axis) replaces the robot's viscous friction.
        """
        stiffness, damping = self.spring_arrays()
        rest = self.batches.solve_equilibrium(self.mechanism, stiffness, self.motor_angle(angle))
        extra = self.drives.viscous if motor_damping is None else motor_damping
        extra = np.broadcast_to(extra, (*rest.position.shape[:-1], self.n_axis)).copy()
        return self.batches.second_order_model(self.mechanism, stiffness, damping, rest.position, extra)

    def linearize(
        self,
        angle: npt.ArrayLike,
        outputs: Sequence[str] = ("motor_acceleration",),
        motor_damping: FloatArray | None = None,
    ) -> LinearModel:
        """State space (2.5)-(2.7) at one configuration, shape (n_axis,), with named inputs and outputs.

        Outputs: motor_angle, motor_speed, motor_acceleration, arm_angle, joint_torque,
        frame_acceleration.<body>. Viscous friction is in it; Coulomb friction only through `motor_damping`
        (see `equivalent_motor_damping`), which replaces the viscous one.
        """
        from robid_core.mechanics import linear_model, solve_equilibrium

        stiffness, damping = self.spring_arrays()
        rest = solve_equilibrium(self.mechanism, stiffness, self.motor_angle(angle))
        extra = self.drives.viscous if motor_damping is None else motor_damping
        return linear_model(self.mechanism, stiffness, damping, rest.position, tuple(outputs), extra)

    def response(
        self,
        angle: npt.ArrayLike,
        frequency_hz: FloatArray,
        motor_damping: FloatArray | None = None,
        hold: str = "zero_order_hold",
    ) -> ComplexArray:
        """Response from motor torque to motor acceleration, shape (n_config, n_freq, n_axis, n_axis).

        With ``hold="zero_order_hold"`` torque is held between samples and position sampled at the instant;
        ``"continuous"`` is the plain (2.7).
        """
        model = self.second_order(angle, motor_damping)
        return self.batches.response(model, 2 * np.pi * frequency_hz, self._hold_time(hold))

    def response_with_gradient(
        self,
        angle: npt.ArrayLike,
        frequency_hz: FloatArray,
        motor_damping: FloatArray | None = None,
        hold: str = "zero_order_hold",
    ) -> ResponseGradient:
        """Response and the factors of its derivatives at a fixed equilibrium (see mechanics.response)."""
        model = self.second_order(angle, motor_damping)
        return self.batches.response_with_gradient(model, 2 * np.pi * frequency_hz, self._hold_time(hold))

    def _hold_time(self, hold: str) -> float | None:
        if hold not in ("zero_order_hold", "continuous"):
            raise ConfigurationError(f"hold: '{hold}' is neither zero_order_hold nor continuous")
        return self.sample_time_s if hold == "zero_order_hold" else None

    def equivalent_motor_damping(self, speed_rms: FloatArray, slow_sine_speed: FloatArray) -> FloatArray:
        """Gain E[df/dv] of Coulomb plus viscous friction that a multisine on top of a slow sine sees.

        Shapes (..., n_axis), rad/s in, N m s/rad out (statistical linearisation).
        """
        from robid_core.mechanics import equivalent_damping

        d = self.drives
        return equivalent_damping(speed_rms, slow_sine_speed, d.coulomb, d.viscous, d.friction_speed)

    # Simulation ---------------------------------------------------------------------------------------

    def simulate(
        self,
        speed_reference: FloatArray,
        angle: npt.ArrayLike,
        seed: int | None = None,
        position_reference: FloatArray | None = None,
    ) -> Simulation:
        """Closed loop from rest at the gravity equilibrium.

        Parameters
        ----------
        speed_reference
            rad/s at the motors, shape (n_lane, n_sample, n_axis).
        angle
            Joint-side motor angles at the start, shape (n_lane, n_axis).
        seed
            Draws the sensors' noise; None: none.
        position_reference
            Motor angles asked for, shape of `speed_reference`; by default its integral.
        """
        from robid_core.robot.plant import simulate_robot

        return simulate_robot(self, speed_reference, np.asarray(angle, dtype=float), seed, position_reference)

    def plant(self) -> RobotPlant:
        """Return this robot as the plant behind simulated drives."""
        from robid_core.robot.plant import RobotPlant

        return RobotPlant(self)
