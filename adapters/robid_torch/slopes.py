"""Derivatives of linear models, responses and motor torques by automatic differentiation.

The functions give what their counterparts in `robid_core.mechanics.slopes` give, which know the derivatives in closed
form or by differences; here the matrices at rest, the response and the torque are written once as functions, and torch
differentiates them. Forward mode (`jvp`, mapped over the rows of a `MechanismChange`) is taken, since reverse mode with
its 72 real outputs a line took 1.5 to 3.4 times as long for 46 and 66 parameters of six axes
(`python tests/bench/backends.py modes`). Batches are cut so that one of them fits into a stated memory.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator

import numpy as np
import torch  # type: ignore[import-not-found, unused-ignore]

from robid_core import ComplexArray, FloatArray
from robid_core.mechanics import Mechanism, MechanismChange, SecondOrderModel, SecondOrderSlopes
from robid_core.mechanics.response import hold_factor
from robid_torch.lines import bytes_per_line
from robid_torch.trees import Tree, bytes_per_position, tensor, terms_at, tree_of, with_bodies

Tensors = tuple[torch.Tensor, ...]


def matrix_slopes(
    mechanism: Mechanism,
    stiffness: FloatArray,
    damping: FloatArray,
    position: FloatArray,
    change: MechanismChange,
    device: torch.device,
    memory_bytes: int,
) -> SecondOrderSlopes:
    """Differentiate mass, damping and stiffness matrices and the holding torque, the sag included.

    Arguments as of `robid_core.mechanics.second_order_slopes`, and of `TorchDynamics`.
    """
    n_axis, n, count = mechanism.n_axis, mechanism.n_coordinate, len(change)
    z = np.asarray(position, dtype=np.float64)
    rows = z.reshape(-1, n)
    found = [np.zeros((len(rows), *shape, count)) for shape in ((n, n), (n, n), (n, n), (n_axis,))]
    index = change.of_mechanism()
    if len(index):
        tree, whole = tree_of(mechanism.chain, device), change.rows(index)
        numbers = tuple(tensor(getattr(mechanism.chain, name), device) for name in OF_CHAIN)
        numbers += tensor(mechanism.rotor_inertia, device), tensor(mechanism.gear, device)
        tangents = tuple(
            tensor(getattr(whole, name), device) for name in (*OF_CHAIN, "rotor_inertia", "gear")
        )
        size = 3 * bytes_per_position(tree)
        for some in _parts(len(index), max(1, memory_bytes // size - 1)):
            along = tuple(part[some] for part in tangents)
            at_once = max(1, memory_bytes // (size * (1 + len(along[0]))))
            for part in _parts(len(rows), at_once):
                at_rest = _at_rest(mechanism, tree, stiffness, damping, rows[part], device)
                for kept, slope in zip(found, forward_mode(at_rest, numbers, along), strict=True):
                    kept[part, ..., index[some]] = slope.cpu().numpy()
    shaped = [part.reshape(*z.shape[:-1], *part.shape[1:]) for part in found]
    return SecondOrderSlopes(shaped[0], shaped[1], shaped[2], shaped[3], change)


OF_CHAIN = ("mass", "centre_of_mass", "inertia")


def _at_rest(
    mechanism: Mechanism,
    tree: Tree,
    stiffness: FloatArray,
    damping: FloatArray,
    rows: FloatArray,
    device: torch.device,
) -> Callable[..., Tensors]:
    """Return matrices and holding torque as a function of bodies, rotors and gears, at rest near some positions.

    One step of Newton's method with the tangent of `rows`, where nothing pulls, has the slope of the equilibrium.
    """
    n_axis, joints, springs = mechanism.n_axis, mechanism.constraint_map, mechanism.spring_directions
    rigid = np.flatnonzero(~mechanism.elastic_gear)
    geared = np.flatnonzero(mechanism.elastic_gear)
    of_joint, of_spring = np.zeros((len(joints), n_axis)), np.zeros((len(springs), n_axis))
    of_joint[mechanism.arm[rigid], rigid] = 1.0
    of_spring[np.arange(len(geared)), geared] = 1.0
    behind_joints, behind_springs = (tensor(part[:, n_axis:], device) for part in (joints, springs))
    gear_joints, gear_springs = tensor(of_joint, device), tensor(of_spring, device)
    k, d = tensor(stiffness, device), tensor(damping, device)
    angle = tensor(rows[:, :n_axis] @ mechanism.gear.T, device)
    behind = tensor(rows[:, n_axis:], device)
    held = tensor((springs.T * stiffness) @ springs, device)
    map_to_joints = tensor(joints, device)
    terms = terms_at(tree, tensor(rows, device) @ map_to_joints.T)
    tangent = (map_to_joints.T @ terms.gravity_stiffness @ map_to_joints + held)[:, n_axis:, n_axis:]

    def matrices(
        mass: torch.Tensor,
        centre: torch.Tensor,
        inertia: torch.Tensor,
        rotor: torch.Tensor,
        gear: torch.Tensor,
    ) -> Tensors:
        bodies = with_bodies(tree, mass, centre, inertia)
        to_joints = torch.cat((gear_joints @ gear, behind_joints), 1)
        to_springs = torch.cat((gear_springs @ gear, behind_springs), 1)
        spring = (to_springs.T * k) @ to_springs
        motor = torch.linalg.solve(gear, angle.T).T
        z = torch.cat((motor, behind), 1)
        if behind.shape[1]:
            pull = terms_at(bodies, z @ to_joints.T).gravity_torque @ to_joints + z @ spring
            step = torch.linalg.solve(tangent, pull[:, n_axis:, None])[..., 0]
            z = torch.cat((motor, behind - step), 1)
        terms = terms_at(bodies, z @ to_joints.T)
        rotors = torch.nn.functional.pad(torch.diag(rotor), (0, behind.shape[1], 0, behind.shape[1]))
        return (
            to_joints.T @ terms.mass @ to_joints + rotors,
            ((to_springs.T * d) @ to_springs).expand(len(z), -1, -1),
            to_joints.T @ terms.gravity_stiffness @ to_joints + spring,
            (terms.gravity_torque @ to_joints + z @ spring)[:, :n_axis],
        )

    return matrices


def line_slopes(
    model: SecondOrderModel,
    slopes: SecondOrderSlopes,
    omega: FloatArray,
    hold_sample_time: float | None,
    motor_impedance: ComplexArray | None,
    device: torch.device,
    memory_bytes: int,
) -> ComplexArray:
    """Differentiate the response; arguments as of `robid_core.mechanics.response_slopes`, and of `TorchDynamics`."""
    inputs, n_axis = tensor(model.input_map, device), model.n_axis
    hold, image = (
        torch.tensor(factor, device=device)[:, None, None] for factor in hold_factor(omega, hold_sample_time)
    )

    def responses(configs: slice, part: slice) -> Callable[..., Tensors]:
        w = tensor(omega[part], device)[:, None, None]
        extra = (
            None if motor_impedance is None else torch.tensor(motor_impedance[configs, part], device=device)
        )

        def of_matrices(mass: torch.Tensor, damping: torch.Tensor, stiffness: torch.Tensor) -> Tensors:
            moved = moved_per_torque(mass, damping, stiffness, inputs, w, extra)
            inertial = (inputs.T @ torch.linalg.solve(mass, inputs))[:, None]
            return (-(w**2) * hold[part] * moved[..., :n_axis, :] + image[part] * inertial,)

        return of_matrices

    return _lines(model, slopes, responses, (len(omega), n_axis, n_axis), device, memory_bytes)


def torque_slopes(
    model: SecondOrderModel,
    slopes: SecondOrderSlopes,
    omega: FloatArray,
    swing: ComplexArray,
    device: torch.device,
    memory_bytes: int,
) -> ComplexArray:
    """Differentiate motor torques; arguments as of `robid_core.mechanics.torque_slopes`, and of `TorchDynamics`."""
    inputs, n_axis = tensor(model.input_map, device), model.n_axis

    def torques(configs: slice, part: slice) -> Callable[..., Tensors]:
        w = tensor(omega[part], device)[:, None, None]
        motion = torch.tensor(np.swapaxes(swing[configs, part], 2, 3), device=device)

        def of_matrices(mass: torch.Tensor, damping: torch.Tensor, stiffness: torch.Tensor) -> Tensors:
            moved = moved_per_torque(mass, damping, stiffness, inputs, w, None)
            return (torch.linalg.solve(moved[..., :n_axis, :], motion).transpose(2, 3),)

        return of_matrices

    return _lines(model, slopes, torques, swing.shape[1:], device, memory_bytes)


def moved_per_torque(
    mass: torch.Tensor,
    damping: torch.Tensor,
    stiffness: torch.Tensor,
    inputs: torch.Tensor,
    w: torch.Tensor,
    motor_impedance: torch.Tensor | None,
) -> torch.Tensor:
    """All coordinates per motor torque, (n_config, n_freq, n_coordinate, n_axis); matrices (n_config, n, n)."""
    mass, damping, stiffness = mass[:, None], damping[:, None], stiffness[:, None]
    impedance = torch.complex(stiffness - w**2 * mass, w * damping)
    if motor_impedance is not None:
        behind = mass.shape[-1] - motor_impedance.shape[-1]
        impedance = impedance + torch.nn.functional.pad(
            torch.diag_embed(motor_impedance), (0, behind, 0, behind)
        )
    moved: torch.Tensor = torch.linalg.solve(impedance, inputs.to(impedance.dtype))
    return moved


def _lines(
    model: SecondOrderModel,
    slopes: SecondOrderSlopes,
    function_at: Callable[[slice, slice], Callable[..., Tensors]],
    shape: tuple[int, ...],
    device: torch.device,
    memory_bytes: int,
) -> ComplexArray:
    """Differentiate a function of the matrices, some configurations, lines and changes at a time."""
    n_config, n, count = len(model.mass), model.mass.shape[-1], len(slopes.change)
    found = np.empty((n_config, *shape, count), dtype=np.complex128)
    own = own_changes(model, slopes.change)
    matrices = model.mass, model.damping, model.stiffness
    changes = slopes.mass, slopes.damping + own[0], slopes.stiffness + own[1]
    size = bytes_per_line(n, model.n_axis)
    for some in _parts(count, max(1, memory_bytes // size - 1)):
        at_once = max(1, memory_bytes // (size * (1 + len(range(count)[some]))))  # lines
        for configs in _parts(n_config, max(1, at_once // shape[0])):
            at = tuple(tensor(part[configs], device) for part in matrices)
            along = tuple(tensor(np.moveaxis(part[configs, ..., some], -1, 0), device) for part in changes)
            for part in _parts(shape[0], at_once):
                (slope,) = forward_mode(function_at(configs, part), at, along)
                found[configs, part, ..., some] = slope.cpu().numpy()
    return found


def own_changes(model: SecondOrderModel, change: MechanismChange) -> tuple[FloatArray, FloatArray]:
    """What dampers, motors' friction and springs change of D and K by themselves, (n, n, n_change)."""
    directions, motors = model.spring_directions, np.arange(model.n_axis)
    damping, stiffness = (
        np.einsum("sm,ps,sn->mnp", directions, part, directions)
        for part in (change.damping, change.stiffness)
    )
    damping[motors, motors] += change.motor_damping.T
    return damping, stiffness


def forward_mode(function: Callable[..., Tensors], at: Tensors, along: Tensors) -> Tensors:
    """Derivatives of a function's results along rows of changes, the row as last axis."""

    def one(*row: torch.Tensor) -> Tensors:
        slopes: Tensors = torch.func.jvp(function, at, row)[1]
        return slopes

    with (
        warnings.catch_warnings()
    ):  # the first use of forward mode loads parts of torch that torch itself deprecates
        warnings.filterwarnings("ignore", "`torch.jit.script`", DeprecationWarning)
        return tuple(slope.movedim(0, -1) for slope in torch.func.vmap(one)(*along))


def _parts(count: int, at_once: int) -> Iterator[slice]:
    for start in range(0, count, at_once):
        yield slice(start, min(start + at_once, count))
