"""Whatever a reader does to its process, the caller gets a sentence with the file in it, and the next file is read."""

from __future__ import annotations

import errno
import logging
import os
import subprocess
import sys
import time
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from faults.fault import fault
from fuzz.samples import SAMPLES

from robid_core import guarded_reader, registry as plugins
from robid_core.errors import DataRejected, PluginError, StoreError
from robid_core.foreign import process
from robid_core.foreign.limits import LEAST_BYTES, Limits, limits_of
from robid_core.foreign.process import read_apart

READERS = """
import logging, os, signal, time
import numpy as np
from robid_core.errors import StoreError

def good(path):
    logging.getLogger("robid.strange").warning("looked at %s", path.name)
    print("what libraries print goes nowhere")
    return {"q": np.arange(3.0), "process": np.array(os.getpid())}

def crashes(path):
    os.kill(os.getpid(), signal.SIGSEGV)

def leaves(path):
    os._exit(3)

def loops(path):
    while True:
        pass

def waits(path):
    time.sleep(1000)

def eats(path):
    return {"sum": np.ones(2 * 10**8).sum()}  # 1.6 GB

def fails(path):
    raise IndexError("list index out of range\\nand more")

def refuses(path):
    raise StoreError(f"{path}: no")

def gives_what_cannot_be_sent(path):
    return lambda: None
"""
SHORT = Limits(LEAST_BYTES, 0.3, 30.0)


@pytest.fixture
def strange(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file, beside a module of readers that the reading process can import."""
    (tmp_path / "strange_readers.py").write_text(READERS)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "a.dat").write_bytes(b"1 2 3")
    return tmp_path / "a.dat"


def read(path: Path, name: str, limits: Limits | None = None) -> Any:
    return read_apart(path, f"strange_readers:{name}", "", "strange data", limits)


def assert_still_reads(path: Path) -> None:
    np.testing.assert_array_equal(read(path, "good")["q"], [0, 1, 2])


@fault(
    "A02",
    sees="exit 5: the library that reads the file crashed, with the signal's name; Python goes on",
    mutant=(
        "robid_core/foreign/process.py",
        "        except (EOFError, OSError):",
        "        except OSError:",
    ),
)
def test_a_library_that_crashes_is_told_and_the_next_file_is_read(strange: Path) -> None:
    with pytest.raises(
        DataRejected, match=r"a\.dat: the library .* crashed \(SIGSEGV\): it is damaged; copy it again"
    ):
        read(strange, "crashes")
    assert_still_reads(strange)
    with pytest.raises(DataRejected, match="exit code 3"):
        read(strange, "leaves")
    assert_still_reads(strange)


@fault(
    "A02",
    sees="exit 5: reading was not finished after so many seconds of computing, though the library never returns",
    mutant=(
        "robid_core/foreign/worker.py",
        "    signal.setitimer(signal.ITIMER_PROF, limits.processor_s)",
        "    pass",
    ),
)
def test_a_library_that_loops_is_ended_by_its_own_process(strange: Path) -> None:
    with pytest.raises(DataRejected, match=r"a\.dat: .*not finished after 0 s of computing: it is damaged"):
        read(strange, "loops", Limits(LEAST_BYTES, 0.3, 3.0))
    assert_still_reads(strange)


@fault(
    "A02",
    sees="exit 5: reading was not finished after so many seconds, though nothing computes",
    mutant=(
        "robid_core/foreign/worker.py",
        "    signal.setitimer(signal.ITIMER_REAL, limits.clock_s)",
        "    pass",
    ),
)
def test_a_library_that_waits_is_ended_by_the_clock(strange: Path) -> None:
    began = time.perf_counter()
    with pytest.raises(DataRejected, match=r"a\.dat: .*not finished after 1 s: it is damaged"):
        read(strange, "waits", Limits(LEAST_BYTES, 10.0, 0.6))
    assert time.perf_counter() - began < 8  # long before the parent gives it up
    assert_still_reads(strange)


@fault(
    "A04",
    sees="exit 5: reading the file would need more than so many MB; nothing else on the machine notices",
    mutant=(
        "robid_core/foreign/worker.py",
        "        resource.setrlimit(resource.RLIMIT_AS, (most, hard))",
        "        pass",
    ),
)
def test_a_reader_that_wants_too_much_memory_is_refused(strange: Path) -> None:
    with pytest.raises(DataRejected, match=r"A04: .*a\.dat: .* more than 537 MB"):
        read(strange, "eats")
    assert_still_reads(strange)


@fault(
    "A02",
    sees="exit 5: the file cannot be read, and the error of the library in one line; no traceback, no exit 70",
    mutant=(
        "robid_core/foreign/worker.py",
        "    except Exception as error:",
        "    except KeyError as error:",
    ),
)
def test_any_error_of_a_library_is_data_rejected(strange: Path) -> None:
    with pytest.raises(DataRejected) as caught:
        read(strange, "fails")
    assert str(caught.value) == (
        f"{strange}: cannot be read as strange data (IndexError: list index out of range); copy it again from where it "
        "was recorded, or export it anew"
    )
    assert "in fails" in str(caught.value.__cause__)  # the trace, for --debug
    with pytest.raises(DataRejected, match="cannot be read"):
        read(strange, "gives_what_cannot_be_sent")


def test_an_error_of_ours_comes_as_it_is(strange: Path) -> None:
    with pytest.raises(StoreError, match=r"a\.dat: no$"):
        read(strange, "refuses")


def test_what_a_reader_logs_is_logged_here_and_what_it_prints_is_not(
    strange: Path, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    with caplog.at_level(logging.WARNING, logger="robid.strange"):
        read(strange, "good")
    assert [(one.name, one.getMessage()) for one in caplog.records] == [("robid.strange", "looked at a.dat")]
    assert capfd.readouterr() == ("", "")


def test_one_process_reads_file_after_file(strange: Path) -> None:
    found = {int(read(strange, "good")["process"]) for _ in range(5)}
    assert len(found) == 1
    assert os.getpid() not in found


def test_relative_paths_mean_what_they_mean_here(strange: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(strange.parent)
    np.savez("b.npz", q=np.arange(4.0))
    assert guarded_reader("npz").read(Path("b.npz"))["q"].tolist() == [0, 1, 2, 3]
    with pytest.raises(StoreError, match=r"^c\.npz: cannot be read"):
        guarded_reader("npz").read(Path("c.npz"))


def asked_elsewhere(script: str, path: Path) -> subprocess.CompletedProcess[str]:
    """Run a script in a Python of its own, on a path."""
    return subprocess.run(
        [sys.executable, "-c", script, str(path)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def test_the_process_ends_with_the_one_that_asked(strange: Path) -> None:
    script = (
        "from pathlib import Path; from robid_core.foreign.process import read_apart; import sys; "
        "print(int(read_apart(Path(sys.argv[1]), 'strange_readers:good', '', 'x')['process']), flush=True); "
        "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = asked_elsewhere(script, strange)
    reader, latest = int(done.stdout), time.monotonic() + 10
    while Path(f"/proc/{reader}/cmdline").exists() and Path(f"/proc/{reader}/cmdline").read_bytes():
        assert time.monotonic() < latest
        time.sleep(0.02)


@fault(
    "A02",
    sees="exit 5: a damaged MATLAB file ends scipy by a segmentation fault, and the file is named",
    mutant=(
        "robid_core/foreign/reader.py",
        "        return functools.partial(self._call, name) if name in READING else found",
        "        return found",
    ),
)
def test_a_matlab_file_that_crashes_scipy_is_refused(tmp_path: Path) -> None:
    """Found by `tests/fuzz/run.py mat_plain`: the numbers of the first variable are of a type that there is not."""
    path = tmp_path / "crash.mat"
    SAMPLES["mat_plain"][2](path)
    content = bytearray(path.read_bytes())
    assert content[176:180] == b"\x09\0\0\0"  # double
    content[176:180] = bytes(4)
    path.write_bytes(content)
    with pytest.raises(DataRejected, match=r"crash\.mat: the library that reads it as mat crashed"):
        guarded_reader("mat").read(path)


def test_a_process_that_is_limited_itself_reads_within_its_limit(strange: Path) -> None:
    script = (
        "import resource, sys; from pathlib import Path; from robid_core.foreign.process import read_apart; "
        "resource.setrlimit(resource.RLIMIT_AS, (2**31, 2**31)); "
        "print(read_apart(Path(sys.argv[1]), 'strange_readers:good', '', 'x')['q'].tolist())"
    )
    done = asked_elsewhere(script, strange)
    assert done.stdout == "[0.0, 1.0, 2.0]\n", done.stderr


@fault(
    "R04",
    sees="exit 7: the process that reads files cannot be started, why, and what to do",
    mutant=(
        "robid_core/foreign/process.py",
        "        except OSError as error:",
        "        except KeyError as error:",
    ),
)
def test_a_process_that_cannot_be_started_is_told(strange: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    process._end_kept()
    with monkeypatch.context() as patched:
        patched.setattr(subprocess, "Popen", refuse)
        with pytest.raises(StoreError, match=r"a\.dat: .*cannot be started \(Too many open files\)"):
            read(strange, "good")
    assert_still_reads(strange)


def test_limits_grow_with_the_file(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(10**6))
    assert limits_of(tmp_path / "a") == Limits(LEAST_BYTES + 40 * 10**6, 12.0, 48.0)
    (tmp_path / "metadata.yaml").write_bytes(b"")
    assert limits_of(tmp_path / "metadata.yaml").processor_s == 12.0  # of the folder
    assert limits_of(tmp_path / "none").memory_bytes == LEAST_BYTES


def test_what_is_registered_as_a_reader_and_is_none_is_told_by_its_name(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plain = EntryPoint("csv", "builtins:dict", plugins.RECORDS)
    monkeypatch.setattr("robid_core.foreign.reader.registry", lambda: plugins.Registry([plain]))
    with pytest.raises(
        PluginError, match=r"'csv' \(unknown 0\) is no reader of recordings: it lacks describe and"
    ):
        guarded_reader("csv")


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        (
            "run.csv",
            b"<!DOCTYPE html>\n<html><body><p>Sign in, please, 1,2,3</p></body></html>\n",
            "an HTML page, and",
        ),
        (
            "run.csv",
            b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n",
            "git LFS, and not",
        ),
        (
            "run.csv",
            b"PK\x03\x04\x14\x00\x00\x00\x08\x00" + bytes(range(200)),
            "a ZIP archive, as Excel workbooks",
        ),
        (
            "run.mat",
            b"time,q,tau\n0,1,2\n1,2,3\n",
            "a text; is it a table? Call it .csv, or give its format: csv",
        ),
        (
            "run.mcap",
            b"PK\x03\x04\x14\x00\x00\x00\x08\x00",
            "a ZIP archive, as Excel workbooks and .npz files are",
        ),
    ],
)
def test_a_file_of_another_kind_is_told_by_what_it_is(
    tmp_path: Path, name: str, content: bytes, told: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataRejected) as refused:
        guarded_reader(name.partition(".")[2]).read(tmp_path / name)
    assert str(refused.value).startswith(f"{tmp_path / name}: this is ")
    assert told in str(refused.value)
