"""What a plugin of `robid.dynamics` offers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from robid_core.arrays import ComplexArray

if TYPE_CHECKING:
    from robid_core.mechanics import Equilibrium, Pose, ResponseGradient, SecondOrderModel, SecondOrderSlopes


class BatchedDynamics(Protocol):
    """What is registered under `robid.dynamics`: functions of robid_core.mechanics, computed in another way."""

    @property
    def solve_equilibrium(self) -> Callable[..., Equilibrium]: ...
    @property
    def second_order_model(self) -> Callable[..., SecondOrderModel]: ...
    @property
    def response(self) -> Callable[..., ComplexArray]: ...
    @property
    def response_with_gradient(self) -> Callable[..., ResponseGradient]: ...
    @property
    def second_order_slopes(self) -> Callable[..., SecondOrderSlopes]: ...
    @property
    def response_slopes(self) -> Callable[..., ComplexArray]: ...
    @property
    def torque_slopes(self) -> Callable[..., ComplexArray]: ...
    @property
    def pose_of(self) -> Callable[..., Pose]: ...
