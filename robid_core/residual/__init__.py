"""The torque residual: measured motor torque against what the measured motion takes; under fits and diagnoses."""

from robid_core.residual.block import TorqueBlock
from robid_core.residual.misfit import misfit, misfit_table
from robid_core.residual.passes import Solution, solve
from robid_core.residual.problem import TorqueProblem

__all__ = ["Solution", "TorqueBlock", "TorqueProblem", "misfit", "misfit_table", "solve"]
