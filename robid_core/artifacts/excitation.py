"""What the motors are asked to do: periodic speed references, in blocks of orthogonal experiments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid_core.arrays import FloatArray, IntArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.evidence_tables import excitation_table
from robid_core.artifacts.tables import Table


@dataclass(frozen=True, eq=False)
class Excitation(Artifact):
    """One period of the speed reference for every experiment.

    `reference[c, m, e, n, a]` is the motor speed asked of axis a at sample n in experiment e of block m,
    realisation c; configuration i uses realisation ``i % n_realization``. `line` holds the excited DFT bins
    of one period (frequency = line * sample_rate / n_sample), and is empty where the motion is not for a frequency
    response; `slow_sine_bin` is 0 where no sine is superposed.

    `predicted_*` come from the simulation that cleared the excitation: the nominal robot in closed loop, from rest
    over a start-up and one period, motor side if not said otherwise.

    - `predicted_torque`, `predicted_speed`, `predicted_travel`, `predicted_gear_load`: largest values. The gear load
      is the torque that a transmission passes, joint side; `motor_gear_load` is what it would pass if the motor gave
      its `torque_limit` at rest, for comparison: a gear's own limit is in no robot description.
    - `predicted_torque_rms`: root mean square of the torque in the excited band (without lines: about its mean).
    - `friction_torque`: friction of the motors at the slow sine's speed; without a sine at the root mean square speed.
    - `predicted_speed_quantile`: of the size of the speed over time, at the probabilities `quantile`;
      `predicted_standstill`: share of the time below the speed under which friction is not resolved.
    - `predicted_deviation`: relative standard deviation of the diagonal of the response that H1 makes of all
      experiments, one period each; `predicted_noise_deviation` is the part of the sensors, and falls with the square
      root of the periods. NaN in configurations of which not every experiment was simulated, and at lines where the
      inputs do not span all axes; absent where the experiments are fewer than the axes.

    `simulated_experiments` counts what these numbers rest on.
    """

    axis_names: tuple[str, ...]
    sample_time_s: float
    slow_sine_bin: int
    line: IntArray = array("n_freq")
    reference: FloatArray = array("n_realization n_block n_exp n_sample n_axis", "rad/s")
    slow_sine_speed: FloatArray = array("n_axis", "rad/s")
    predicted_torque: FloatArray | None = array("n_config n_axis", "N m", optional=True)
    predicted_speed: FloatArray | None = array("n_config n_axis", "rad/s", optional=True)
    predicted_travel: FloatArray | None = array("n_config n_axis", "rad", optional=True)
    predicted_torque_rms: FloatArray | None = array("n_config n_axis", "N m", optional=True)
    torque_limit: FloatArray | None = array("n_axis", "N m", optional=True)
    friction_torque: FloatArray | None = array("n_config n_axis", "N m", optional=True)
    predicted_gear_load: FloatArray | None = array("n_config n_axis", "N m", optional=True)
    motor_gear_load: FloatArray | None = array("n_axis", "N m", optional=True)
    quantile: FloatArray | None = array("n_quantile", optional=True)
    predicted_speed_quantile: FloatArray | None = array("n_config n_quantile n_axis", "rad/s", optional=True)
    standstill_speed: FloatArray | None = array("n_axis", "rad/s", optional=True)
    predicted_standstill: FloatArray | None = array("n_config n_axis", optional=True)
    predicted_deviation: FloatArray | None = array("n_config n_freq n_axis", finite=False, optional=True)
    predicted_noise_deviation: FloatArray | None = array(
        "n_config n_freq n_axis", finite=False, optional=True
    )
    simulated_experiments: int = 0

    @property
    def n_sample(self) -> int:
        """Samples in one period."""
        return int(self.reference.shape[3])

    @property
    def period_s(self) -> float:
        """Length of one period in seconds."""
        return self.n_sample * self.sample_time_s

    @property
    def frequency_hz(self) -> FloatArray:
        """Excited frequencies in Hz, shape (n_freq,)."""
        return self.line / self.period_s

    @property
    def n_config(self) -> int:
        """Configurations that it was made for."""
        made_for = self.reference if self.predicted_torque is None else self.predicted_torque
        return int(made_for.shape[0])

    @property
    def experiment_time_s(self) -> float:
        """Duration of all experiments in seconds, one period each, without settling."""
        n_block, n_exp = self.reference.shape[1:3]
        return float(self.n_config * n_block * n_exp * self.period_s)

    def realization(self, configuration: int) -> FloatArray:
        """Return the reference of a configuration, shape (n_block, n_exp, n_sample, n_axis).

        >>> import robid_core as robid
        >>> from robid_core.testing import example_configurations, example_excitation
        >>> robot = robid.Robot.load("one_axis")
        >>> excitation = example_excitation(robot, example_configurations(robot))
        >>> excitation.realization(0).shape
        (2, 1, 500, 1)
        """
        result: FloatArray = self.reference[configuration % self.reference.shape[0]]
        return result

    def start_offset(self, configuration: int) -> FloatArray:
        """Where a motor has to start so that it moves about the configuration, and not away from it.

        The integral of the reference over a period has a mean, one to two amplitudes of the slow sine's
        travel; a motion that starts at the configuration *minus* this has it in its middle. Motor side, rad,
        shape (n_block, n_exp, n_axis).

        >>> import robid_core as robid
        >>> from robid_core.testing import example_configurations, example_excitation
        >>> robot = robid.Robot.load("one_axis")
        >>> example_excitation(robot, example_configurations(robot)).start_offset(0).shape
        (2, 1, 1)
        """
        return mean_travel(self.realization(configuration), self.sample_time_s)

    def table(self) -> Table:
        """Return a row for each configuration and axis: largest speed asked for, and what was predicted, motor side.

        Torque, speed and travel are there where a simulation cleared the excitation, the share of the torque limit
        where the robot file states one.

        Examples
        --------
        >>> import robid_core as robid
        >>> from robid_core.testing import example_configurations, example_excitation
        >>> robot = robid.Robot.load("one_axis")
        >>> table = example_excitation(robot, example_configurations(robot)).table()
        >>> table["configuration"], table["axis"], [round(speed, 1) for speed in table["reference_rad_s"]]
        ([0, 1], ['axis_1', 'axis_1'], [9.3, 9.8])
        """
        return excitation_table(self)


def mean_travel(speed_reference: FloatArray, sample_time_s: float) -> FloatArray:
    """Mean over a period of how far a speed reference has led from its start, rad, shape (..., n_axis).

    A motion that starts at an angle minus this goes about the angle, and not away from it.

    Parameters
    ----------
    speed_reference
        One period, rad/s, shape (..., n_sample, n_axis).
    sample_time_s
        Of the reference.

    Examples
    --------
    A sine begins in one end of its travel, an amplitude below the middle:

    >>> import numpy as np, robid_core as robid
    >>> time = 1e-3 * np.arange(1000)
    >>> robid.mean_travel(2 * np.pi * np.sin(2 * np.pi * time)[:, None], 1e-3).round(2).tolist()
    [1.0]
    """
    travel = np.cumsum(speed_reference, axis=-2) * sample_time_s
    result: FloatArray = travel.mean(axis=-2)
    return result
