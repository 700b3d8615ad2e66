"""Makes `tests/oracles` importable as `oracles`: machinery that shares no code with the simulator."""

import sys
from pathlib import Path

TESTS = str(Path(__file__).parents[2])
if TESTS not in sys.path:
    sys.path.append(TESTS)
