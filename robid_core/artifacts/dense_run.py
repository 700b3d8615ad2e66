"""Experiments of one length, sampled together: named channels, sampling instants, a mask, and under what they ran."""

from __future__ import annotations

from dataclasses import dataclass

from robid_core.arrays import BoolArray, FloatArray, IntArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.artifacts.evidence_tables import channel_table
from robid_core.artifacts.tables import Table
from robid_core.errors import DataRejected


@dataclass(frozen=True, eq=False)
class Channel(Artifact):
    """One measured quantity of every axis, with the sign of the URDF axis, on a stated side of the gear.

    `side` is "motor" or "joint". Names in use: motor_position, motor_speed, motor_torque, speed_reference,
    position_reference, joint_position, joint_torque, link_acceleration_x (and _y, _z; of an accelerometer on the link
    that the axis moves, in its own axes), link_turn_rate_x (likewise), temperature, drive_enabled (1 where a drive is
    on, 0 where its motor coasts).
    """

    side: str
    unit_symbol: str
    values: FloatArray = array("n_config n_block n_exp n_period n_sample n_axis", finite=False, known=True)


@dataclass(frozen=True, eq=False)
class DenseRun(Artifact):
    """Experiments of one length, sampled together.

    `time_s` holds the sampling instants within a period (or within the whole run when nothing repeats and
    n_period is 1); `valid` marks the samples that were really measured. `test` marks the experiments that are left
    out of every fit, to judge fits by; None: none is. `constants` holds numbers that did not change during
    an experiment (a payload, a temperature), called `constant_names`; NaN where one is not known.
    """

    sample_time_s: float
    channels: dict[str, Channel]
    time_s: FloatArray = array("n_sample", "s", rising=True)
    valid: BoolArray = array("n_config n_block n_exp n_period n_sample")
    test: BoolArray | None = array("n_config n_block n_exp", optional=True)
    constant_names: tuple[str, ...] = ()
    constants: FloatArray | None = array("n_config n_block n_exp n_constant", finite=False, optional=True)

    def __post_init__(self) -> None:
        """Check that every constant has a name."""
        super().__post_init__()
        n_constant = 0 if self.constants is None else self.constants.shape[3]
        if n_constant != len(self.constant_names):
            raise DataRejected(
                f"DenseRun.constants: {n_constant} constants with {len(self.constant_names)} names; give one for each"
            )

    def channel(self, name: str) -> Channel:
        """Return a channel by name; DataRejected names the ones that exist.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_record
        >>> example_record(robid.Robot.load("one_axis")).run.channel("motor_torque").unit_symbol
        'N m'
        """
        if name not in self.channels:
            raise DataRejected(f"the record has no channel {name}; it has {', '.join(sorted(self.channels))}")
        return self.channels[name]

    def values(self, name: str) -> FloatArray:
        """Return a channel's values, shape (n_config, n_block, n_exp, n_period, n_sample, n_axis).

        >>> import numpy as np, robid_core as robid
        >>> record = robid.Record.from_arrays(motor_position=np.zeros((50, 2)), angle=[[0.0, 0.0]], sample_time_s=1e-3)
        >>> record.run.values("motor_position").shape
        (1, 1, 1, 1, 50, 2)
        """
        return self.channel(name).values

    def lanes(self, name: str) -> FloatArray:
        """Return a channel's values, periods of each experiment one after another, (n_experiment, n_sample, n_axis).

        >>> import robid_core as robid
        >>> from robid_core.testing import example_record
        >>> example_record(robid.Robot.load("one_axis")).run.lanes("motor_torque").shape  # three periods of 500 samples
        (4, 1500, 1)
        """
        values = self.values(name)
        return values.reshape(-1, values.shape[3] * values.shape[4], values.shape[5])

    def constant(self, name: str) -> FloatArray:
        """Return a constant of every experiment, shape (n_config, n_block, n_exp); DataRejected names what there is.

        >>> import numpy as np, robid_core as robid
        >>> run = robid.Record.from_arrays(motor_position=np.zeros((3, 2)), sample_time_s=0.5, angle=[[0.0, 0.0]]).run
        >>> run.replace(constant_names=("payload",), constants=np.full((1, 1, 1, 1), 2.5)).constant("payload").item()
        2.5
        """
        if self.constants is None or name not in self.constant_names:
            known = ", ".join(self.constant_names) or "none"
            raise DataRejected(f"the record has no constant {name}; it has {known}")
        result: FloatArray = self.constants[..., self.constant_names.index(name)]
        return result

    def experiments(self, index: tuple[IntArray, IntArray, IntArray]) -> DenseRun:
        """Return the run of some experiments, by the index that `packing.packed` makes.

        >>> import robid_core as robid
        >>> from robid_core.artifacts.packing import packed
        >>> from robid_core.testing import example_record
        >>> run = example_record(robid.Robot.load("one_axis")).run  # two configurations, two blocks
        >>> run.experiments(packed(run.valid.all(axis=(3, 4)) & [[[True], [False]]])).valid.shape[:3]
        (2, 1, 1)
        """
        return self.replace(
            channels={
                name: channel.replace(values=channel.values[index]) for name, channel in self.channels.items()
            },
            valid=self.valid[index],
            test=None if self.test is None else self.test[index],
            constants=None if self.constants is None else self.constants[index],
        )

    def sample_place(self, configuration: int, block: int, experiment: int, period: int, sample: int) -> str:
        """Return words for the place of a sample, by its indices: people count experiments from one.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_record
        >>> example_record(robid.Robot.load("one_axis")).run.sample_place(1, 0, 0, 2, 250)
        'configuration 2, block 1, experiment 1, period 3, at 0.2500 s'
        """
        return (
            f"configuration {configuration + 1}, block {block + 1}, experiment {experiment + 1}, period {period + 1}, "
            f"at {self.time_s[sample]:.4f} s"
        )

    def table(self) -> Table:
        """Return a row for each channel: its side of the gear, its unit, its smallest and largest value.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_record
        >>> table = example_record(robid.Robot.load("one_axis")).run.table()
        >>> table["channel"], table["unit"]
        (['motor_position', 'motor_torque', 'speed_reference'], ['rad', 'N m', 'rad/s'])
        """
        return channel_table(self)

    @property
    def n_period(self) -> int:
        """Periods measured."""
        return int(self.valid.shape[3])
