"""Experiments of recorded runs as lanes of the simulator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid_core.arrays import FloatArray
from robid_core.artifacts import DenseRun
from robid_core.errors import DataRejected

DRIVE_ENABLED = "drive_enabled"  # channel: 1 where a drive is on, 0 where its motor coasts


@dataclass(frozen=True, eq=False)
class RecordedLanes:
    """Experiments of one run as lanes of the simulator, periods joined, motor side, each (n_lane, n_sample, n_axis)."""

    position: FloatArray
    torque: FloatArray | None
    """None where it was not recorded."""
    speed_reference: FloatArray
    position_reference: FloatArray | None
    enabled: FloatArray | None = None
    """1 where a drive is on, 0 where it is off; None: all are on."""

    @property
    def kind(self) -> tuple[bool, ...]:
        """Which channels there are."""
        return tuple(one is not None for one in (self.torque, self.position_reference, self.enabled))

    def through(self, function: Callable[[FloatArray], FloatArray]) -> RecordedLanes:
        """Return what a function makes of every channel that there is."""
        torque, aim, enabled = self.torque, self.position_reference, self.enabled
        return RecordedLanes(
            function(self.position),
            None if torque is None else function(torque),
            function(self.speed_reference),
            None if aim is None else function(aim),
            None if enabled is None else function(enabled),
        )


def recorded_lanes(run: DenseRun) -> RecordedLanes:
    """Return every experiment of a run as a lane.

    Where only a position reference was recorded, the speed reference is its derivative.

    Raises
    ------
    DataRejected
        If there is no reference, or a sample is missing.
    """
    if not run.valid.all():
        raise DataRejected(
            "samples are missing in the record, and a simulation needs the whole reference; cut the recording there, "
            "or read it with gaps: split"
        )

    def joined(name: str) -> FloatArray:
        values = run.lanes(name)
        if not np.isfinite(values).all():
            raise DataRejected(f"{name} was not recorded on every axis; a simulation needs all")
        return values

    position_reference = joined("position_reference") if "position_reference" in run.channels else None
    if "speed_reference" in run.channels:
        speed_reference = joined("speed_reference")
    elif position_reference is not None:
        speed_reference = np.gradient(position_reference, run.sample_time_s, axis=1)
    else:
        raise DataRejected(
            "the record has neither position_reference nor speed_reference; map the channel that the controller "
            "followed"
        )
    torque = joined("motor_torque") if "motor_torque" in run.channels else None
    enabled = joined(DRIVE_ENABLED) if DRIVE_ENABLED in run.channels else None
    if enabled is not None and not np.isin(enabled, (0.0, 1.0)).all():
        raise DataRejected(
            f"{DRIVE_ENABLED} says when drives are on and must be 0 or 1; it has values from {enabled.min():g} to "
            f"{enabled.max():g}"
        )
    return RecordedLanes(joined("motor_position"), torque, speed_reference, position_reference, enabled)


def side_by_side(each: Sequence[RecordedLanes]) -> RecordedLanes:
    """Lanes of several runs of one kind as those of one; shorter ones stand still behind their end."""
    length = max(lanes.position.shape[1] for lanes in each)

    def joined(name: str, behind: Literal["edge", "constant"] = "edge") -> FloatArray:
        own = [getattr(lanes, name) for lanes in each]
        return np.concatenate(
            [np.pad(one, ((0, 0), (0, length - one.shape[1]), (0, 0)), behind) for one in own]
        )

    with_torque, with_aim, with_enabled = each[0].kind
    return RecordedLanes(
        joined("position"),
        joined("torque") if with_torque else None,
        joined("speed_reference", "constant"),
        joined("position_reference") if with_aim else None,
        joined("enabled") if with_enabled else None,
    )
