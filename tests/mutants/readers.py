"""Broken mutants of the readers of files, and of the process that they run in; `rooms.py` tries them."""

from __future__ import annotations

from mutants.mutant import Mutant

TABLES, MCAP = "adapters/robid_tables", "adapters/robid_mcap/reader.py"
OF_TABLES = "tests/adapters/robid_tables"
WRONG_TABLE = f"{OF_TABLES}/test_csv_records.py::test_a_wrong_table_is_told_by_line_and_column"
NOTATION = f"{OF_TABLES}/test_csv_records.py::test_a_number_in_another_notation_is_refused_and_never_taken_for_a_word"
WRONG_LOG = f"{OF_TABLES}/test_json_records.py::test_a_wrong_log_is_told"
MCAP_DAMAGE = "tests/adapters/robid_mcap/test_mcap_damage.py"
UNPACKED = f"{MCAP_DAMAGE}::test_A04_chunk_is_unpacked_to_the_size_that_it_states_or_not_at_all"
PROCESS, READING = "robid_core/foreign/process.py", "tests/robid_core/foreign/test_reading_process.py"
OF_READERS = [
    Mutant(
        "a longer line passes",
        f"{TABLES}/csv.py",
        "        if len(cells) == n_column:",
        "        if len(cells) >= n_column:",
        WRONG_TABLE,
    ),
    Mutant(
        "half a number passes",
        f"{TABLES}/csv.py",
        "    if cut is not None and not complete:",
        "    if False:",
        WRONG_TABLE,
    ),
    Mutant("two columns of one name", f"{TABLES}/layout.py", "    if twice:", "    if False:", WRONG_TABLE),
    Mutant(
        "zero bytes are text", f"{TABLES}/encoding.py", '    if "\\0" in text:', "    if False:", WRONG_TABLE
    ),
    Mutant(
        "an empty cell is zero",
        f"{TABLES}/notation.py",
        "        return math.nan",
        "        return 0.0",
        f"{OF_TABLES}/test_csv_records.py::test_an_empty_cell_is_not_a_number_and_never_zero",
    ),
    Mutant(
        "1,234 is near one",
        f"{TABLES}/csv.py",
        "    if all(TWO_MEANINGS.fullmatch(cell) for _, cell in commas):",
        "    if False:",
        NOTATION,
    ),
    Mutant(
        "1,5 is two numbers",
        f"{TABLES}/csv.py",
        "        _refuse_two_meanings(path, layout.body)\n",
        "        pass\n",
        NOTATION,
    ),
    Mutant(
        "a comma is certain",
        f"{TABLES}/csv.py",
        '"." in joined or not CERTAIN_COMMA.search(joined):',
        '"." in joined:',
        NOTATION,
    ),
    Mutant(
        "a name stands twice",
        f"{TABLES}/json.py",
        "        if len(entries) < len(pairs):",
        "        if False:",
        WRONG_LOG,
    ),
    Mutant(
        "a cut log is no JSON",
        f"{TABLES}/json.py",
        '"A01: the file looks cut" if cut else "no JSON"',
        '"no JSON"',
        WRONG_LOG,
    ),
    Mutant(
        "what is absent is not reported",
        f"{TABLES}/json.py",
        "    if missing:\n",
        "    if False:\n",
        f"{OF_TABLES}/test_json_records.py::test_what_an_entry_lacks_is_not_a_number_and_told",
    ),
    Mutant(
        "Python objects are opened",
        f"{TABLES}/npz.py",
        "    if dtype.hasobject:",
        "    if False:",
        f"{OF_TABLES}/test_npz_records.py::test_a_pickle_is_refused_and_never_run",
    ),
    Mutant(
        "columns are read as rows",
        f"{TABLES}/npz.py",
        'order="F" if in_columns else "C"',
        'order="C"',
        f"{OF_TABLES}/test_npz_records.py::test_arrays_come_back_as_numbers_and_text_is_left_out",
    ),
    Mutant(
        "a packed variable may end anywhere",
        f"{TABLES}/matlab_elements.py",
        "    if not packed.eof or left or packed.unused_data or unpacked != stated + TAG:",
        "    if False:",
        f"{OF_TABLES}/test_mat_records.py::test_a_packed_variable_must_fit_its_checksum",
    ),
    Mutant(
        "a variable may lack its last bytes",
        f"{TABLES}/matlab_elements.py",
        "place + TAG + length > size:",
        "place + length > size:",
        f"{OF_TABLES}/test_mat_records.py::test_a_variable_that_is_cut_is_told_with_its_byte",
    ),
    Mutant(
        "pages are not compared",
        "adapters/robid_parquet/records.py",
        "page_checksum_verification=True",
        "page_checksum_verification=False",
        "tests/adapters/robid_parquet/test_parquet_records.py::test_a_page_must_fit_its_checksum",
    ),
    Mutant(
        "microseconds are milliseconds",
        "adapters/robid_parquet/records.py",
        '"us": 1e-6',
        '"us": 1e-3',
        "tests/adapters/robid_parquet/test_parquet_records.py::test_instants_are_seconds",
    ),
    Mutant(
        "chunks are not compared",
        MCAP,
        "    elif zlib.crc32(data) != chunk.uncompressed_crc:",
        "    elif False:",
        f"{MCAP_DAMAGE}::test_A02_flipped_bits_never_pass_as_samples",
    ),
    Mutant("a chunk may be of any size", MCAP, "    if size > MOST_BYTES:", "    if False:", UNPACKED),
    Mutant("a chunk may have another size", MCAP, "    if len(data) != size:", "    if False:", UNPACKED),
    Mutant(
        "a record may be of any size",
        MCAP,
        "            if length > MOST_BYTES and len(head) == 9:",
        "            if False:",
        f"{MCAP_DAMAGE}::test_A04_hostile_file_is_told_and_not_followed",
    ),
    Mutant(
        "a dead reader is asked again",
        PROCESS,
        "    if not _kept or not _kept[0].alive:",
        "    if not _kept:",
        f"{READING}::test_a_library_that_crashes_is_told_and_the_next_file_is_read",
    ),
    Mutant(
        "our own errors are a library's",
        PROCESS,
        "        raise answer.result from cause",
        "        pass",
        f"{READING}::test_an_error_of_ours_comes_as_it_is",
    ),
]
