"""Unknowns of a rigid fit: bodies, rotors, effects in natural scales, friction in its own units, delays of torques.

Of friction, the speed within which it turns is changed by its logarithm: the torque is not linear in it.

The ten numbers of a body are its mass, centre of mass and moments about it, so that whatever is found is a body that
can be: second moments stay positive (`FreeParameters`). The torque is linear in mass, first moments and inertia about
the joint, which these are turned into here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Literal

import numpy as np

from robid_core import BoolArray, FloatArray, FreeParameters, Robot
from robid_core.estimation.rigid.rigid_body import PARAMETERS
from robid_fit.rigid_effects import acting_laws
from robid_fit.rigid_model import Columns
from robid_fit.rigid_ripple import amplitude_and_phase, ripples

MOMENTS = tuple(noun.partition(".")[2] for noun in PARAMETERS[4:])
ENTRIES = tuple(zip(*(index.tolist() for index in np.triu_indices(3)), strict=True))
TURNS = ".speed"  # of friction: the number that the torque is not linear in
PROMISED = ("mass", "centre_of_mass", "inertia", "rotor_inertia")  # by drawings and data sheets
TOLERANCE = 0.1  # of what these promise, where nobody says another
LATE = 0.5  # samples: of two channels' timing, before the data
Delays = Literal["none", "common", "each"]


@dataclass(frozen=True, eq=False)
class RigidUnknowns:
    """Unknowns of a rigid fit: coordinates of `free`, `friction` and `ripple` in N m, `delays` in samples."""

    free: FreeParameters
    """Bodies, rotors, effects, and speeds within which Coulomb friction turns."""
    friction: tuple[str, ...]
    """Viscous and Coulomb friction and offsets that are estimated."""
    columns: Columns
    """Of the torque; their values are those of the robot with all its effects, payloads among them."""
    ripple: tuple[str, ...] = ()
    """Labels of waves of the torque whose size and phase are estimated: coordinates are cosine and sine."""
    delays: tuple[str, ...] = ()
    """By which recorded torques lag the motion: of all axes, of each, or none."""
    sample_time_s: float = 1.0
    """Unit of their coordinates."""

    @classmethod
    def of_robot(
        cls,
        robot: Robot,
        columns: Columns,
        kinds: Sequence[str],
        fixed: Sequence[str],
        priors: Mapping[str, float],
        delays: Delays = "none",
        sample_time_s: float = 1.0,
    ) -> RigidUnknowns:
        """Free what is of some kinds, less what is held; a body without mass is none.

        Parameters
        ----------
        robot
            Rigid, with its effects.
        columns
            Of its torque.
        kinds
            Some of `inertia`, `rotor_inertia`, `viscous`, `coulomb`, `offset`, `effects`.
        fixed
            Patterns of names that are held.
        priors
            Standard deviations in natural scales, by pattern.
        delays, sample_time_s
            Whether torques lag by one number, each by its own, or none does; by half a sample or so.
        """
        bodies = {body.joint for body in robot.description.bodies if body.mass > 0}
        laws = set(acting_laws(robot))

        def kind_of(name: str) -> str:
            noun, _, place = name.partition(".")
            if noun in PROMISED[:3]:
                return "inertia" if place.partition(".")[0] in bodies else ""
            if noun == "effect":
                return "effects" if place.partition(".")[0] in laws else ""
            if name.endswith(TURNS):
                return "coulomb"
            return noun if noun == "rotor_inertia" else place.rpartition(".")[2]

        names = [
            name
            for name in robot.layout
            if kind_of(name) in kinds and not any(fnmatchcase(name, pattern) for pattern in fixed)
        ]
        friction = tuple(name for name in columns.names if name in names and name.startswith("friction."))
        turns = {axis: f"friction.{axis}.coulomb" for axis in robot.axis_names}
        rubs = {axis for axis, level in turns.items() if level in names or robot.parameter(level) > 0}
        free = [name for name in names if not name.startswith("friction.")]
        free += [name for name in names if name.endswith(TURNS) and name.split(".")[1] in rubs]
        promised = {name: TOLERANCE for name in free if name.partition(".")[0] in PROMISED}
        late = {
            "none": (),
            "common": ("torque_delay",),
            "each": tuple(f"torque_delay.{a}" for a in robot.axis_names),
        }
        parameters = FreeParameters.of_robot(robot, free, promised | dict(priors))
        held = [] if "effects" in kinds else list(robot.layout)
        held += [name for name in robot.layout if any(fnmatchcase(name, pattern) for pattern in fixed)]
        waves = tuple(wave.label for wave in ripples(robot) if f"effect.{wave.label}.amplitude" not in held)
        return cls(parameters, friction, columns, waves, late[delays], sample_time_s)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all unknowns, as robot files have them; last the delays, which they do not have."""
        waves = tuple(f"effect.{label}.{name}" for label in self.ripple for name in ("amplitude", "phase"))
        return self.free.names + self.friction + waves + self.delays

    @property
    def n_own(self) -> int:
        """How many of them are the robot's."""
        return len(self.free.names) + len(self.friction) + 2 * len(self.ripple)

    @property
    def units(self) -> tuple[str, ...]:
        """Of `values`."""
        layout = self.free.robot.layout
        return (*(layout[name].unit for name in self.names[: self.n_own]), *("s" for _ in self.delays))

    @property
    def groups(self) -> tuple[str, ...]:
        """What each unknown is for a reader."""
        layout = self.free.robot.layout
        return (*(layout[name].kind for name in self.names[: self.n_own]), *("nuisance" for _ in self.delays))

    def delay(self, point: FloatArray) -> FloatArray:
        """Delay of the torque of each axis, s, (n_axis,)."""
        result: FloatArray = self.delayed @ point[self.n_own :] * self.sample_time_s
        return result

    @property
    def delayed(self) -> FloatArray:
        """Which axes each of the delays concerns, (n_axis, n_delay)."""
        n_axis = self.free.robot.n_axis
        return np.eye(n_axis) if len(self.delays) == n_axis else np.ones((n_axis, len(self.delays)))

    @property
    def start(self) -> FloatArray:
        """The told robot, (n_unknown,)."""
        told = dict(zip(self.columns.names, self.columns.value.tolist(), strict=True))
        own = [told[name] for name in (*self.friction, *self._wave_columns)]
        return np.concatenate((np.zeros(len(self.free.names)), own, np.zeros(len(self.delays))))

    @property
    def prior(self) -> FloatArray:
        """Standard deviations, (n_unknown,); infinite for friction and ripple."""
        late = np.full(len(self.delays), LATE)
        unknown = np.full(self.n_own - len(self.free.names), np.inf)
        return np.concatenate((self.free.prior, unknown, late))

    @cached_property
    def promised(self) -> BoolArray:
        """Which unknowns a drawing or a data sheet promises, (n_unknown,)."""
        return np.array([name.partition(".")[0] in PROMISED for name in self.names], dtype=np.bool_)

    @property
    def lower(self) -> FloatArray:
        """Smallest coordinates, (n_unknown,): friction does not push."""
        pushes = [name.endswith(".offset") for name in self.friction]
        others = np.full(2 * len(self.ripple) + len(self.delays), -np.inf)
        return np.concatenate((self.free.lower, np.where(pushes, -np.inf, 0.0), others))

    @property
    def upper(self) -> FloatArray:
        """Largest coordinates, (n_unknown,)."""
        return np.concatenate((self.free.upper, np.full(len(self.names) - len(self.free.names), np.inf)))

    def values(self, point: FloatArray) -> FloatArray:
        """Unknowns in the units of a robot file, and s, (n_unknown,)."""
        n, result = len(self.free.names), point.copy()
        result[:n] = list(self.free.values(point[:n]).values())
        for first in self._waves:
            result[first : first + 2] = amplitude_and_phase(point[first : first + 2])[0]
        result[self.n_own :] *= self.sample_time_s
        return result

    def slopes(self, point: FloatArray) -> FloatArray:
        """Derivative of `values`, (n_unknown, n_unknown)."""
        n = len(self.free.names)
        result = np.eye(len(point))
        result[:n, :n] = self.free.jacobian(point[:n])
        for first in self._waves:
            pair = slice(first, first + 2)
            result[pair, pair] = amplitude_and_phase(point[pair])[1]
        result[self.n_own :] *= self.sample_time_s
        return result

    @property
    def _waves(self) -> range:
        """Where cosines stand among the coordinates."""
        return range(len(self.free.names) + len(self.friction), self.n_own, 2)

    @property
    def _wave_columns(self) -> list[str]:
        return [f"effect.{label}.{part}" for label in self.ripple for part in ("cosine", "sine")]

    # What the torque is linear in

    def linear(self, point: FloatArray) -> FloatArray:
        """Values of all columns of the torque, (n_column,); what is held, and payloads, as told."""
        value = self.columns.value.copy()
        found = dict(zip(self.names, self.values(point).tolist(), strict=True))
        start = dict(zip(self.names, self.values(self.start).tolist(), strict=True))
        for joint, first in self._bodies.items():
            value[first : first + len(PARAMETERS)] += _ten(self._numbers(joint, found)) - _ten(
                self._numbers(joint, start)
            )
        for name, column in self._own.items():
            value[column] += found[name] - start[name]
        for name, part in zip(self._wave_columns, point[self._waves.start : self.n_own], strict=True):
            value[self.columns.names.index(name)] = part
        return value

    def linear_slopes(self, point: FloatArray) -> FloatArray:
        """Derivative of `linear`, (n_column, n_unknown)."""
        index = {name: i for i, name in enumerate(self.names)}
        found = dict(zip(self.names, self.values(point).tolist(), strict=True))
        by_value = np.zeros((len(self.columns.names), len(point)))
        for joint, first in self._bodies.items():
            slope = _ten_slopes(self._numbers(joint, found))
            for k, name in enumerate(_body_names(joint)):
                if name in index:
                    by_value[first : first + len(PARAMETERS), index[name]] = slope[:, k]
        for name, column in self._own.items():
            by_value[column, index[name]] = 1.0
        result: FloatArray = by_value @ self.slopes(point)
        for i, name in enumerate(self._wave_columns):
            result[self.columns.names.index(name), self._waves.start + i] = 1.0
        return result

    @cached_property
    def _bodies(self) -> dict[str, int]:
        """Bodies of which something is free, and where their columns begin."""
        joints = {name.split(".")[1] for name in self.names if name.partition(".")[0] in PROMISED[:3]}
        return {
            name.removeprefix("mass."): column
            for column, name in enumerate(self.columns.names)
            if name.startswith("mass.") and name.removeprefix("mass.") in joints
        }

    @cached_property
    def _own(self) -> dict[str, int]:
        """Unknowns that are columns themselves: rotors and friction."""
        columns = {name: column for column, name in enumerate(self.columns.names)}
        own = self.friction + tuple(n for n in self.free.names if n.startswith("rotor_inertia."))
        return {name: columns[name] for name in own}

    # What it is not linear in

    @cached_property
    def laws(self) -> tuple[str, ...]:
        """Parameters of laws that are run along the motion."""
        return tuple(name for name in self.free.names if name.startswith("effect."))

    @cached_property
    def bends(self) -> list[int]:
        """Unknowns that the torque is not linear in: of laws, speeds within which friction turns, delays."""
        laws = [self.free.names.index(name) for name in self.laws]
        return [*laws, *self.turning.values(), *range(self.n_own, len(self.names))]

    @cached_property
    def turning(self) -> dict[int, int]:
        """Axes of which the speed that friction turns within is free, and where its coordinate stands."""
        places = {name: place for place, name in enumerate(self.free.names)}
        names = [f"friction.{axis}{TURNS}" for axis in self.free.robot.axis_names]
        return {axis: places[name] for axis, name in enumerate(names) if name in places}

    def friction_speed(self, point: FloatArray, held: FloatArray) -> FloatArray:
        """Speeds within which friction turns, (n_axis,); those that are not free are `held`."""
        speed = held.copy()
        for axis, place in self.turning.items():
            speed[axis] = self.free.start[place] * np.exp(point[place])
        return speed

    def _numbers(self, joint: str, found: Mapping[str, float]) -> FloatArray:
        """Mass, centre and moments of a body, (10,), held ones from the robot file."""
        robot = self.free.robot
        return np.array([found.get(name, robot.parameter(name)) for name in _body_names(joint)])


def _body_names(joint: str) -> list[str]:
    """Names of a body's ten numbers in a robot file."""
    centre = [f"centre_of_mass.{joint}.{axis}" for axis in "xyz"]
    return [f"mass.{joint}", *centre, *(f"inertia.{joint}.{moment}" for moment in MOMENTS)]


def _ten(numbers: FloatArray) -> FloatArray:
    """Parameters of the torque, in the order of `PARAMETERS`, from mass, centre and moments about it, (10,) each."""
    mass, centre = numbers[0], numbers[1:4]
    steiner = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return np.concatenate(([mass], mass * centre, numbers[4:] + [steiner[entry] for entry in ENTRIES]))


def _ten_slopes(numbers: FloatArray) -> FloatArray:
    """Derivative of `_ten`, (10, 10)."""
    mass, centre = numbers[0], numbers[1:4]
    result = np.eye(len(PARAMETERS))
    result[1:4, 0] = centre
    result[1:4, 1:4] = mass * np.eye(3)
    steiner = centre @ centre * np.eye(3) - np.outer(centre, centre)
    result[4:, 0] = [steiner[entry] for entry in ENTRIES]
    for k, unit in enumerate(np.eye(3)):
        turned = 2 * centre[k] * np.eye(3) - np.outer(unit, centre) - np.outer(centre, unit)
        result[4:, 1 + k] = [mass * turned[entry] for entry in ENTRIES]
    return result
