"""Compiles the kernels that a check takes last on a second processor, while it compiles those that it takes first.

A diagnosis simulates, compares with prescribed motions, and linearises. One after the other, compiling that is more
than half of the time of its check with nothing on disk.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator

from robid_core.compiled.machine_code import kept_codes
from robid_core.mechanics.prescribed_kernel import run_prescribed

LATER = ("torque of a prescribed motion", "linear models")
"""What of `mechanics.WARM_UP` a diagnosis takes after it has simulated."""
_CALLS = f"from robid_core.mechanics import WARM_UP; [WARM_UP[name]() for name in {LATER!r}]"


@contextlib.contextmanager
def compiled_beside() -> Iterator[None]:
    """Compile `LATER` in another process as long as this lasts, unless it is on disk.

    What goes wrong there is no error: this process compiles what it does not find.
    """
    if kept_codes(run_prescribed):
        yield
        return
    with subprocess.Popen([sys.executable, "-c", _CALLS], stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.kill()
