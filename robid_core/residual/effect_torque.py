"""Torque that effects would add along a measured motion: how a law that no fit has in it is held against the data.

The motion behind the motors is that of the fitted robot. A force f along a direction d, which a law gives there, takes
the torque ``x(w)^T d f(w)`` of the motors, x all coordinates per motor angle of the linear model about that motion.
What the law does to the motion itself is left out: it is of second order in the law's size.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np

from robid_core.arrays import ComplexArray, FloatArray
from robid_core.effect import ForceEffect, Place, SignalEffect
from robid_core.estimation.torque.spectra import MotionSpectra
from robid_core.mechanics import ForceTerm, SignalTerm
from robid_core.mechanics.law_along import law_along
from robid_core.mechanics.terms import CHANNELS
from robid_core.residual.block import TorqueBlock
from robid_core.residual.columns import passive_motion
from robid_core.residual.impedance import impedance
from robid_core.residual.motor_laws import motion_between
from robid_core.residual.signals import channel_signals, signal_change, torque_of_change
from robid_core.residual.windowed_arm import SLOW
from robid_core.robot import Robot
from robid_core.robot.effects import BoundEffect
from robid_core.robot.forces_along import RobotMotion, forces_along

FINER = 4  # points a sample on which laws are evaluated
FELT = 0.1  # of the largest torque for a force: bins below tell little about the force


class EffectTorque:
    """The motion of one block about a fitted robot, and the torque that any effect would add to it."""

    def __init__(
        self, block: TorqueBlock[Any], robot: Robot, residual: ComplexArray, delay: FloatArray
    ) -> None:
        """Prepare.

        Parameters
        ----------
        block
            As the last pass of a fit left it.
        robot
            The block's robot as it was fitted.
        residual, delay
            What this robot leaves, (n_config, n_exp, n_bin, n_axis), and the delay of the torques, (1,) or (n_axis,):
            laws on torques are asked about what is expected, whose noise is not that of the data; those that are not
            invertible about what was recorded.
        """
        self.block, self.robot = block, robot
        self.motion = block.expected(residual, delay)
        self._delay = delay
        self._seen: dict[bytes, tuple[FloatArray, FloatArray]] = {}
        self._loads: dict[bytes, FloatArray] = {}
        self._channels: dict[tuple[int, str, bool], tuple[FloatArray, FloatArray, FloatArray]] = {}
        self._transfers: dict[bytes, ComplexArray] = {}
        self._linear: ComplexArray | None = None

    @functools.cached_property
    def along(self) -> RobotMotion:
        """All coordinates between the samples, and the torques of the motors, one lane an experiment."""
        return motion_between(self.motion, self.block.coordinates(self.robot), FINER)

    @functools.cached_property
    def load(self) -> FloatArray:
        """Torque that the transmissions pass, joint side, N m, (n_lane, n_time, n_axis)."""
        return forces_along(self.robot, self.along, ()).load

    def seen(self, row: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Position and speed of a row over the coordinates, (n_lane, n_time) each."""
        key = row.tobytes()
        if key not in self._seen:
            self._seen[key] = self.along.position @ row, self.along.speed @ row
        return self._seen[key]

    def load_of(self, row: FloatArray) -> FloatArray:
        """Load that a row over the transmissions weighs, (n_lane, n_time); zero where it weighs none."""
        key = row.tobytes()
        if key not in self._loads:
            self._loads[key] = self.load[..., row != 0] @ row[row != 0]
        return self._loads[key]

    def change_since(self, other: EffectTorque, place: Place) -> float:
        """Largest relative change, since another fit of the same record, of what laws at a place see and do.

        Infinite where a robot has other coordinates.
        """
        if self.robot.mechanism.n_coordinate != other.robot.mechanism.n_coordinate:
            return float("inf")
        pairs: list[tuple[FloatArray | ComplexArray, FloatArray | ComplexArray]] = []
        if place.side in CHANNELS:
            pairs += zip(
                self._channel(place.axis, place.side), other._channel(place.axis, place.side), strict=True
            )
            pairs.append((self.impedance, other.impedance))
        else:
            for row in (place.direction, place.motor, place.transmission):
                pairs += zip(self.seen(row), other.seen(row), strict=True)
                pairs.append((self._transfer(row), other._transfer(row)))
            pairs += ((self.load_of(row), other.load_of(row)) for row in (place.load, place.motor_load))
        return max(
            float(np.linalg.norm(now - before) / max(float(np.linalg.norm(now)), 1e-300))
            for now, before in pairs
        )

    # Torques, (n_config, n_exp, n_bin, n_axis)

    def of_force(self, direction: FloatArray, force: FloatArray) -> ComplexArray:
        """Motor torques that a force along a direction takes, the force (n_lane, n_time) on the finer grid.

        Single precision errs by 1e-7 of the force's level, and takes half the time.
        """
        motion = self.motion
        lanes = force.reshape(*motion.angle.shape[:2], -1, 1).astype(np.float32)
        torque: ComplexArray = motion.held_spectrum(lanes) * self._transfer(direction)[:, None]
        return torque

    def of_effect(self, bound: BoundEffect) -> ComplexArray:
        """All that an effect does with its parameters."""
        if issubclass(bound.effect, SignalEffect):
            (term,) = bound.effect.bind(bound.parameters, bound.place)
            assert isinstance(term, SignalTerm)
            invertible = bound.effect.invertible
            given = self._channel(term.axis, term.channel, invertible)
            return self._of_signal(bound, signal_change(self.robot, term, self._asked(invertible), given))
        total: ComplexArray = np.zeros_like(self.motion.torque_spectrum)
        for direction, force in self.forces_of(bound):
            total += self.of_force(direction, force)
        return total

    def forces_of(self, bound: BoundEffect) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Direction and force, (n_lane, n_time) on the finer grid, of each term of a law on forces."""
        for term in bound.effect.bind(bound.parameters, bound.place):
            assert isinstance(term, ForceTerm)
            at = *self.seen(term.coordinate), self.load_of(term.load)
            run = law_along(term, *at, self.along.step, settle=self.along.settle if term.n_state else 0)
            yield term.direction, run.force

    def force_behind(self, torque: ComplexArray, direction: FloatArray, axis: int) -> ComplexArray:
        """Force along a direction that a motor feels as a torque, (n_config, n_exp, n_bin, 1).

        Of the bins in which it feels the force at least FELT times as much as anywhere: in the others, which are zero
        here, the torque says little about it.
        """
        felt = self._transfer(direction)[..., axis]
        size = np.abs(felt)
        well = (size > 0) & (size >= FELT * size.max(axis=1, keepdims=True))
        inverse = np.where(well, 1 / np.where(well, felt, 1.0), 0.0)
        force: ComplexArray = (torque[..., axis] * inverse[:, None])[..., None]
        return force

    def of_structure(self, changed: Robot) -> ComplexArray:
        """What a change of the robot itself adds, as far as its linear model tells."""
        if self._linear is None:
            self._linear = self.block.linear_torque(self.robot)
        added: ComplexArray = self.block.linear_torque(changed) - self._linear
        return added

    def units(self, bound: BoundEffect) -> dict[str, ComplexArray]:
        """Torque per unit of each parameter in which the effect is linear; empty where there is none."""
        place = bound.place
        if issubclass(bound.effect, ForceEffect):
            terms = bound.effect.bind(bound.parameters, place)
            if len(terms) != 1:
                return {}
            (term,) = terms
            assert isinstance(term, ForceTerm)
            at = *self.seen(term.coordinate), self.load_of(term.load)
            unit = bound.effect.regressor(*at, bound.parameters, place)
            return {name: self.of_force(term.direction, force) for name, force in unit.items()}
        channel = self._channel(place.axis, place.side, bound.effect.invertible)
        unit = bound.effect.regressor(*channel, bound.parameters, place)
        return {name: self._of_signal(bound, change) for name, change in unit.items()}

    @functools.cached_property
    def impedance(self) -> ComplexArray:
        """Motor torque per motor acceleration, (n_config, n_bin, n_axis, n_axis)."""
        return impedance(self.robot, self.block.angle, self.motion)

    def _of_signal(self, bound: BoundEffect, change: FloatArray) -> ComplexArray:
        with_law = (bound.label, bound.place.axis, bound.place.side, change, self.motion, self.impedance)
        return torque_of_change(self.robot, *with_law)

    @functools.cached_property
    def _recorded(self) -> MotionSpectra:
        """With the torques that were recorded, their delay taken off."""
        recorded: MotionSpectra = self.block.expected(np.zeros_like(self.motion.torque_spectrum), self._delay)
        return recorded

    def _asked(self, invertible: bool) -> MotionSpectra:
        return self.motion if invertible else self._recorded

    def _channel(
        self, axis: int, side: str, invertible: bool = True
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        key = (axis, side, invertible)
        if key not in self._channels:
            self._channels[key] = channel_signals(self.robot, self._asked(invertible), axis, side)
        return self._channels[key]

    @functools.cached_property
    def _passive(self) -> ComplexArray:
        omega = self.motion.omega
        return passive_motion(self.robot, self.block.angle, np.concatenate((omega[1:2] / SLOW, omega[1:])))

    def _transfer(self, direction: FloatArray) -> ComplexArray:
        """Motor torque per force along a direction, (n_config, n_bin, n_axis)."""
        key = direction.tobytes()
        if key not in self._transfers:
            self._transfers[key] = np.einsum("cfna,n->cfa", self._passive, direction, optimize=True)
        return self._transfers[key]
