"""Chains and robots in pinocchio: mass matrix, forces, their derivatives, and a Runge-Kutta loop in Python.

The loop is what someone writes who has pinocchio and numpy: springs and friction in numpy, accelerations of
the arm by the articulated body algorithm, four stages a step, the controller once a sample.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pinocchio
from oracles.drives import Cascade, Motors, Ripple, check_plain, gear_of, of_axes
from scipy.integrate import solve_ivp

from robid_core import Robot
from robid_core.mechanics import Chain

FloatArray = npt.NDArray[np.float64]


class PinocchioChain:
    """A chain in pinocchio, with joint coordinates in the order of the chain."""

    def __init__(self, chain: Chain) -> None:
        self.model = pinocchio.Model()
        self.model.gravity.linear = chain.gravity
        kinds = pinocchio.JointModelRevoluteUnaligned, pinocchio.JointModelPrismaticUnaligned
        ids = {-1: 0}
        for j in depth_first(chain):
            ids[j] = self.model.addJoint(
                ids[int(chain.parent[j])],
                kinds[int(chain.joint_type[j])](chain.axis[j]),
                pinocchio.SE3(chain.rotation[j], chain.translation[j]),
                chain.names[j],
            )
            inertia = pinocchio.Inertia(float(chain.mass[j]), chain.centre_of_mass[j], chain.inertia[j])
            self.model.appendBodyToJoint(ids[j], inertia, pinocchio.SE3.Identity())
        self.data = self.model.createData()
        self.place = np.array([self.model.joints[ids[j]].idx_v for j in range(chain.n_coordinate)])
        self.back = np.argsort(self.place)

    def mass(self, position: FloatArray) -> FloatArray:
        """Mass matrix, (n, n)."""
        upper = np.triu(pinocchio.crba(self.model, self.data, position[self.back]))
        return np.asarray((upper + np.triu(upper, 1).T)[np.ix_(self.place, self.place)])

    def force(self, position: FloatArray, speed: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Joint force that gives this acceleration (recursive Newton-Euler), (n,)."""
        q, v, a = (x[self.back] for x in (position, speed, acceleration))
        return np.asarray(pinocchio.rnea(self.model, self.data, q, v, a)[self.place])

    def gravity(self, position: FloatArray) -> FloatArray:
        """g of (2.1), (n,)."""
        q = position[self.back]
        return np.asarray(pinocchio.computeGeneralizedGravity(self.model, self.data, q)[self.place])

    def coriolis(self, position: FloatArray, speed: FloatArray) -> FloatArray:
        """Force c of (2.1) of the velocities, (n,), by pinocchio's Coriolis matrix."""
        q, v = position[self.back], speed[self.back]
        matrix = pinocchio.computeCoriolisMatrix(self.model, self.data, q, v)
        return np.asarray((matrix @ v)[self.place])

    def force_slope(self, position: FloatArray, speed: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Derivative of `force` with respect to position (computeRNEADerivatives), (n, n); dg/dq at rest."""
        q, v, a = (x[self.back] for x in (position, speed, acceleration))
        slope = pinocchio.computeRNEADerivatives(self.model, self.data, q, v, a)[0]
        return np.asarray(slope[np.ix_(self.place, self.place)])


def depth_first(chain: Chain, parent: int = -1) -> list[int]:
    """Joints so that those of a branch stand one behind the other, as pinocchio wants them."""
    return [
        k
        for j in np.flatnonzero(chain.parent == parent).tolist()
        for k in (int(j), *depth_first(chain, int(j)))
    ]


class PinocchioRobot:
    """A robot of elastic gears over pinocchio; z = [motor angles, joints of the chain]."""

    def __init__(self, robot: Robot, ripple: Ripple | None = None) -> None:
        axes = robot.description.axes
        check_plain(robot)
        if any(axis.gear is None for axis in axes.values()):
            raise ValueError(f"{robot.name}: a rigid gear has no counterpart here; give it a spring")
        self.robot, self.motors, self.ripple = robot, Motors(robot, ripple), ripple
        self.chain, self.n_axis = PinocchioChain(robot.chain), robot.n_axis
        names = robot.chain.names
        self.gear, self.per_rotor = gear_of(robot), 1.0 / of_axes(robot, "rotor_inertia")
        self.stiffness, self.damping = (of_axes(robot, "gear", key) for key in ("stiffness", "damping"))
        # in pinocchio's order
        self.arm = self.chain.place[[names.index(axis.joint or name) for name, axis in axes.items()]]
        self.joint_stiffness, self.joint_damping = np.zeros((2, len(names)))
        for name, bearing in robot.description.bearings.items():
            place = self.chain.place[names.index(name)]
            self.joint_stiffness[place], self.joint_damping[place] = bearing.stiffness, bearing.damping

    def slope(self, state: FloatArray, torque: FloatArray) -> FloatArray:
        """Derivative of [motor angles, joints, motor speeds, joint speeds] (joints in pinocchio's order)."""
        n, n_axis = len(state) // 2, self.n_axis
        motor, q, motor_speed, v = state[:n_axis], state[n_axis:n], state[n : n + n_axis], state[n + n_axis :]
        through = self.stiffness * (self.gear @ motor - q[self.arm])
        through += self.damping * (self.gear @ motor_speed - v[self.arm])
        force = -self.joint_stiffness * q - self.joint_damping * v
        force[self.arm] += through
        turned = self.per_rotor * (torque + self.motors.torque(motor, motor_speed) - self.gear.T @ through)
        moved = pinocchio.aba(self.chain.model, self.chain.data, q, v, force)
        return np.concatenate((state[n:], turned, moved))

    def acceleration(self, position: FloatArray, speed: FloatArray, torque: FloatArray) -> FloatArray:
        """Acceleration of z, (n_coordinate,)."""
        change = self.slope(self.put(position, speed), torque)
        return self.state(change)[1]

    def put(self, position: FloatArray, speed: FloatArray) -> FloatArray:
        """State vector of z and z'."""
        order = np.concatenate((np.arange(self.n_axis), self.n_axis + self.chain.back))
        return np.concatenate((position[order], speed[order]))

    def state(self, vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """z and z' of a state vector."""
        n = len(vector) // 2
        order = np.concatenate((np.arange(self.n_axis), self.n_axis + self.chain.place))
        return vector[:n][order], vector[n:][order]

    def motion(
        self,
        position: FloatArray,
        speed: FloatArray,
        torque: FloatArray,
        duration: float,
        tolerance: float = 1e-9,
    ) -> tuple[FloatArray, FloatArray]:
        """z and z' after a time under constant torque, by scipy's DOP853."""
        # absolute: of the smallest angles that matter, 1e-3 rad of spring deflection
        found = solve_ivp(
            lambda _, x: self.slope(x, torque), (0, duration), self.put(position, speed),
            method="DOP853", rtol=tolerance, atol=1e-3 * tolerance,
        )  # fmt: skip
        return self.state(found.y[:, -1])

    def closed_loop(
        self, position: FloatArray, torque: FloatArray, reference: FloatArray, n_step: int
    ) -> tuple[FloatArray, FloatArray]:
        """Sampled closed loop from rest, Runge-Kutta of order four with n_step steps a sample.

        Returns measured motor angle and torque, (n_sample, n_axis) each; arguments as of
        `MujocoRobot.closed_loop`.
        """
        x = self.put(position, np.zeros_like(position))
        h = self.robot.sample_time_s / n_step
        cascade = Cascade(self.robot, x[: self.n_axis], torque, self.ripple)
        measured, demanded = np.zeros((2, len(reference), self.n_axis))
        slope = self.slope
        for sample, wanted in enumerate(reference):
            u, measured[sample] = cascade.command(x[: self.n_axis], wanted)
            demanded[sample] = u
            for _ in range(n_step):
                k1 = slope(x, u)
                k2 = slope(x + h / 2 * k1, u)
                k3 = slope(x + h / 2 * k2, u)
                k4 = slope(x + h * k3, u)
                x = x + h / 6 * (k1 + 2 * (k2 + k3) + k4)
        return measured, demanded
