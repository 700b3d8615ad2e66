"""What nearly every stage imports: the server that starts stages' processes imports it once (`warm_start.py`)."""

from robid_core.executors.threads import set_variables

set_variables()  # before numpy and numba are loaded: stages compute with one thread

import h5py  # noqa: E402, F401
import scipy.linalg  # noqa: E402, F401

import robid_core.robot  # noqa: E402
import robid_core.run.calling  # noqa: E402
import robid_core.run.confined_stage  # noqa: E402, F401
