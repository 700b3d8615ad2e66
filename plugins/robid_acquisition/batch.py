"""Measurements simulated in batches: what the drives of a plant would record, computed on every core there is.

For studies and for choosing experiments, where the measurement of a simulated plant is wanted and the way to its
motors is not: no drives, no bus, nothing that moves. The experiments are those of `acquisition.drives`, cleared by the
same gate and judged by the same rules, so that a study does not live on motions that a robot would be refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import Field, PositiveFloat

from robid_acquisition.arm_side import UNITS, ArmSide, shown, why_not
from robid_acquisition.drives import (
    MOST_PERIODS,
    check_axes,
    plan_experiments,
    reject_drift,
    reject_saturated,
)
from robid_acquisition.simulated import saturation_level
from robid_core import (
    Acquisition,
    AxisKey,
    Channel,
    ConfigurationError,
    Configurations,
    Context,
    DenseRun,
    Excitation,
    ExperimentBatch,
    FloatArray,
    NotTrustworthy,
    Record,
    Robot,
    RobotName,
    frozen,
    simulate_portions,
)
from robid_core.residual.inertial_units import channels_of


def reference_numbers(n_config: int, shape: tuple[int, ...]) -> npt.NDArray[np.int64]:
    """Which reference each experiment follows, experiments in the order (configuration, block, experiment).

    Configuration i takes realization ``i % n_realization``; `shape` is that of `Excitation.reference`, references
    are counted over its first three axes.
    """
    numbers = np.arange(shape[0] * shape[1] * shape[2]).reshape(shape[0], -1)
    return numbers[np.arange(n_config) % shape[0]].ravel()


def record_of(
    source: str,
    configurations: Configurations,
    excitation: Excitation,
    position: FloatArray,
    torque: FloatArray,
    behind: Mapping[str, FloatArray] | None = None,
) -> Record:
    """Record of every sample, position and torque (n_config, n_block, n_exp, n_period, n_sample, n_axis).

    `behind` holds channels behind the gears, of the same shape. The reference is the same in every period, and stands
    in memory once; what was measured becomes read-only.
    """
    realization = excitation.reference
    if len(realization) != len(position):
        realization = frozen(realization[np.arange(len(position)) % len(realization)])
    reference = np.broadcast_to(realization[:, :, :, None], position.shape)
    channels = {
        "motor_position": Channel("motor", "rad", frozen(position)),
        "motor_torque": Channel("motor", "N m", frozen(torque)),
        "speed_reference": Channel("motor", "rad/s", reference),
    }
    for name, values in (behind or {}).items():
        unit = next(unit for kind, unit in UNITS.items() if name.startswith(kind))
        channels[name] = Channel("joint", unit, frozen(values))
    time_s = np.arange(excitation.n_sample, dtype=float) * excitation.sample_time_s
    run = DenseRun(excitation.sample_time_s, channels, time_s, np.ones(position.shape[:-1], dtype=bool))
    angle, line = configurations.angle, excitation.line if len(excitation.line) else None
    return Record(configurations.axis_names, source, "zero_order_hold", (run,), angle, line)


class SimulatedAcquisition(Acquisition):
    """Simulates the measurement of a plant in batches, without drives: for studies; nothing moves.

    Gives the samples that `acquisition.drives` under the same name would with `drives: {use: simulated}` and this
    plant, bit by bit, computed on all cores or on a cluster (`executor: {use: dask, ...}`). The record says that it
    is simulated.

    Example
    -------
    ::

        acquire: {use: acquisition.simulated, with: {plant: six_axis_true}}
    """

    plant: RobotName | None = None
    """The robot that is simulated: packaged, or a path to a robot.yaml; null: the robot that the stage is given."""
    periods: int = Field(default=2, gt=0, le=MOST_PERIODS)
    """Periods of the reference that are kept."""
    settle_periods: int = Field(default=1, ge=0, le=MOST_PERIODS)
    """Periods before them, in which the transient dies out."""
    saturation_limit: float = Field(default=0.01, ge=0, lt=1)
    """Share of samples at the torque limit above which the data are rejected."""
    drift_limit_rad: PositiveFloat = 0.05
    """Drift of a motor angle from period to period above which data with lines are rejected, rad at the motor."""
    arm_side: tuple[ArmSide, ...] = ()
    """Channels behind the gears that are measured, too: encoders at the links (`joint_position`), torque sensors in the
    joints (`joint_torque`), accelerometers and gyroscopes on the links (`link_acceleration`, `link_turn_rate`, three
    channels each), with place and noise that the plant's file states; `fit.torque_residual` has the same setting."""

    def uses(self) -> list[tuple[str, str]]:
        """Return the plugins whose code the result depends on: the plant's effects."""
        effects = Robot.load(self.plant).description.effects.values() if self.plant is not None else ()
        return sorted({("robid.effects", effect.use) for effect in effects})

    def problems_with(self, robot: Robot) -> dict[tuple[str | int, ...], str]:
        """Another number of motors, and what the plant's file lacks for a simulation."""
        plant = robot if self.plant is None else Robot.load(self.plant)
        if plant.n_axis != robot.n_axis:
            motors = f"{plant.n_axis} motor{'' if plant.n_axis == 1 else 's'}"
            wrong = f"plant '{self.plant}' has {motors}, robot '{robot.name}' has {robot.n_axis}"
            return {("plant",): wrong}
        missing = plant.left_out(("torque_limit", "controller"))
        if missing:
            return {("plant",): missing}
        reason = why_not(plant, self.arm_side)
        return {("arm_side",): reason} if reason else {}

    def plan_lines(self, upstream: Mapping[str, Any]) -> list[str]:
        """Say for `robid plan` that nothing moves."""
        del upstream
        plant = "the robot itself" if self.plant is None else f"'{self.plant}'"
        return [
            f"simulates {plant}, nothing moves; {self.periods} periods after {self.settle_periods} to settle"
        ]

    def needs_of_axes(self) -> tuple[AxisKey, ...]:
        """Limits, which the safety gate asks for as if something moved."""
        return ("torque_limit", "speed_limit")

    def run(
        self, configurations: Configurations, excitation: Excitation, robot: Robot, context: Context
    ) -> Record:
        """Clear all motions, simulate them, and put the record together."""
        check_axes(configurations, excitation, robot)
        plant = robot if self.plant is None else Robot.load(self.plant)
        if plant.n_axis != robot.n_axis:
            motors = f"{plant.n_axis} motor{'' if plant.n_axis == 1 else 's'}"
            raise ConfigurationError(
                f"plant '{plant.name}' has {motors}, robot '{robot.name}' has {robot.n_axis}"
            )
        if reason := why_not(plant, self.arm_side):
            raise ConfigurationError(f"arm_side: {reason}")
        n_block, n_exp, n_sample, n_axis = excitation.reference.shape[1:]
        places = (configurations.n_config, n_block, n_exp)
        seeds = context.generator.integers(2**62, size=places)
        n_period = self.periods + self.settle_periods
        cleared = plan_experiments(configurations, excitation, robot, n_period, self.periods, seeds)
        experiments = list(cleared.values())
        batch = ExperimentBatch(
            robot=plant,
            speed_reference=excitation.reference.reshape(-1, n_sample, n_axis),
            motor_angle=np.stack([experiment.start for experiment in experiments]),
            reference_of=reference_numbers(configurations.n_config, excitation.reference.shape),
            seed=seeds.ravel(),
            n_period=n_period,
            n_kept=self.periods,
            keep_coordinates=bool(self.arm_side),
        )
        position, torque = (np.empty((len(experiments), self.periods, n_sample, n_axis)) for _ in range(2))
        behind = {name: np.empty_like(position) for name in channels_of(self.arm_side)}
        level = saturation_level(plant)
        for portion in simulate_portions(context.map, [batch], context.progress):
            if portion.failed is not None:
                raise NotTrustworthy(f"{experiments[portion.failed].label} {portion.problem}")
            for lane in range(portion.first, portion.last):
                position[lane] = portion.position[lane - portion.first].reshape(position.shape[1:])
                torque[lane] = portion.torque[lane - portion.first].reshape(torque.shape[1:])
                for kind in self.arm_side:
                    assert portion.coordinates is not None
                    own = shown(
                        plant, kind, portion.coordinates[lane - portion.first], experiments[lane].seed
                    )
                    for name, values in own.items():
                        behind[name][lane] = values.reshape(position.shape[1:])
                saturated = (np.abs(torque[lane]) >= level).mean(axis=(0, 1))
                label = experiments[lane].label
                notes = reject_saturated(label, saturated, robot.axis_names, self.saturation_limit)
                has_lines = len(excitation.line) > 0
                notes += reject_drift(
                    label, position[lane], robot.axis_names, self.drift_limit_rad, has_lines
                )
                for note in notes:
                    context.log.warning("%s", note)
        shape = (*places, *position.shape[1:])
        source = f"simulated in batches, plant '{plant.name}'"
        measured = {name: values.reshape(shape) for name, values in behind.items()}
        return record_of(
            source, configurations, excitation, position.reshape(shape), torque.reshape(shape), measured
        )
