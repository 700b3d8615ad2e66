"""What is registered as dynamics: PyTorch is imported when something is computed, not when plugins are listed.

Importing it takes a second and more. That it is installed is asked at once, so that a missing one is reported where a
robot names it.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from robid_core import ComplexArray, PluginError
from robid_core.mechanics import (
    Equilibrium,
    Pose,
    ResponseGradient,
    SecondOrderModel,
    SecondOrderSlopes,
)

if TYPE_CHECKING:
    from robid_torch.batches import TorchDynamics

if importlib.util.find_spec("torch") is None:
    raise ModuleNotFoundError("No module named 'torch'", name="torch")


@dataclass(frozen=True)
class OnDemand:
    """The functions of `batches.TorchDynamics`, with its arguments and results, imported at the first call."""

    device: str = "cpu"
    """As in `batches.TorchDynamics`."""
    memory_bytes: int = 256 * 2**20
    """As in `batches.TorchDynamics`."""

    def solve_equilibrium(self, *given: Any, **named: Any) -> Equilibrium:
        """Rest position at given motor angles."""
        return self._computing().solve_equilibrium(*given, **named)

    def second_order_model(self, *given: Any, **named: Any) -> SecondOrderModel:
        """Mass, damping and stiffness matrices at operating points."""
        return self._computing().second_order_model(*given, **named)

    def response(self, *given: Any, **named: Any) -> ComplexArray:
        """Response from motor torque to motor acceleration."""
        return self._computing().response(*given, **named)

    def response_with_gradient(self, *given: Any, **named: Any) -> ResponseGradient:
        """Response, and the factors of its derivatives at fixed equilibrium."""
        return self._computing().response_with_gradient(*given, **named)

    def second_order_slopes(self, *given: Any, **named: Any) -> SecondOrderSlopes:
        """Derivatives of the matrices and of the holding torque along changes."""
        return self._computing().second_order_slopes(*given, **named)

    def response_slopes(self, *given: Any, **named: Any) -> ComplexArray:
        """Derivatives of the response along changes."""
        return self._computing().response_slopes(*given, **named)

    def torque_slopes(self, *given: Any, **named: Any) -> ComplexArray:
        """Derivatives of the torque that a motion takes."""
        return self._computing().torque_slopes(*given, **named)

    def pose_of(self, *given: Any, **named: Any) -> Pose:
        """Pose and Jacobian of a point of a body."""
        return self._computing().pose_of(*given, **named)

    def _computing(self) -> TorchDynamics:
        try:
            from robid_torch.batches import TorchDynamics
        except Exception as error:  # a library that is installed and damaged
            raise PluginError(
                f"robot: dynamics 'torch': {type(error).__name__} when PyTorch was imported: {error}"
            ) from error

        return TorchDynamics(self.device, self.memory_bytes)


PROCESSOR = OnDemand()
GRAPHICS_CARD = OnDemand("cuda", 4 * 2**30)
