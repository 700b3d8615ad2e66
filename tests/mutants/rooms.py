"""Broken mutants of gate, lock, stop path and store; `stop_path.py` has more of the stop path."""

from __future__ import annotations

from mutants.mutant import Mutant

GATE = "robid_core/gate.py"
NO_MOTION = "tests/robid_core/test_gate.py::test_what_is_no_motion_is_refused_with_the_reason"
COVERS = "tests/robid_core/test_gate.py::test_a_clearance_covers_exactly_what_was_checked"
OF_GATE = [
    Mutant("NaN passes", GATE, "        if not np.isfinite(part).all():", "        if False:", NO_MOTION),
    Mutant("whole numbers pass", GATE, "part.dtype == np.float64 and part.ndim", "part.ndim", NO_MOTION),
    Mutant(
        "other motors pass",
        GATE,
        "    if not (reference.size and reference.shape[1] == len(start)):",
        "    if not reference.size:",
        NO_MOTION,
    ),
    Mutant(
        "no sample passes",
        GATE,
        "    if not (reference.size and reference.shape[1] == len(start)):",
        "    if not reference.shape[1] == len(start):",
        NO_MOTION,
    ),
    Mutant(
        "True is one period",
        GATE,
        "isinstance(periods, bool) or not isinstance(periods",
        "not isinstance(periods",
        NO_MOTION,
    ),
    Mutant("no period passes", GATE, "or periods < 1:", "or periods < 0:", NO_MOTION),
    Mutant("no time passes", GATE, "0 < sample_time_s < np.inf", "0 <= sample_time_s < np.inf", NO_MOTION),
    Mutant("endless time passes", GATE, "0 < sample_time_s < np.inf", "0 < sample_time_s", NO_MOTION),
    Mutant("a limit may be NaN", GATE, "        if np.isnan(value).any():", "        if False:", NO_MOTION),
    Mutant("limits of other motors", GATE, " and value.shape == (n_axis,)", "", NO_MOTION),
    Mutant(
        "limits without names", GATE, "    if len(limits.axis_names) != n_axis:", "    if False:", NO_MOTION
    ),
    Mutant(
        "any start is cleared",
        GATE,
        "    for part in (start, reference):",
        "    for part in (reference,):",
        COVERS,
    ),
    Mutant(
        "any clock is cleared",
        GATE,
        "repr((float(sample_time_s), int(periods)))",
        "repr(int(periods))",
        COVERS,
    ),
    Mutant(
        "any number of periods is cleared",
        GATE,
        "repr((float(sample_time_s), int(periods)))",
        "repr(float(sample_time_s))",
        COVERS,
    ),
    Mutant("any shape is cleared", GATE, "        digest.update(repr(data.shape).encode())\n", "", COVERS),
    Mutant(
        "half a period is cleared",
        GATE,
        "        if _flaw(start, reference, sample_time_s, periods):",
        "        if False:",
        COVERS,
    ),
    Mutant(
        "any motion is cleared",
        GATE,
        "        return self.sha256 == _digest(start, reference, sample_time_s, periods)",
        "        return True",
        COVERS,
    ),
]

LOCK = "robid_core/run/lock.py"
SECOND_RUN = "tests/robid_core/run/test_two_runs.py::test_a_second_run_is_told_who_holds_the_folder_or_waits"
WAITING = "tests/robid_core/run/test_two_runs.py::test_waiting_says_once_for_whom"
OF_LOCK = [
    Mutant(
        "the lock is shared",
        LOCK,
        "fcntl.LOCK_EX | fcntl.LOCK_NB",
        "fcntl.LOCK_SH | fcntl.LOCK_NB",
        SECOND_RUN,
    ),
    Mutant("a held lock is taken", LOCK, "        return False", "        return True", SECOND_RUN),
    Mutant(
        "who may not wait waits",
        LOCK,
        "                if not wait:",
        "                if False:",
        SECOND_RUN,
    ),
    Mutant(
        "who asks wipes the holder's name",
        LOCK,
        "os.O_RDWR | os.O_CREAT",
        "os.O_RDWR | os.O_CREAT | os.O_TRUNC",
        SECOND_RUN,
    ),
    Mutant(
        "the holder writes no name",
        LOCK,
        '            _write(descriptor, {"pid": os.getpid(), "host": socket.gethostname(), "since": _now()})',
        "            pass",
        WAITING,
    ),
    Mutant(
        "the name stays",
        LOCK,
        "                os.ftruncate(descriptor, 0)\n",
        "                pass\n",
        WAITING,
    ),
    Mutant(
        "waiting is reported again and again",
        LOCK,
        "                waiting(holder)\n                while not _try(descriptor):\n",
        "                while not _try(descriptor):\n                    waiting(holder)\n",
        WAITING,
    ),
]

STOP = "adapters/robid_can/host/stopping.py"
STOPPING = "tests/adapters/robid_can/test_can_stopping.py"
WITHIN_A_CYCLE = f"{STOPPING}::test_D06_every_drive_is_told_within_one_cycle_whoever_disobeys"
OF_STOP = [
    Mutant(
        "a stop waits for a bus that is full",
        STOP,
        "    link.stopping = True",
        "    link.stopping = False",
        f"{STOPPING}::test_B11_a_bus_that_takes_nothing_is_tried_for_every_drive_and_told",
    ),
    Mutant(
        "an old answer confirms rest",
        STOP,
        "        drive.last_answer(key)  #",
        "        pass  #",
        f"{STOPPING}::test_what_a_drive_said_before_the_stop_confirms_no_rest",
    ),
    Mutant(
        "voltage stays on",
        STOP,
        "    _tell(link, drives, state.DISABLE_VOLTAGE, problems)",
        "    pass",
        f"{STOPPING}::test_a_drive_that_holds_its_motor_after_a_quick_stop_is_switched_off",
    ),
    Mutant(
        "off is believed",
        STOP,
        "    return state.state_of(statusword) in VOLTAGE_OFF",
        "    return True",
        WITHIN_A_CYCLE,
    ),
    Mutant(
        "a silent drive stands",
        STOP,
        "    return list(open_ones.items())",
        "    return [one for one in open_ones.items() if one[1] is not None]",
        f"{STOPPING}::test_the_broadcast_stops_a_drive_whose_sdo_server_hangs",
    ),
    Mutant(
        "speeds are reported in the drive's units",
        STOP,
        "abs(speed) * drive.scale.velocity",
        "abs(speed)",
        f"{STOPPING}::test_rest_is_what_the_speed_says_not_the_command",
    ),
    Mutant("rest is waited for ten times as long", STOP, "STOP_S = 2.0", "STOP_S = 20.0", WITHIN_A_CYCLE),
    Mutant(
        "one problem is reported",
        STOP,
        "    return list(dict.fromkeys(problems))",
        "    return problems[:1]",
        WITHIN_A_CYCLE,
    ),
]

STORE, ENTRY, FILES = "robid_core/store/store.py", "robid_core/store/entry.py", "robid_core/store/files.py"
TEST_STORE = "tests/robid_core/store/test_store.py"
PUT = f"{TEST_STORE}::test_what_is_put_is_found_and_read"
DAMAGED = f"{TEST_STORE}::test_bytes_that_are_gone_or_changed_are_no_artifact"
CRASH = (
    "tests/robid_core/store/test_crash_states.py::test_an_artifact_is_whole_or_absent_in_every_crash_state"
)
DAMAGE, ONE_STORE = "tests/robid_core/run/test_damage.py", "tests/robid_core/run/test_one_store.py"
OF_STORE = [
    Mutant(
        "bytes are not compared",
        STORE,
        'return "" if found == entry.sha256 else',
        'return "" if found else',
        DAMAGED,
    ),
    Mutant(
        "missing bytes are there",
        STORE,
        '            return f"{blob} is missing"',
        '            return ""',
        DAMAGED,
    ),
    Mutant(
        "read without a look",
        STORE,
        "        blob = self.verified_path(entry)\n",
        "        blob = self.blobs / entry.blob_name\n",
        DAMAGED,
    ),
    Mutant(
        "only the first block is hashed",
        FILES,
        "            while block := file.read(CHUNK):",
        "            if block := file.read(CHUNK):",
        DAMAGED,
    ),
    Mutant(
        "new bytes are dropped",
        STORE,
        "                if self._problem(entry):\n",
        "                if not self._problem(entry):\n",
        PUT,
    ),
    Mutant(
        "content is not brought to the disk",
        STORE,
        "        self.files.sync(draft)\n        self.files.replace(draft, path)\n",
        "        self.files.replace(draft, path)\n",
        CRASH,
    ),
    Mutant(
        "names are not brought to the disk",
        STORE,
        "        self.files.sync_folder(path.parent)\n\n    def _drop",
        "\n    def _drop",
        CRASH,
    ),
    Mutant(
        "folders are not brought to the disk",
        STORE,
        "                self.files.sync_folder(folder)\n",
        "                pass\n",
        CRASH,
    ),
    Mutant(
        "bytes can be written to",
        STORE,
        "            self.files.protect(draft)\n",
        "            pass\n",
        f"{TEST_STORE}::test_public_names_cost_no_space_and_are_read_only",
    ),
    Mutant(
        "drafts stay for ever",
        STORE,
        "                self.files.remove(self.temporary / name)\n",
        "                pass\n",
        f"{TEST_STORE}::test_drafts_that_a_killed_run_left_are_cleared",
    ),
    Mutant(
        "a name may be a path",
        STORE,
        "    if not SAFE_NAME.fullmatch(name):",
        "    if not SAFE_NAME.match(name):",
        f"{TEST_STORE}::test_a_name_that_is_a_path_is_refused",
    ),
    Mutant(
        "the entry of another key is taken",
        STORE,
        "            if entry is None or entry.key != key:",
        "            if entry is None:",
        f"{DAMAGE}::test_a_damaged_index_entry_is_as_good_as_none",
    ),
    Mutant(
        "entries are not compared",
        ENTRY,
        "        if check != text_hash(canonical_json(content)):",
        "        if False:",
        f"{DAMAGE}::test_every_bit_of_an_index_entry_is_guarded",
    ),
    Mutant(
        "a newer format is read",
        ENTRY,
        "    if written > STORE_FORMAT:",
        "    if False:",
        f"{TEST_STORE}::test_a_store_of_a_newer_robid_is_refused_and_left_alone",
    ),
    Mutant(
        "a public file is never looked at",
        STORE,
        "            if path.exists() and (path.samefile(blob) or self.files.digest(path) == entry.sha256):",
        "            if path.exists():",
        f"{DAMAGE}::test_a_public_file_that_was_replaced_or_deleted_comes_back",
    ),
    Mutant(
        "quarantine keeps the last only",
        STORE,
        "for candidate in candidates if candidate not in taken)",
        "for candidate in candidates if candidate)",
        f"{DAMAGE}::test_a_flipped_byte_anywhere_is_found_and_mended",
    ),
    Mutant(
        "damage of another run is taken over",
        STORE,
        "                if other.lookup(key).state is State.PRESENT:",
        "                if other.lookup(key).state is not State.ABSENT:",
        f"{ONE_STORE}::test_a_damaged_artifact_of_another_run_is_not_taken",
    ),
    Mutant(
        "a newer run beside ends this one",
        STORE,
        "            with contextlib.suppress(StoreError):  #",
        "            with contextlib.nullcontext():  #",
        f"{ONE_STORE}::test_what_a_newer_robid_left_beside_is_passed_over",
    ),
    Mutant(
        "no copy where there are no second names",
        STORE,
        "            self.files.copy(blob, draft)\n",
        "            pass\n",
        "tests/robid_core/store/test_failing_calls.py::test_where_files_cannot_have_two_names_the_public_one_is_a_copy",
    ),
    Mutant(
        "a failed write leaves its draft",
        STORE,
        "            self.files.remove(draft)\n        except OSError:",
        "            pass\n        except OSError:",
        "tests/robid_core/store/test_failing_calls.py::test_a_real_write_that_stops_half_way_is_told_and_leaves_nothing",
    ),
]
