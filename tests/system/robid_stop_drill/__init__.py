"""CAN drives that stage an accident: axes that obey no stop, and signals at chosen moments of simulated time.

What the drives saw is left in a JSON file: when the stop began, when each drive was told, how it ended.
"""

from __future__ import annotations

import json
import multiprocessing
import os
from pathlib import Path
from typing import Any

from robid_can.drives import CanDrives, OpenCanDrives
from robid_can.host.stopping import STOP_S
from robid_core import Session


class DrillDrives(CanDrives):
    """Simulated drives for a drill."""

    deaf: tuple[int, ...] = ()
    """Nodes that obey no order to stop."""
    signals: tuple[tuple[float, int], ...] = ()
    """Simulated seconds since the bring-up, and the signal that the run gets then."""
    report: str
    """Where the drives leave what they saw."""

    def open(self, session: Session) -> Any:
        return Drill(super().open(session), self)


class Drill:
    """Open drives with an eye on each of them."""

    def __init__(self, inner: OpenCanDrives, settings: DrillDrives) -> None:
        self.inner, self.settings = inner, settings
        self.signals = list(settings.signals)
        self.told: dict[int, float] = {}
        self.stop_began = float("inf")
        self.speed: dict[int, float] = {}  # when rest was judged last
        # Under a deadline the drives live in a process of the run's, which gets what a person types.
        self.run = os.getppid() if multiprocessing.parent_process() is not None else os.getpid()

    def __enter__(self) -> Drill:
        self.inner.__enter__()
        host, system = self.inner._host, self.inner._system
        assert host is not None
        began, let_pass, stop = system.time_s, host.link.clock.let_pass, host.stop
        for node in system.nodes:
            node.deaf = node.node_id in self.settings.deaf
            self.watch(node)

        def with_signals(seconds: float) -> None:
            while self.signals and system.time_s - began >= self.signals[0][0]:
                os.kill(self.run, self.signals.pop(0)[1])
            let_pass(seconds)
            if system.time_s - self.stop_began < STOP_S:
                self.speed = {node.node_id: node.axis.speed for node in system.nodes}

        def reported_stop() -> list[str]:
            self.stop_began = stop_began = system.time_s
            self.told.clear()
            problems = stop()
            seen = {
                "at_s": stop_began - began,
                "told_ms": {node: 1e3 * (time - stop_began) for node, time in self.told.items()},
                "seconds": system.time_s - stop_began,
                "speed": self.speed,
                "state": {node.node_id: node.state.name for node in system.nodes},
                "problems": problems,
            }
            Path(self.settings.report).write_text(json.dumps(seen), encoding="utf-8")
            return problems

        host.link.clock.let_pass = with_signals  # type: ignore[method-assign]
        host.stop = reported_stop  # type: ignore[method-assign]
        return self

    def watch(self, node: Any) -> None:
        """Note when a drive is told to stop, by whichever frame comes first."""
        command, obey = node.command, node.objects.on_write[0x6040, 0]

        def by_network(data: bytes, now_us: int) -> None:
            if data[:1] == b"\x02":
                self.told.setdefault(node.node_id, self.inner._system.time_s)
            command(data, now_us)

        def by_controlword(word: int) -> None:
            if word == 0x02:
                self.told.setdefault(node.node_id, self.inner._system.time_s)
            obey(word)

        node.command, node.objects.on_write[0x6040, 0] = by_network, by_controlword

    def perform(self, experiment: Any) -> Any:
        return self.inner.perform(experiment)

    def __exit__(self, *exception: object) -> None:
        self.inner.__exit__(*exception)
