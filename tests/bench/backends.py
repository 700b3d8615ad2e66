"""Which backend of dynamics from which batch on: the kernel against torch, six axes, as a table.

    python tests/bench/backends.py [--rounds 7] [--lines 10]
    python tests/bench/backends.py modes        # forward mode of automatic differentiation against reverse mode

Three rows of work, each for 1, 8, 64 and 512 configurations. *Response*: equilibrium, linear model, response and
transfer vectors. *Matrices*: equilibrium, linear model, and its derivatives for 66 inertial numbers. *Response slopes*:
all of it for 46 parameters, to the derivatives of the response (bodies of one axis, rotors, springs, dampers).

Contestants take turns in this process on one thread, figures are medians over rounds, ratios medians of ratios. A
graphics card is measured where there is one, then by the clock on the wall.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported
if str(Path(__file__).parent) not in sys.path:
    sys.path.append(str(Path(__file__).parent))

import numpy as np  # noqa: E402
import numpy.typing as npt  # noqa: E402
import torch  # noqa: E402
from stopwatch import Contestant, Race  # noqa: E402

from robid_core import FreeParameters, Robot, mechanics, mechanism_change  # noqa: E402
from robid_core.mechanics import MechanismChange  # noqa: E402
from robid_torch import batches, slopes as of_torch  # noqa: E402
from robid_torch.trees import tensor  # noqa: E402

FloatArray = npt.NDArray[np.float64]
Backend = ModuleType | batches.TorchDynamics

BATCHES = (1, 8, 64, 512)
BODIES = ("mass.", "centre_of_mass.", "inertia.", "rotor_inertia.")
SOME = ("mass.axis_3", "centre_of_mass.axis_3", "inertia.axis_3", "rotor_inertia.", "gear_", "bearing_")


class Workload:
    """Robot, lines and changes; what a backend is asked to do."""

    def __init__(self, n_line: int) -> None:
        self.robot = Robot.load("six_axis")
        self.omega: FloatArray = 2 * np.pi * np.geomspace(4, 80, n_line)
        self.every, self.some = self._change(BODIES), self._change(SOME)

    def _change(self, heads: tuple[str, ...]) -> MechanismChange:
        names = tuple(name for name in self.robot.layout if name.startswith(heads))
        free = FreeParameters.of_robot(self.robot, names)
        return mechanism_change(free, self.robot, np.zeros(len(names)), range(len(names)))

    def motors(self, n_config: int) -> FloatArray:
        """Motor angles of random configurations."""
        drives = self.robot.drives
        angle = np.random.default_rng(0).uniform(drives.lower, drives.upper, (n_config, self.robot.n_axis))
        return self.robot.motor_angle(angle)

    def calls(self, backend: Backend, n_config: int) -> dict[str, Callable[[], object]]:
        """Return the rows of work on one backend."""
        mechanism, (stiffness, damping) = self.robot.mechanism, self.robot.spring_arrays()
        motor, hold = self.motors(n_config), self.robot.sample_time_s

        def linearised() -> tuple[FloatArray, mechanics.SecondOrderModel]:
            rest = backend.solve_equilibrium(mechanism, stiffness, motor).position
            return rest, backend.second_order_model(mechanism, stiffness, damping, rest)

        def response() -> object:
            return backend.response_with_gradient(linearised()[1], self.omega, hold)

        def matrices() -> object:
            return backend.second_order_slopes(mechanism, stiffness, damping, linearised()[0], self.every)

        def response_slopes() -> object:
            rest, model = linearised()
            along = backend.second_order_slopes(mechanism, stiffness, damping, rest, self.some)
            return backend.response_slopes(model, along, self.omega, hold)

        return {"response": response, "matrices": matrices, "response slopes": response_slopes}


def table(rounds: int, n_line: int) -> None:
    """Race all backends in every row and print what they took."""
    work = Workload(n_line)
    backends: dict[str, Backend] = {"kernel": mechanics, "torch": batches.PROCESSOR}
    card = torch.cuda.is_available()
    if card:
        backends["torch.cuda"] = batches.GRAPHICS_CARD
    print(
        f"six_axis, {n_line} lines, {len(work.every)} inertial numbers, {len(work.some)} parameters; {rounds} rounds"
    )
    print("| row | configurations | kernel, ms | torch, ms | torch over kernel | torch.cuda, ms |")
    print("|---|---|---|---|---|---|")
    for row in ("response", "matrices", "response slopes"):
        for n_config in BATCHES:
            calls = {name: work.calls(backend, n_config)[row] for name, backend in backends.items()}
            race = Race({name: Contestant(call, 1.0) for name, call in calls.items()}, rounds, wall=card)
            kernel, ours = (milliseconds(race, name) for name in ("kernel", "torch"))
            on_card = milliseconds(race, "torch.cuda") if card else "not measured"
            ratio = race.ratio("kernel", "torch")
            print(f"| {row} | {n_config} | {kernel} | {ours} | {ratio:.2g} | {on_card} |", flush=True)


def milliseconds(race: Race, name: str) -> str:
    """Return the median time of a call, three digits of it."""
    time = 1e3 / race.rate(name)
    return f"{time:.3g}" if time < 1000 else f"{10 * round(time / 10)}"


def modes(rounds: int) -> None:
    """Race forward and reverse mode in derivatives of the response at one configuration."""
    device = torch.device("cpu")
    for n_line in (8, 64):
        work = Workload(n_line)
        for change in (work.some, work.every):
            robot, rest = work.robot, work.robot.equilibrium(work.robot.joint_angle(work.motors(1))).position
            model = robot.second_order(robot.joint_angle(work.motors(1)))
            along = mechanics.second_order_slopes(robot.mechanism, *robot.spring_arrays(), rest, change)
            own = of_torch.own_changes(model, change)
            inputs, w = tensor(model.input_map, device), tensor(work.omega, device)[:, None, None]
            at = tuple(tensor(part[:1], device) for part in (model.mass, model.damping, model.stiffness))
            parts = along.mass[0], along.damping[0] + own[0], along.stiffness[0] + own[1]
            rows = tuple(tensor(np.moveaxis(part, -1, 0), device)[:, None] for part in parts)

            def response(
                *given: torch.Tensor, inputs: torch.Tensor = inputs, w: torch.Tensor = w
            ) -> torch.Tensor:
                return -(w**2) * of_torch.moved_per_torque(*given, inputs, w, None)[..., : inputs.shape[1], :]

            def forward(
                response: Callable[..., torch.Tensor] = response,
                at: tuple[torch.Tensor, ...] = at,
                rows: tuple[torch.Tensor, ...] = rows,
            ) -> torch.Tensor:
                return of_torch.forward_mode(lambda *given: (response(*given),), at, rows)[0][0]

            def reverse(
                response: Callable[..., torch.Tensor] = response,
                at: tuple[torch.Tensor, ...] = at,
                rows: tuple[torch.Tensor, ...] = rows,
                n_line: int = n_line,
                w: torch.Tensor = w,
            ) -> torch.Tensor:
                lines = [part.expand(n_line, -1, -1) for part in at]  # each line has matrices of its own
                found, pull = torch.func.vjp(
                    lambda *given: torch.view_as_real(response(*given, w=w[:, None])[:, 0]), *lines
                )
                n_out = found[0].numel()
                seeds = torch.eye(n_out, dtype=torch.float64).reshape(n_out, 1, *found.shape[1:])
                slopes = torch.func.vmap(pull)(seeds.expand(-1, n_line, -1, -1, -1))
                real = sum(
                    torch.einsum("sfmn,pmn->sfp", s, row[:, 0]) for s, row in zip(slopes, rows, strict=True)
                )
                return torch.complex(*real.reshape(n_out // 2, 2, n_line, -1).unbind(1))

            off = (reverse().movedim(0, 1) - forward().flatten(1, 2)).abs().max() / forward().abs().max()
            assert float(off) < 1e-9, "the two do not agree"
            race = Race({"forward": Contestant(forward, 1.0), "reverse": Contestant(reverse, 1.0)}, rounds)
            print(
                f"{n_line} lines, {len(change)} parameters: forward {1e3 / race.rate('forward'):.3g} ms, "
                f"reverse over forward {race.ratio('forward', 'reverse'):.2g}"
            )


def main() -> None:
    """Read the arguments and run a race."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", nargs="?", choices=("table", "modes"), default="table")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--lines", type=int, default=10)
    given = parser.parse_args()
    if given.what == "modes":
        modes(given.rounds)
    else:
        table(given.rounds, given.lines)


if __name__ == "__main__":
    main()
