"""The host: drives up, experiments in trace mode, and a controlled stop on every way out.

The reference is loaded into the drives and sampled there on their own clock; nothing depends on the host's
timing. All drives start at one SYNC.
"""

from __future__ import annotations

from collections.abc import Sequence

import canopen
import numpy as np
import numpy.typing as npt

from robid_can import dictionary as od
from robid_can.host import bring_up, state
from robid_can.host.link import Link
from robid_can.host.remote import ExpectedDrive, RemoteDrive
from robid_can.host.stopping import stop_all
from robid_core import DataRejected, Experiment, Trace

SYNC = 0x080
STATE_CHECK_S = 1.0  # how often statuswords are read while the drives run by themselves
GRACE_S = 2.0  # over the computed duration of a motion
START_WINDOW_RAD = 1e-3  # motor side; where the start position counts as reached
IntArray = npt.NDArray[np.int32]


class Host:
    """Supervises drives; every method raises MotionRefused before, MotionAborted after the first motion."""

    def __init__(
        self, link: Link, expected: Sequence[ExpectedDrive], dictionary: canopen.ObjectDictionary
    ) -> None:
        self.link = link
        self.dictionary = dictionary
        self.drives = [RemoteDrive(link, drive, dictionary) for drive in expected]

    def bring_up(self, bitrate: int, sample_time_s: float) -> None:
        """Find, identify, configure, start and enable all drives."""
        bring_up.find(self.link, self.drives, bitrate)
        for drive in self.drives:
            bring_up.identify(self.link, drive, self.dictionary)
        for drive in self.drives:
            bring_up.configure(self.link, drive, sample_time_s)
            bring_up.see_ramp(self.link, drive)
        self.link.start_heartbeat()
        bring_up.start(self.link, self.drives)
        for drive in self.drives:
            bring_up.see_no_fault(self.link, drive)  # of all, before the first is switched on
        for drive in self.drives:
            bring_up.enable(self.link, drive)

    def perform(self, experiment: Experiment) -> Trace:
        """Move to the start, load the references, run them and read the traces."""
        if not experiment.cleared:
            raise self.link.failure(
                f"D03: {experiment.label}: the commands are not the ones that were cleared"
            )
        references = [
            od.increments(experiment.reference[:, axis], drive.scale.velocity, np.int32)
            for axis, drive in enumerate(self.drives)
        ]
        self.move_to(experiment.start)
        for drive, reference in zip(self.drives, references, strict=True):
            self._load(drive, reference.astype(od.REFERENCE_SAMPLE), experiment)
        self.link.send_message(SYNC, b"")
        self._supervise(experiment)
        return self._read(experiment, references)

    # Motion

    def move_to(self, start: npt.NDArray[np.float64]) -> None:
        """Bring all motors to their start angles, rad, and see that they are there."""
        longest_s = 0.0
        for drive, angle in zip(self.drives, start, strict=True):
            way = abs(angle - drive.read(od.POSITION_ACTUAL) * drive.scale.position)
            longest_s = max(longest_s, way / (drive.read(od.PROFILE_VELOCITY) * drive.scale.velocity))
            drive.write(od.MODE, od.PROFILE_POSITION)
            drive.write(od.TARGET_POSITION, round(angle / drive.scale.position))
        self.link.supervise()  # what has gone wrong until here is refused, for nothing has moved
        self.link.moving = True
        for drive in self.drives:
            drive.write(od.CONTROLWORD, state.ENABLE_OPERATION | state.NEW_SET_POINT)
            if not self._enabled(drive) & state.SET_POINT_ACKNOWLEDGE:
                raise self.link.failure(f"D07: {drive.name} did not take its start position")
            drive.write(od.CONTROLWORD, state.ENABLE_OPERATION)
        if not self.link.until(self._all_reached, longest_s + GRACE_S):
            raise self.link.failure(
                f"D01: the start position is not reached within {longest_s + GRACE_S:.1f} s"
            )
        for drive, angle in zip(self.drives, start, strict=True):
            found = drive.read(od.POSITION_ACTUAL) * drive.scale.position
            if not abs(found - angle) <= max(START_WINDOW_RAD, drive.scale.position):
                raise self.link.failure(
                    f"D11: {drive.name} stands at {found:.6g} rad, its start is {angle:.6g} rad"
                )

    def _all_reached(self) -> bool:
        return all(self._enabled(drive) & state.TARGET_REACHED for drive in self.drives)

    def _enabled(self, drive: RemoteDrive) -> int:
        """Return the statusword of a drive that must be in operation."""
        shown, word = drive.state()
        if shown != state.OPERATION_ENABLED:
            code = drive.read(od.ERROR_CODE)
            raise self.link.failure(
                f"D07: {drive.name} left operation: it shows '{shown}', error code 0x{code:04X}"
            )
        return word

    def _load(self, drive: RemoteDrive, reference: IntArray, experiment: Experiment) -> None:
        drive.write(od.TARGET_VELOCITY, 0)
        drive.write(od.MODE, od.CYCLIC_SYNCHRONOUS_VELOCITY)
        if drive.read(od.MODE_DISPLAY) != od.CYCLIC_SYNCHRONOUS_VELOCITY:
            raise self.link.failure(f"D07: {drive.name} does not enter cyclic synchronous velocity mode")
        drive.write(od.TRACE_PERIODS, experiment.periods)
        drive.write(od.TRACE_KEPT, experiment.traced)
        drive.block.download(od.REFERENCE_MEMORY, reference.tobytes())
        drive.write(od.TRACE_COMMAND, 1)

    def _supervise(self, experiment: Experiment) -> None:
        """Watch heartbeats, EMCY and states until the run has ended in every drive."""
        time = self.link.clock
        duration_s = experiment.periods * len(experiment.reference) * experiment.sample_time_s
        end, next_check = time.now() + duration_s, time.now() + STATE_CHECK_S
        while time.now() < end:
            self.link.wait(min(0.1, end - time.now()))
            if time.now() >= next_check:
                next_check += STATE_CHECK_S
                for drive in self.drives:
                    self._enabled(drive)
        if not self.link.until(self._all_traced, GRACE_S):
            raise self.link.failure(f"B02: {experiment.label}: the drives do not report the end of their run")

    def _all_traced(self) -> bool:
        states = [drive.read(od.TRACE_STATE) for drive in self.drives]
        if od.TraceState.ABORTED in states:
            name = self.drives[states.index(od.TraceState.ABORTED)].name
            raise self.link.failure(f"D07: {name} broke its run off")
        return all(shown == od.TraceState.COMPLETE for shown in states)

    def _read(self, experiment: Experiment, references: Sequence[npt.NDArray[np.signedinteger]]) -> Trace:
        shape = (experiment.traced, len(experiment.reference), len(self.drives))
        position, torque = np.empty(shape), np.empty(shape)
        clocks = [drive.read(od.TRACE_CLOCK) for drive in self.drives]
        if max(clocks) - min(clocks) > 0.5e6 * experiment.sample_time_s:
            raise DataRejected(
                f"A08: {experiment.label}: the drives' clocks are {max(clocks) - min(clocks)} us apart"
            )
        for axis, drive in enumerate(self.drives):
            rows = np.frombuffer(drive.block.upload(od.TRACE_MEMORY), dtype=od.TRACE_ROW)
            if len(rows) != shape[0] * shape[1]:
                raise DataRejected(
                    f"A11: {experiment.label}: {drive.name} kept {len(rows)} samples, {shape[0] * shape[1]} are wanted"
                )
            position[:, :, axis] = (rows["position"] * drive.scale.position).reshape(shape[:2])
            torque[:, :, axis] = (rows["torque"] * drive.scale.torque).reshape(shape[:2])
        n_saturated = [drive.read(od.TRACE_SATURATED) for drive in self.drives]
        scales = [drive.scale for drive in self.drives]
        return Trace(
            position=position,
            torque=torque,
            valid=np.ones(shape[:2], dtype=bool),
            saturated=np.array(n_saturated) / (shape[0] * shape[1]),
            reference=np.stack(references, axis=1) * np.array([scale.velocity for scale in scales]),
            time_s=min(clocks) * 1e-6,
            position_unit=np.array([scale.position for scale in scales]),
            torque_unit=np.array([scale.torque for scale in scales]),
            reference_unit=np.array([scale.velocity for scale in scales]),
        )

    # The way out

    def stop(self) -> list[str]:
        """Stop and switch off whatever was ever there; returns what is not confirmed, never raises for a drive."""
        self.link.watch.expected_state = None
        boot_ups = self.link.watch.boot_ups
        problems = stop_all(self.link, [d for d in self.drives if boot_ups[d.expected.node_id]])
        self.link.stop_heartbeat()
        return problems
