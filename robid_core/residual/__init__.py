"""The torque residual: measured motor torque against what the measured motion takes; under fits and diagnoses."""

from robid_core.residual.block import TorqueBlock
from robid_core.residual.building import default_patterns, torque_problem
from robid_core.residual.catalogue import effect_names, place_in
from robid_core.residual.effect_torque import EffectTorque
from robid_core.residual.equivalent_springs import with_equivalent_springs
from robid_core.residual.estimated_robot import estimated_robot, friction_of_motors
from robid_core.residual.excited_range import excited_range
from robid_core.residual.faster_controller import times_faster
from robid_core.residual.leading_periods import leading_periods
from robid_core.residual.measured import (
    check_variants,
    functions_of_speed,
    parts_by_variant,
    resolved_width,
)
from robid_core.residual.misfit import explained_by_turns, faded_misfit, misfit, misfit_table
from robid_core.residual.moving_samples import sticking_in
from robid_core.residual.passes import Solution, linearise_at, prescribe_at, solve
from robid_core.residual.periodic_block import PeriodicBlock
from robid_core.residual.prescribed_record import prescribe_record
from robid_core.residual.problem import Linearisation, TorqueProblem
from robid_core.residual.remembered_spectra import RememberedSpectra
from robid_core.residual.rigid_drives import rigid_drives
from robid_core.residual.turns import clearer_without_turns
from robid_core.residual.variant_constants import variant_robots
from robid_core.residual.weighting import Weighting
from robid_core.residual.whole_pieces import whole_pieces, words_of_pieces
from robid_core.residual.windowed_block import WindowedBlock
from robid_core.robot.effects import BoundEffect
from robid_core.robot.file.effect_class import effect_class
from robid_core.robot.plausibility import refuse_weightless

__all__ = [
    "BoundEffect", "EffectTorque", "Linearisation", "PeriodicBlock", "RememberedSpectra", "Solution", "TorqueBlock",
    "TorqueProblem", "Weighting", "WindowedBlock", "check_variants", "clearer_without_turns", "default_patterns",
    "effect_class", "effect_names", "estimated_robot", "excited_range", "explained_by_turns", "faded_misfit",
    "friction_of_motors", "functions_of_speed", "leading_periods", "linearise_at", "misfit", "misfit_table",
    "parts_by_variant", "place_in", "prescribe_at", "prescribe_record", "refuse_weightless", "resolved_width",
    "rigid_drives", "solve",
    "sticking_in", "times_faster", "torque_problem", "variant_robots", "whole_pieces", "with_equivalent_springs",
    "words_of_pieces",
]  # fmt: skip
