"""The torque residual: measured motor torque against what the measured motion takes; under fits and diagnoses."""

from robid_core.residual.misfit import misfit, misfit_table
from robid_core.residual.passes import Solution, solve
from robid_core.residual.periodic_block import PeriodicBlock
from robid_core.residual.prescribed_record import prescribe_record
from robid_core.residual.problem import TorqueProblem
from robid_core.residual.windowed_block import WindowedBlock

__all__ = [
    "PeriodicBlock", "Solution", "TorqueProblem", "WindowedBlock", "misfit", "misfit_table",
    "prescribe_record", "solve",
]  # fmt: skip
