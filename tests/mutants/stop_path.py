"""Broken mutants of what stops a robot: drives that are told, signals, the end of a stage's process."""

from __future__ import annotations

from mutants.mutant import Mutant

STOPPING = "tests/adapters/robid_can/test_can_stopping.py"
INTERRUPTION = "tests/robid_core/test_interruption.py"
LIMITS = "tests/robid_core/run/test_limits.py"
TWO_RUNS = "tests/robid_core/run/test_two_runs.py"
STOP_PATH = [
    Mutant(
        "each drive is commanded after the one before was judged",
        "adapters/robid_can/host/stopping.py",
        "        _attempt(lambda drive=drive: drive.send_write(od.CONTROLWORD, controlword), problems)",
        "        _attempt(lambda d=drive: (link.attend(0.1), d.send_write(od.CONTROLWORD, controlword)), problems)",
        f"{STOPPING}::test_the_first_frames_of_a_stop_are_those_of_the_standards",
    ),
    Mutant(
        "no broadcast",
        "adapters/robid_can/host/stopping.py",
        "    for command in (STOP_NODE, ENTER_PRE_OPERATIONAL):",
        "    for command in ():",
        f"{STOPPING}::test_the_broadcast_stops_a_drive_whose_sdo_server_hangs",
    ),
    Mutant(
        "broadcast alone",
        "adapters/robid_can/host/stopping.py",
        "    _tell(link, drives, state.QUICK_STOP, problems)",
        "    _tell(link, (), state.QUICK_STOP, problems)",
        f"{STOPPING}::test_the_controlword_stops_a_drive_that_ignores_the_network",
    ),
    Mutant(
        "rest is believed from the command",
        "adapters/robid_can/host/stopping.py",
        "        standing[drive.name] = 0 if speed else standing[drive.name] + 1",
        "        standing[drive.name] = standing[drive.name] + 1",
        f"{STOPPING}::test_rest_is_what_the_speed_says_not_the_command",
    ),
    Mutant(
        "one reading of zero is rest",
        "adapters/robid_can/host/stopping.py",
        "AT_REST = 2",
        "AT_REST = 1",
        f"{STOPPING}::test_a_turning_point_is_no_rest",
    ),
    Mutant(
        "the first error ends the stop",
        "adapters/robid_can/host/stopping.py",
        "    except Exception as error:",
        "    except ZeroDivisionError as error:",
        f"{STOPPING}::test_B11_a_bus_that_takes_nothing_is_tried_for_every_drive_and_told",
    ),
    Mutant(
        "voltage off before the ramp has ended",
        "adapters/robid_can/host/stopping.py",
        "    _tell(link, drives, state.QUICK_STOP, problems)",
        "    _tell(link, drives, state.DISABLE_VOLTAGE, problems)",
        f"{STOPPING}::test_each_axis_ramps_down_by_its_own_deceleration_from_where_it_was",
    ),
    Mutant(
        "a motor takes the others out of their run",
        "adapters/robid_can/drive/motion.py",
        "        self.ramps[axis] = ramp",
        "        self.ramps = {other: self.ramps.get(other, ramp) for other in range(self.plant.n_axis)}",
        f"{STOPPING}::test_each_axis_ramps_down_by_its_own_deceleration_from_where_it_was",
    ),
    Mutant(
        "signals break into the stop",
        "adapters/robid_can/drives.py",
        "        self._safe_points.enter_context(at_safe_points())",
        "        pass",
        f"{STOPPING}::test_a_signal_that_comes_while_drives_are_stopped_at_the_end_interrupts_afterwards",
    ),
    Mutant(
        "an interruption says that all is well",
        "adapters/robid_can/drives.py",
        "        elif problems:",
        "        elif problems and cause is None:",
        f"{STOPPING}::test_D06_an_interruption_after_which_a_motor_turns_is_no_calm_one",
    ),
    Mutant(
        "a signal during the stop at the end is forgotten",
        "adapters/robid_can/drives.py",
        "        if host is not None and not any(exception):",
        "        if host is None:",
        f"{STOPPING}::test_a_signal_that_comes_while_drives_are_stopped_at_the_end_interrupts_afterwards",
    ),
    Mutant(
        "no latch",
        "robid_core/interruption.py",
        "    first, _latch.requested = not _latch.requested, True",
        "    first = False",
        f"{INTERRUPTION}::test_a_signal_that_python_drops_is_met_at_the_next_look",
    ),
    Mutant(
        "a second signal raises again",
        "robid_core/interruption.py",
        "    if not (_latch.held or _latch.at_safe_points or _latch.over.is_set() or _being_handled()):",
        "    if not (_latch.held or _latch.at_safe_points or _latch.over.is_set()):",
        f"{INTERRUPTION}::test_a_signal_right_after_another_does_not_break_into_what_the_first_cleans_up",
    ),
    Mutant(
        "nobody is reminded",
        "robid_core/interruption.py",
        "    if first:\n",
        "    if False:\n",
        f"{INTERRUPTION}::test_a_signal_that_python_drops_wakes_who_sleeps_all_the_same",
    ),
    Mutant(
        "progress does not look",
        "robid_core/run/calling.py",
        "            heed()\n",
        "            pass\n",
        f"{TWO_RUNS}::test_D18_an_interrupt_that_got_lost_ends_the_run_at_the_next_progress",
    ),
    Mutant(
        "waiting does not look",
        "robid_core/run/lock.py",
        "                    heed()\n",
        "                    raise SystemExit\n",
        f"{TWO_RUNS}::test_D18_an_interrupt_ends_the_waiting_for_another_run",
    ),
    Mutant(
        "the handler comes after the application",
        "robid_core/commands/__init__.py",
        "    with signals_as_interrupt():\n",
        "    import robid_core.commands.app\n    with signals_as_interrupt():\n",
        f"{INTERRUPTION}::test_the_command_line_listens_before_it_loads_anything",
    ),
    Mutant(
        "only the group is killed",
        "robid_core/run/confine.py",
        "            self._process.kill()\n",
        "",
        f"{LIMITS}::test_a_deadline_that_passes_while_the_process_still_starts_ends_it",
    ),
    Mutant(
        "the end is waited for without limit",
        "robid_core/run/confine.py",
        "            self._process.kill()\n            self._process.join(GONE_S)",
        "            self._process.kill()\n            self._process.join(30)",
        f"{LIMITS}::test_a_process_that_cannot_be_collected_is_not_waited_for",
    ),
    Mutant(
        "drives are not asked to stop",
        "robid_core/run/confine.py",
        "            os.kill(self._process.pid, signal.SIGTERM)",
        "            os.kill(self._process.pid, signal.SIGKILL)",
        f"{LIMITS}::test_a_stage_with_drives_may_stop_them_before_it_is_killed",
    ),
    Mutant(
        "a process that was asked to stop is waited for without limit",
        "robid_core/run/confine.py",
        "            while time.monotonic() < limit:\n                message = self._hear()",
        "            while time.monotonic() < limit + 30:\n                message = self._hear()",
        f"{LIMITS}::test_a_stage_with_drives_that_does_not_end_is_killed_all_the_same",
    ),
]
