"""What is special about a stage that moves hardware: it is made once, and never by accident again."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from robid_core.errors import MotionRefused, StoreError
from robid_core.run.motion import MotionRecord, MotionRecords, refuse_unfinished
from robid_core.run.options import RunOptions
from robid_core.run.plan import Action, Decision


def recording_decision(
    decision: Decision,
    options: RunOptions,
    motions: MotionRecords,
    found_unfinished: Collection[MotionRecord],
) -> Decision:
    """Return the decision on a stage that moves hardware.

    Parameters
    ----------
    decision
        What would be done if it were a computation.
    options
        Whether a person is at the robot, and wants recordings made again.
    motions
        What was begun and finished before, and in this run.
    found_unfinished
        The motions that were unfinished when this run began; `--again` then means these.

    Raises
    ------
    MotionRefused
        If nobody is at the robot, a motion was begun and not finished, or `--force` names a recording.
    StoreError
        If the recording was made and is damaged or lost: nothing but a person makes it again.
    """
    name = decision.stage
    again = options.again and (not found_unfinished or name in {motion.stage for motion in found_unfinished})
    intact = decision.entry is not None and not decision.damaged
    if intact and not again:
        if name in options.force:
            raise MotionRefused(
                f"stage {name}: its recording was made on hardware, and --force makes no robot move; nothing was "
                "moved; to record it anew run with --at-the-robot --again"
            )
        kept = decision.reasons if decision.action is Action.KEEP else ()
        return replace(decision, action=Action.KEEP, reasons=kept)
    if not again:
        refuse_unfinished(name, [*motions.unfinished(), *motions.unfinished_elsewhere(decision.key)])
        if decision.damaged or motions.finished(decision.key):
            problem = (
                " ".join(decision.reasons) if decision.damaged else "its recording is no longer in the store"
            )
            raise StoreError(
                f"stage {name}: R06: {problem}; a recording made on hardware cannot be computed again, so nothing was "
                "changed; bring the file back from a copy, or record anew with --at-the-robot --again"
            )
    if not options.at_the_robot:
        raise MotionRefused(
            f"stage {name}: it would move the robot ({'; '.join(decision.reasons) or 'asked for by --again'}); nothing "
            "was moved; clear the cell, stand at the emergency stop, and run again with --at-the-robot"
        )
    reasons = ("--again",) if again and intact else decision.reasons
    return replace(decision, action=Action.MAKE, reasons=reasons)
