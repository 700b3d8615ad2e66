"""The robot linearised at a gravity equilibrium, (2.4)-(2.7): second-order form and state space.

At rest the velocity terms have no slope, so that ``M z'' + D z' + K z = B torque`` with
``K = sum_s k_s e_s e_s^T + T^T (dg/dq) T``: every spring and damper enters as one rank-one term.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.errors import ConfigurationError
from robid_core.mechanics.display import model_html
from robid_core.mechanics.dynamics import dynamics
from robid_core.mechanics.mechanism import Mechanism
from robid_core.mechanics.rest import terms_at_rest
from robid_core.mechanics.tool import Pose, pose_of

OUTPUTS = (
    "motor_angle",
    "motor_speed",
    "motor_acceleration",
    "arm_angle",
    "joint_torque",
    "frame_acceleration",
)


@dataclass(frozen=True)
class SecondOrderModel:
    """M z'' + D z' + K z = B torque; leading axes are configurations."""

    mass: FloatArray
    """(..., n_coordinate, n_coordinate)."""
    damping: FloatArray
    """(..., n_coordinate, n_coordinate)."""
    stiffness: FloatArray
    """(..., n_coordinate, n_coordinate), gravity included."""
    input_map: FloatArray
    """B, motor torque to coordinates, shape (n_coordinate, n_axis)."""
    spring_directions: FloatArray
    """Rows e_s, shape (n_spring, n_coordinate)."""

    @property
    def n_axis(self) -> int:
        """Number of motors."""
        return int(self.input_map.shape[1])


@dataclass(frozen=True, repr=False)
class LinearModel:
    """State space x' = A x + B u, y = C x + D u of deviations from the operating point (2.5)."""

    a: FloatArray
    b: FloatArray
    c: FloatArray
    d: FloatArray
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]

    def resonances(self) -> tuple[FloatArray, FloatArray]:
        """Frequencies in Hz and damping ratios of the modes that oscillate, lowest first."""
        values = np.linalg.eigvals(self.a)
        values = values[values.imag > 0]
        values = values[np.argsort(np.abs(values))]
        return np.abs(values) / (2 * np.pi), -values.real / np.abs(values)

    def __repr__(self) -> str:
        modes = ", ".join(f"{frequency:.3g} Hz" for frequency in self.resonances()[0])
        sizes = f"{len(self.a)} states, {self.d.shape[1]} inputs, {len(self.d)} outputs"
        return f"LinearModel: {sizes}; resonances: {modes or 'none'}"

    def _repr_html_(self) -> str:
        return model_html(self.resonances(), self.input_names, self.output_names, self.state_names)


def second_order_model(
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    position: FloatArray,
    motor_damping: FloatArray | None = None,
) -> SecondOrderModel:
    """Mass, damping and stiffness matrices at operating points.

    Parameters
    ----------
    mechanism
        Chain, gears and springs.
    stiffness, damping
        Of the springs, N m/rad and N m s/rad, shape (n_spring,).
    position
        Generalised coordinates of an equilibrium, shape (..., n_coordinate).
    motor_damping
        Viscous gain at the motor shafts, for example of friction by statistical linearisation, N m s/rad,
        shape (n_axis,) or (..., n_axis); none if left out.
    """
    mechanism.check_springs(stiffness=stiffness, damping=damping)
    n_axis, n = mechanism.n_axis, mechanism.n_coordinate
    springs, motors = mechanism.spring_directions, np.arange(n_axis)
    terms = terms_at_rest(mechanism, position)
    damper = np.broadcast_to((springs.T * damping) @ springs, terms.mass.shape).copy()
    if motor_damping is not None:
        damper[..., motors, motors] += motor_damping
    spring = terms.gravity_stiffness + (springs.T * stiffness) @ springs
    return SecondOrderModel(terms.mass, damper, spring, np.eye(n, n_axis), springs)


def linear_model(
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    position: FloatArray,
    outputs: Sequence[str] = ("motor_acceleration",),
    motor_damping: FloatArray | None = None,
    second_order: SecondOrderModel | None = None,
    pose: Callable[..., Pose] = pose_of,
) -> LinearModel:
    """State-space model (2.5)-(2.6) with named outputs; x = [z; z'], u = motor torque.

    Parameters
    ----------
    mechanism, stiffness, damping, motor_damping
        As in `second_order_model`.
    position
        Generalised coordinates of an equilibrium, shape (n_coordinate,).
    outputs
        Any of motor_angle, motor_speed, motor_acceleration (motor side), arm_angle, joint_torque (on the arm,
        joint side; by the gear spring or the rigid gear alike) and frame_acceleration.<body>: of the origin
        of that body's joint frame, world axes, m/s^2.

    second_order
        The robot at that position, where more than springs, dampers and gravity acts on it.
    pose
        What computes poses of bodies, with the arguments of `pose_of`.

    Raises
    ------
    ConfigurationError
        For an unknown output or body.
    """
    model = second_order or second_order_model(mechanism, stiffness, damping, position, motor_damping)
    n_axis, n, joints = mechanism.n_axis, mechanism.n_coordinate, mechanism.constraint_map
    inverse_mass = np.linalg.inv(model.mass)
    a = np.block(
        [[np.zeros((n, n)), np.eye(n)], [-inverse_mass @ model.stiffness, -inverse_mass @ model.damping]]
    )
    b = np.concatenate((np.zeros((n, n_axis)), inverse_mass @ model.input_map))
    angle, speed = np.eye(n, 2 * n), np.eye(n, 2 * n, n)
    acceleration, input_acceleration = a[n:], b[n:]
    terms = dynamics(mechanism.chain, joints @ position)
    arm_mass = (terms.mass @ joints)[mechanism.arm]
    arm_gravity = (terms.gravity_stiffness @ joints)[mechanism.arm]
    none = np.zeros((n_axis, n_axis))
    known = {
        "motor_angle": (angle[:n_axis], none),
        "motor_speed": (speed[:n_axis], none),
        "motor_acceleration": (acceleration[:n_axis], input_acceleration[:n_axis]),
        "arm_angle": (joints[mechanism.arm] @ angle, none),
        "joint_torque": (arm_mass @ acceleration + arm_gravity @ angle, arm_mass @ input_acceleration),
    }
    c_rows, d_rows, names = [], [], []
    for output in outputs:
        kind, _, body = output.partition(".")
        if output in known:
            c, d = known[output]
            names += [f"{output}.{axis}" for axis in mechanism.axis_names]
        elif kind == "frame_acceleration" and body:
            jacobian = pose(mechanism.chain, joints @ position, body).jacobian[3:] @ joints
            c, d = jacobian @ acceleration, jacobian @ input_acceleration
            names += [f"{output}.{direction}" for direction in "xyz"]
        else:
            raise ConfigurationError(
                f"linearize: no output '{output}'; there are {', '.join(OUTPUTS)} "
                f"(the last with a body, as in frame_acceleration.{mechanism.axis_names[-1]})"
            )
        c_rows.append(c)
        d_rows.append(d)
    return LinearModel(
        a=a,
        b=b,
        c=np.concatenate(c_rows),
        d=np.concatenate(d_rows),
        state_names=(*mechanism.coordinate_names, *(f"{name}.rate" for name in mechanism.coordinate_names)),
        input_names=tuple(f"torque.{axis}" for axis in mechanism.axis_names),
        output_names=tuple(names),
    )
