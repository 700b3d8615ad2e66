"""Flexible links (thesis section 2.6): finite elements and their reduction, assumed modes, pseudo-joints.

`Beam` or a file -> `Structure` (mass, stiffness, nodes) -> `guyan` / `craig_bampton` -> `FlexibleBody` (rigid body and
modes) -> `attach_flexible`. Plain numpy and scipy.
"""

from robid_core.mechanics.flexible.assumed_modes import assumed_modes
from robid_core.mechanics.flexible.attach import attach_flexible, attach_pseudo_joints
from robid_core.mechanics.flexible.beam import Beam, hollow_square
from robid_core.mechanics.flexible.body import FlexibleBody
from robid_core.mechanics.flexible.modal import flexible_body
from robid_core.mechanics.flexible.pseudo_joints import PseudoJoints, pseudo_joints
from robid_core.mechanics.flexible.reduction import Reduction, craig_bampton, guyan
from robid_core.mechanics.flexible.structure import Structure

__all__ = [
    "Beam",
    "FlexibleBody",
    "PseudoJoints",
    "Reduction",
    "Structure",
    "assumed_modes",
    "attach_flexible",
    "attach_pseudo_joints",
    "craig_bampton",
    "flexible_body",
    "guyan",
    "hollow_square",
    "pseudo_joints",
]
