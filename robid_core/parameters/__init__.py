"""Parameters of a robot that a fit may free: chosen by patterns, in natural scales, with bounds and priors."""

from robid_core.parameters.choice import chosen_names
from robid_core.parameters.free import FreeParameters
from robid_core.parameters.problems import pattern_problems
from robid_core.parameters.scales import default_prior

__all__ = ["FreeParameters", "chosen_names", "default_prior", "pattern_problems"]
