"""What was measured: configurations, dense runs of experiments, excited lines; and their spectra."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
import numpy.typing as npt

from robid_core.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid_core.artifacts import from_arrays as arrays
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.dense_run import DenseRun
from robid_core.artifacts.packing import packed
from robid_core.artifacts.tables import Table, record_table
from robid_core.errors import DataRejected

MOTOR_POSITION = "motor_position"
MOTOR_TORQUE = "motor_torque"
SPEED_REFERENCE = "speed_reference"
POSITION_REFERENCE = "position_reference"
MEASURED = (MOTOR_POSITION, MOTOR_TORQUE)


@dataclass(frozen=True, eq=False)
class Record(Artifact):
    """A measurement: its configurations, its dense runs and, where it was periodic, the excited bins.

    Position is sampled at an instant, torque is held from that instant to the next (zero-order hold).
    `damping_deviation` is what a compensation of friction may have done wrong without any residual to show it: standard
    deviation at the lines of the damping that it left in the torque of each motor. `model_based` says that a model
    of the robot was used to compute the samples: what is estimated from them may be biased towards it.

    A robot with another payload or tool, or one that was changed between two runs, is another variant: `variants` has
    a name for each configuration, or none where all were measured alike. The same pose under two variants is two
    configurations, so that no average over blocks and experiments mixes them. Which experiments are held out for
    tests, and constants such as a temperature, stand in the runs.
    """

    axis_names: tuple[str, ...]
    source: str
    torque_hold: str  # "zero_order_hold", or "continuous" where the recording does not tell
    runs: tuple[DenseRun, ...]
    angle: FloatArray = array("n_config n_axis", "rad")
    line: IntArray | None = array("n_freq", optional=True)
    damping_deviation: FloatArray | None = array("n_config n_freq n_axis", "N m s/rad", optional=True)
    model_based: bool = False
    variants: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check that every configuration has a variant, or none has."""
        super().__post_init__()
        if self.variants and len(self.variants) != len(self.angle):
            raise DataRejected(
                f"Record.variants: {len(self.variants)} names for {len(self.angle)} configurations; give one for each"
            )

    @classmethod
    def from_arrays(
        cls,
        *,
        sample_time_s: float,
        axes: str = "",
        robot: arrays.Axes | None = None,
        axis_names: Sequence[str] = (),
        angle: npt.ArrayLike | None = None,
        units: Mapping[str, str] | None = None,
        period_s: float | None = None,
        excited_hz: Iterable[float] = (),
        torque_hold: Literal["zero_order_hold", "continuous"] | None = None,
        source: str = "arrays",
        **channels: npt.ArrayLike,
    ) -> Self:
        """Make a record of arrays.

        Parameters
        ----------
        sample_time_s
            Of all channels.
        axes
            Names of the arrays' axes in their order, out of `n_config n_block n_exp n_period n_sample n_axis`; one that
            is not named has length one. By default `n_sample n_axis`, of one motor `n_sample`.
        robot
            Names the axes, and gives the configurations from the motor angles.
        axis_names
            In place of the robot's; without either axis_1, axis_2, ...
        angle
            Motor angles seen through the gear, rad, (n_config, n_axis), in place of those by the robot.
        units
            Unit of a channel by its name, as `{"motor_position": "deg"}`: of those in `robid_core.UNITS`. By default
            the SI unit of what the name promises (position rad, speed rad/s, torque N m).
        period_s
            Length of a period, where `n_sample` holds several one after another.
        excited_hz
            Excited frequencies, where the record is for a frequency response, or its periods tell a fit or a diagnosis
            the noise; with them `period_s` is needed unless `n_sample` is one period. Without them a record counts as
            motion that does not repeat.
        torque_hold
            "zero_order_hold" where a digital controller holds the torque between samples, else "continuous" (measured,
            filtered), which is the default; to be given with `excited_hz`, since half a sample lies between the two.
        source
            Where the arrays come from, in words.
        channels
            Arrays by name: motor_position, motor_torque, speed_reference, position_reference, joint_position, ...;
            a sample that is not known is NaN.

        Raises
        ------
        DataRejected
            Where axes or units do not belong to the arrays, or it is not known where the robot stood.

        Examples
        --------
        Ten seconds of one motor, sampled each millisecond, the angle in degrees:

        >>> import numpy as np, robid_core as robid
        >>> time = np.arange(10_000) * 1e-3
        >>> record = robid.Record.from_arrays(
        ...     motor_position=360 * np.sin(6 * time), motor_torque=0.2 * np.cos(6 * time), sample_time_s=1e-3,
        ...     units={"motor_position": "deg"}, robot=robid.Robot.load("one_axis"))
        >>> record.axis_names, record.run.values("motor_position").shape
        (('axis_1',), (1, 1, 1, 1, 10000, 1))
        >>> print(f"{record.run.values('motor_position').max():.3f} rad")
        6.283 rad
        """
        if not channels:
            raise DataRejected("a record needs channels, as motor_position=..., motor_torque=...")
        wanted = list(excited_hz)
        if wanted and torque_hold is None:
            raise DataRejected(
                "torque_hold is missing, which excited_hz goes with: zero_order_hold where a digital controller holds "
                "the torque from sample to sample, continuous where it was measured or filtered"
            )
        period = None if period_s is None else round(period_s / sample_time_s)
        full = {name: arrays.dense(name, values, axes, period) for name, values in channels.items()}
        shape = arrays.common_shape(full)
        made = {name: arrays.channel(name, one, (units or {}).get(name)) for name, one in full.items()}
        unknown = [name for name in units or {} if name not in full]
        if unknown:
            raise DataRejected(f"units: there is no channel {unknown[0]}; there are: {', '.join(full)}")
        position = made[MOTOR_POSITION].values if MOTOR_POSITION in made else None
        known = [np.isfinite(one.values).all(axis=-1) for name, one in made.items() if name in MEASURED]
        valid = np.logical_and.reduce(known) if known else np.full(shape[:-1], True)
        time_s = np.arange(shape[4], dtype=np.float64) * sample_time_s
        return cls(
            axis_names=arrays.names_of_axes(robot, axis_names, shape[5]),
            source=source,
            torque_hold=arrays.hold(torque_hold or "continuous"),
            runs=(DenseRun(sample_time_s, made, time_s, valid),),
            angle=arrays.angles(angle, robot, position, shape[0], shape[5]),
            line=arrays.bins(wanted, shape[4] * sample_time_s) if wanted else None,
        )

    def table(self, configuration: int = 0, block: int = 0, experiment: int = 0) -> Table:
        """Return the samples of one experiment: a column for time and one for each channel of each axis.

        Examples
        --------
        >>> import numpy as np, robid_core as robid
        >>> record = robid.Record.from_arrays(
        ...     motor_position=np.zeros((3, 2)), sample_time_s=0.5, angle=[[0.0, 0.0]])
        >>> record.table()["time_s"]
        [0.0, 0.5, 1.0]
        >>> list(record.table())
        ['time_s', 'motor_position.axis_1', 'motor_position.axis_2']
        """
        return record_table(self, configuration, block, experiment)

    @property
    def run(self) -> DenseRun:
        """Return the only run; DataRejected where there are several."""
        if len(self.runs) != 1:
            raise DataRejected(f"the record has {len(self.runs)} runs of different length; choose one")
        return self.runs[0]

    @property
    def frequency_hz(self) -> FloatArray:
        """Excited frequencies in Hz, shape (n_freq,)."""
        run = self.run
        period_s = run.sample_time_s * len(run.time_s)
        return self._lines() / period_s

    def training(self) -> Record:
        """Return the record without the experiments that are held out for tests, dense again.

        Raises
        ------
        DataRejected
            If none is left, or configurations and blocks do not keep equally many.

        Examples
        --------
        >>> import numpy as np, robid_core as robid
        >>> from robid_core.testing import example_record
        >>> record = example_record(robid.Robot.load("one_axis"))  # two configurations, two blocks
        >>> held_out = np.array([[[False], [True]], [[False], [True]]])
        >>> record.replace(runs=(record.run.replace(test=held_out),)).training().run.valid.shape[:3]
        (2, 1, 1)
        """
        if all(run.test is None or not run.test.any() for run in self.runs):
            return self
        assert self.run.test is not None
        return self.part(~self.run.test)

    def part(self, kept: BoolArray) -> Record:
        """Return the record of some of its experiments, a mask of shape (n_config, n_block, n_exp).

        Configurations and blocks of which nothing is kept go; raises as `training`.

        >>> import numpy as np, robid_core as robid
        >>> from robid_core.testing import example_record
        >>> record = example_record(robid.Robot.load("one_axis"))  # two configurations, two blocks
        >>> record.part(np.array([[[True], [True]], [[False], [False]]]))
        <Record (example): 1 configurations, 3 s of axis_1, 19 excited lines; channels motor_position, motor_torque,
        speed_reference>
        """
        index = packed(kept)
        configurations = index[0].ravel()
        deviation = self.damping_deviation
        return self.replace(
            runs=(self.run.experiments(index),),
            angle=self.angle[configurations],
            damping_deviation=None if deviation is None else deviation[configurations],
            variants=tuple(self.variants[i] for i in configurations) if self.variants else (),
        )

    def damping_deviation_at(self, frequency_hz: FloatArray) -> FloatArray | None:
        """`damping_deviation` at other frequencies, (n_config, n_freq, n_axis), constant beyond the lines.

        >>> import numpy as np, robid_core as robid
        >>> from robid_core.testing import example_record
        >>> record = example_record(robid.Robot.load("one_axis"))  # two configurations, 19 lines
        >>> record.replace(damping_deviation=np.full((2, 19, 1), 0.01)).damping_deviation_at(np.array([20.5])).shape
        (2, 1, 1)
        """
        if self.damping_deviation is None:
            return None
        own = np.log(self.frequency_hz)
        result: FloatArray = np.apply_along_axis(
            lambda values: np.interp(np.log(frequency_hz), own, values), 1, self.damping_deviation
        )
        return result

    def _lines(self) -> IntArray:
        if self.line is None:
            raise DataRejected("the record is not periodic: it has no excited lines")
        return self.line

    def spectra(self, discard: int = 0) -> tuple[ComplexArray, ComplexArray]:
        """Spectra of motor torque (input) and motor acceleration (output) at the excited lines.

        Period average of the DFT (thesis eq. 3.3, here scaled by 1/n_sample, so that a cosine of amplitude
        A gives A/2), acceleration as (i w)^2 times the position, exact for a periodic steady state.

        Parameters
        ----------
        discard
            Leading periods dropped as transient.

        Returns
        -------
        (u, y), each (n_config, n_block, n_freq, n_axis, n_exp), in N m and rad/s^2.

        Raises
        ------
        DataRejected
            If a period that is kept has a missing sample, or none is left.

        Examples
        --------
        >>> import robid_core as robid
        >>> from robid_core.testing import example_record
        >>> u, y = example_record(robid.Robot.load("one_axis")).spectra(discard=1)
        >>> u.shape, y.shape
        ((2, 2, 19, 1, 1), (2, 2, 19, 1, 1))
        """
        u, y = self.spectra_by_period(discard)
        return u.mean(axis=-1), y.mean(axis=-1)

    def spectra_by_period(self, discard: int = 0) -> tuple[ComplexArray, ComplexArray]:
        """Spectra as `spectra` gives them, before the average over periods.

        Returns (u, y), each (n_config, n_block, n_freq, n_axis, n_exp, n_period - discard).

        >>> import robid_core as robid
        >>> from robid_core.testing import example_record
        >>> u, y = example_record(robid.Robot.load("one_axis")).spectra_by_period(discard=1)
        >>> u.shape
        (2, 2, 19, 1, 1, 2)
        """
        omega = 2 * np.pi * self.frequency_hz
        u = self.period_spectra(MOTOR_TORQUE, discard)
        y = self.period_spectra(MOTOR_POSITION, discard) * -(omega[:, None] ** 2)
        # (config, block, exp, period, freq, axis) -> (config, block, freq, axis, exp, period)
        return np.moveaxis(u, (2, 3), (-2, -1)), np.moveaxis(y, (2, 3), (-2, -1))

    def reference_spectra(self, discard: int = 0) -> ComplexArray:
        """Spectra of the reference at the excited lines, averaged over periods.

        The speed reference where the record has one, else the position reference; returns shape (n_config, n_block,
        n_freq, n_axis, n_exp), in rad/s or rad. Raises as `spectra`, and where there is no reference.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_record
        >>> example_record(robid.Robot.load("one_axis")).reference_spectra().shape
        (2, 2, 19, 1, 1)
        """
        present = self.run.channels
        if SPEED_REFERENCE not in present and POSITION_REFERENCE not in present:
            raise DataRejected(
                "A06: the record has no reference channel (speed_reference or position_reference), which joint "
                f"input-output methods need; it has {', '.join(sorted(present))}"
            )
        channel = SPEED_REFERENCE if SPEED_REFERENCE in present else POSITION_REFERENCE
        return np.moveaxis(self.period_spectra(channel, discard).mean(axis=3), 2, -1)

    def speed_levels(self, discard: int = 0) -> tuple[FloatArray, FloatArray]:
        """Root mean square of the motors' speed without the slow sine, and the slow sine's amplitude.

        Returns (rms, amplitude), each (n_config, n_axis), in rad/s; see `estimation.distortion.speed`.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_record
        >>> rms, amplitude = example_record(robid.Robot.load("one_axis")).speed_levels()
        >>> rms.round(2).ravel().tolist(), amplitude.round(2).ravel().tolist()
        ([0.22, 0.24], [0.53, 0.54])
        """
        from robid_core.estimation.distortion.speed import speed_levels

        position, step = self.run.values(MOTOR_POSITION)[:, :, :, discard:], self.run.sample_time_s
        levels = [speed_levels(one, self._lines(), step) for one in position]
        return np.stack([rms for rms, _ in levels]), np.stack([sine for _, sine in levels])

    def travel_covariance(self, discard: int = 0) -> FloatArray:
        """Covariance of the motors' angles about their mean in each experiment, (n_config, n_axis, n_axis), rad^2.

        Mean over the experiments of a configuration; most of it is the slow sine's.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_record
        >>> (1e3 * example_record(robid.Robot.load("one_axis")).travel_covariance()).round(2).tolist()
        [[[0.22]], [[0.23]]]
        """
        position = self.run.values(MOTOR_POSITION)[:, :, :, discard:].mean(axis=3)
        about = position - position.mean(axis=3, keepdims=True)
        about = about.reshape(len(position), -1, position.shape[-1])
        result: FloatArray = about.swapaxes(1, 2) @ about / about.shape[1]
        return result

    def period_spectra(self, channel: str, discard: int = 0, line: IntArray | None = None) -> ComplexArray:
        """DFT of each period of a channel, scaled by 1/n_sample, at the excited lines or at the bins `line`.

        Returns shape (n_config, n_block, n_exp, n_period - discard, n_freq, n_axis). Raises as `spectra`.

        >>> import numpy as np, robid_core as robid
        >>> time = 1e-3 * np.arange(1000)
        >>> record = robid.Record.from_arrays(
        ...     motor_torque=3 * np.cos(2 * np.pi * 5 * time), sample_time_s=1e-3, angle=[[0.0]], excited_hz=[5],
        ...     torque_hold="zero_order_hold")
        >>> abs(record.period_spectra("motor_torque")).round(6).ravel().tolist()  # half the amplitude
        [1.5]
        """
        run = self.run
        if discard >= run.n_period:
            raise DataRejected(
                f"{run.n_period} periods were measured and {discard} are to be dropped: none is left"
            )
        if not run.valid[:, :, :, discard:].all():
            c, m, e, p, n = (int(i) for i in np.argwhere(~run.valid[:, :, :, discard:])[0])
            raise DataRejected(
                f"a sample is missing in {run.sample_place(c, m, e, p + discard, n)}; cut the recording there, or read "
                "it with gaps: split"
            )
        values = run.values(channel)[:, :, :, discard:]
        if not np.isfinite(values).all():
            bad = np.argwhere(~np.isfinite(values))
            c, m, e, p, n, a = (int(i) for i in bad[0])
            raise DataRejected(
                f"A05: {channel} of {self.axis_names[a]} is NaN or infinite in {len(bad)} samples, first in "
                f"{run.sample_place(c, m, e, p + discard, n)}; mark such samples as missing, or drop the period"
            )
        wanted = self._lines() if line is None else line
        spectrum = np.fft.rfft(values, axis=4)[:, :, :, :, wanted]
        result: ComplexArray = spectrum / values.shape[4]
        return result
