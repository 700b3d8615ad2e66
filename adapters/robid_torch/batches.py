"""What `robot: {model: ..., dynamics: torch}` computes with: equilibria, linear models, responses, poses, in batches.

The functions have the names, arguments and results of their counterparts in `robid_core.mechanics`, numpy arrays in
and out, and agree with them within rounding (the tests say how far). On a processor one thread works, so that the same
batch gives the same bytes; a graphics card makes no such promise.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch  # type: ignore[import-not-found, unused-ignore]

from robid_core import ComplexArray, ConfigurationError, FloatArray
from robid_core.mechanics import (
    Chain,
    Equilibrium,
    Mechanism,
    MechanismChange,
    Pose,
    ResponseGradient,
    SecondOrderModel,
    SecondOrderSlopes,
    solve_equilibrium,
)
from robid_core.mechanics.equilibrium import ESCAPED, NEWTON_STEPS, SINGULAR, STEP_TOLERANCE
from robid_torch.kinematics import pose_by_chain
from robid_torch.lines import gradient_of_lines
from robid_torch.slopes import line_slopes, matrix_slopes, torque_slopes
from robid_torch.trees import Tree, bytes_per_position, tensor, terms_at, tree_of


@dataclass(frozen=True)
class TorchDynamics:
    """Dynamics of many configurations at once by PyTorch, within `memory_bytes` of memory.

    Used in YAML as::

        robot: {model: six_axis, dynamics: torch}       # on the processor
        robot: {model: six_axis, dynamics: torch.cuda}  # on a graphics card
    """

    device: str = "cpu"
    """cpu, or cuda for a graphics card."""
    memory_bytes: int = 256 * 2**20
    """What the matrices of one batch may take."""

    def solve_equilibrium(
        self, mechanism: Mechanism, stiffness: FloatArray, motor_angle: FloatArray
    ) -> Equilibrium:
        """Rest position at given motor angles, shape (..., n_axis).

        Where torch finds no stable one the kernel is asked: it names the coordinate that does not hold.
        """
        mechanism.check_springs(stiffness=stiffness)
        n_axis = mechanism.n_axis
        motor = np.asarray(motor_angle, dtype=np.float64)
        if motor.shape[-1:] != (n_axis,) or not np.isfinite(motor).all():
            return solve_equilibrium(mechanism, stiffness, motor)  # which says what is wrong
        joints, springs = mechanism.constraint_map, mechanism.spring_directions
        undeformed = np.zeros((mechanism.chain.n_coordinate, n_axis))
        undeformed[mechanism.arm] = mechanism.gear
        free = [mechanism.chain.index(name) for name in mechanism.coordinate_names[n_axis:]]
        start = np.concatenate((np.eye(n_axis), undeformed[free]))  # no spring is bent
        rows = motor.reshape(-1, n_axis) @ start.T
        torque = np.empty((len(rows), n_axis))
        with self._at_work() as device:
            tree, map_to_joints = tree_of(mechanism.chain, device), tensor(joints, device)
            spring = tensor((springs.T * stiffness) @ springs, device)
            for part in self._parts(tree, len(rows)):
                z = tensor(rows[part], device)
                if mechanism.n_coordinate > n_axis and not _sag(tree, map_to_joints, spring, z, n_axis):
                    return solve_equilibrium(mechanism, stiffness, motor)
                terms = terms_at(tree, z @ map_to_joints.T)
                rows[part] = z.cpu().numpy()
                held = terms.gravity_torque @ map_to_joints + z @ spring
                torque[part] = held[:, :n_axis].cpu().numpy()
        leading = motor.shape[:-1]
        return Equilibrium(
            rows.reshape(*leading, -1), (rows @ joints.T).reshape(*leading, -1), torque.reshape(*leading, -1)
        )

    def second_order_model(
        self,
        mechanism: Mechanism,
        stiffness: FloatArray,
        damping: FloatArray,
        position: FloatArray,
        motor_damping: FloatArray | None = None,
    ) -> SecondOrderModel:
        """Mass, damping and stiffness matrices at operating points, shape (..., n_coordinate)."""
        mechanism.check_springs(stiffness=stiffness, damping=damping)
        n_axis, n = mechanism.n_axis, mechanism.n_coordinate
        joints, springs = mechanism.constraint_map, mechanism.spring_directions
        z = np.asarray(position, dtype=np.float64)
        rows = (z @ joints.T).reshape(-1, mechanism.chain.n_coordinate)
        mass, stiff = np.empty((len(rows), n, n)), np.empty((len(rows), n, n))
        with self._at_work() as device:
            tree, map_to_joints = tree_of(mechanism.chain, device), tensor(joints, device)
            spring = tensor((springs.T * stiffness) @ springs, device)
            for part in self._parts(tree, len(rows)):
                terms = terms_at(tree, tensor(rows[part], device))
                mass[part] = (map_to_joints.T @ terms.mass @ map_to_joints).cpu().numpy()
                stiff[part] = (
                    (map_to_joints.T @ terms.gravity_stiffness @ map_to_joints + spring).cpu().numpy()
                )
        motors, shape = np.arange(n_axis), (*z.shape[:-1], n, n)
        mass[..., motors, motors] += mechanism.rotor_inertia
        damper = np.broadcast_to((springs.T * damping) @ springs, shape).copy()
        if motor_damping is not None:
            damper[..., motors, motors] += motor_damping
        return SecondOrderModel(mass.reshape(shape), damper, stiff.reshape(shape), np.eye(n, n_axis), springs)

    def response(
        self, model: SecondOrderModel, omega: FloatArray, hold_sample_time: float | None = None
    ) -> ComplexArray:
        """Response from motor torque to motor acceleration, shape (..., n_freq, n_axis, n_axis)."""
        no_springs = SecondOrderModel(
            model.mass, model.damping, model.stiffness, model.input_map, model.spring_directions[:0]
        )
        return self.response_with_gradient(no_springs, omega, hold_sample_time).response

    def response_with_gradient(
        self, model: SecondOrderModel, omega: FloatArray, hold_sample_time: float | None = None
    ) -> ResponseGradient:
        """Response, and the factors of its derivatives at fixed equilibrium."""
        with self._at_work() as device:
            return gradient_of_lines(model, omega, hold_sample_time, device, self.memory_bytes)

    def second_order_slopes(
        self,
        mechanism: Mechanism,
        stiffness: FloatArray,
        damping: FloatArray,
        position: FloatArray,
        change: MechanismChange,
    ) -> SecondOrderSlopes:
        """Derivatives of the matrices and of the holding torque along changes, shape (..., n_change)."""
        with self._at_work() as device:
            told = mechanism, stiffness, damping, position, change
            return matrix_slopes(*told, device, self.memory_bytes)

    def response_slopes(
        self,
        model: SecondOrderModel,
        slopes: SecondOrderSlopes,
        omega: FloatArray,
        hold_sample_time: float | None = None,
        motor_impedance: ComplexArray | None = None,
    ) -> ComplexArray:
        """Derivatives of the response, shape (n_config, n_freq, n_axis, n_axis, n_change)."""
        with self._at_work() as device:
            told = model, slopes, omega, hold_sample_time, motor_impedance
            return line_slopes(*told, device, self.memory_bytes)

    def torque_slopes(
        self, model: SecondOrderModel, slopes: SecondOrderSlopes, omega: FloatArray, swing: ComplexArray
    ) -> ComplexArray:
        """Derivatives of the torque that a motion takes, shape (n_config, n_freq, n_exp, n_axis, n_change)."""
        with self._at_work() as device:
            return torque_slopes(model, slopes, omega, swing, device, self.memory_bytes)

    def pose_of(
        self, chain: Chain, position: FloatArray, body: str, point: npt.ArrayLike = (0.0, 0.0, 0.0)
    ) -> Pose:
        """Pose and Jacobian of a point of a body, by pytorch-kinematics where its chains can be like ours."""
        with self._at_work() as device:
            return pose_by_chain(chain, position, body, point, device, self.memory_bytes)

    @contextlib.contextmanager
    def _at_work(self) -> Iterator[torch.device]:
        """Give the device, without gradients, and one thread: the same bytes whatever the machine is doing."""
        if self.device.startswith("cuda") and not torch.cuda.is_available():
            raise ConfigurationError(
                "robot: dynamics 'torch.cuda': torch finds no graphics card here; write dynamics: torch, or install a "
                "torch built for CUDA"
            )
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            with torch.no_grad():
                yield torch.device(self.device)
        finally:
            torch.set_num_threads(threads)

    def _parts(self, tree: Tree, count: int) -> Iterator[slice]:
        rows = max(1, self.memory_bytes // bytes_per_position(tree))
        for start in range(0, count, rows):
            yield slice(start, min(start + rows, count))


def _sag(tree: Tree, joints: torch.Tensor, spring: torch.Tensor, z: torch.Tensor, n_axis: int) -> bool:
    """Move the coordinates behind the motors, in place, until nothing pulls on them; False: they do not hold.

    A configuration at rest stays where it is while others still move: its neighbours do not change its bytes.
    """
    moving = torch.ones(len(z), 1, dtype=z.dtype, device=z.device)
    for _ in range(NEWTON_STEPS):
        terms = terms_at(tree, z @ joints.T)
        residual = (terms.gravity_torque @ joints + z @ spring)[:, n_axis:]
        tangent = (joints.T @ terms.gravity_stiffness @ joints + spring)[:, n_axis:, n_axis:]
        step, singular = torch.linalg.solve_ex(tangent, residual)
        if bool(singular.any()):
            return False
        step = step * moving
        z[:, n_axis:] -= step
        largest = z[:, n_axis:].abs().amax(1, keepdim=True)
        if not bool((largest < ESCAPED).all()):
            return False
        moving = moving * (step.abs().amax(1, keepdim=True) > STEP_TOLERANCE * (1 + largest))
        if not bool(moving.any()):
            floor = SINGULAR * tangent.abs().amax((1, 2))
            one = torch.eye(tangent.shape[-1], dtype=tangent.dtype, device=tangent.device)
            _, unstable = torch.linalg.cholesky_ex(tangent - floor[:, None, None] * one)
            return not bool(unstable.any())
    return False


PROCESSOR = TorchDynamics()
GRAPHICS_CARD = TorchDynamics("cuda", 4 * 2**30)
