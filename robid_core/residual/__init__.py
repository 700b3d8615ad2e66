"""The torque residual: measured motor torque against what the measured motion takes; under fits and diagnoses."""

from robid_core.residual.building import default_patterns, torque_problem
from robid_core.residual.estimated_robot import estimated_robot
from robid_core.residual.measured import functions_of_speed
from robid_core.residual.misfit import misfit, misfit_table
from robid_core.residual.passes import Solution, solve
from robid_core.residual.periodic_block import PeriodicBlock
from robid_core.residual.prescribed_record import prescribe_record
from robid_core.residual.problem import TorqueProblem
from robid_core.residual.windowed_block import WindowedBlock

__all__ = [
    "PeriodicBlock", "Solution", "TorqueProblem", "WindowedBlock", "default_patterns", "estimated_robot",
    "functions_of_speed", "misfit", "misfit_table", "prescribe_record", "solve", "torque_problem",
]  # fmt: skip
