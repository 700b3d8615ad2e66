"""The estimators that are compared, each as it would stand in a pipeline: stages by name, with their settings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from robid_core import Context, Frf, Record, Robot, load_plugin


@dataclass(frozen=True)
class Method:
    """One way from a record to a response.

    `use` and `settings` name the estimator, `before` the stages that change the record first; `counts` are the
    numbers of experiments that it is tried with, `title` what the tables call it.
    """

    title: str
    use: str
    settings: dict[str, Any] = field(default_factory=dict)
    before: tuple[str, ...] = ()
    counts: tuple[int, ...] = (6, 24)

    def prepare(
        self,
        record: Record,
        robot: Robot,
        context: Context,
        known: dict[tuple[str, ...], Record] | None = None,
    ) -> Record:
        """Run the stages before the estimator; `known` remembers what came of the record after which stages."""
        known = {} if known is None else known
        for number, name in enumerate(self.before, start=1):
            done = self.before[:number]
            if done not in known:
                known[done] = run_stage(name, {}, record, robot, context)
            record = known[done]
        return record

    def estimate(self, record: Record, robot: Robot, context: Context) -> Frf:
        """Estimate from a record that `prepare` has made."""
        frf: Frf = run_stage(self.use, self.settings, record, robot, context)
        return frf


def run_stage(use: str, settings: dict[str, Any], record: Record, robot: Robot, context: Context) -> Any:
    """Run one registered stage that takes a record, with what else it asks for."""
    stage = load_plugin("robid.stages", use)(**settings)
    lent = {
        name: robot if kind is Robot else context
        for name, kind in stage.lends().items()
        if kind in (Robot, Context)
    }
    taken = {entry.name: record for entry in stage.inputs() if entry.artifact is Record}
    return stage.run(**taken, **lent)


FEW = (1, 2, 3, 6, 12, 24)
FRICTION = ("compensate.friction",)
MECHANICS = ("compensate.friction", "compensate.simulation")


def _local(parametrization: str, approach: str = "direct", choose: str = "none") -> dict[str, Any]:
    return {"parametrization": parametrization, "approach": approach, "choose": choose}


CHOSEN = _local("mimo", choose="both")


METHODS: dict[str, Method] = {
    "h1": Method("H1", "frf.h1", counts=(6, 12, 24)),
    "ari": Method("ARI", "frf.ari"),
    "log": Method("LOG", "frf.log", counts=(6, 12, 24)),
    "log_element": Method("LOG by entry", "frf.log", {"form": "element"}),
    "harmonic": Method("harmonic", "frf.harmonic"),
    "jio": Method("JIO", "frf.jio"),
    "indirect": Method("indirect", "frf.indirect"),
    "two_stage": Method("two-stage, smoothed", "frf.two_stage", {"smoothing_lines": 7}),
    "spectral": Method("spectral, direct", "frf.spectral"),
    "spectral_jio": Method("spectral, JIO", "frf.spectral", {"approach": "jio"}),
    "spectral_iv": Method("spectral, instruments", "frf.spectral", {"approach": "instrument"}),
    "lpm": Method("LPM", "frf.lpm", counts=FEW),
    "lrm_scalar": Method("LRM scalar", "frf.lrm", _local("scalar"), counts=FEW),
    "lrm_miso": Method("LRM MISO", "frf.lrm", _local("miso"), counts=FEW),
    "lrm_mimo": Method("LRM MIMO", "frf.lrm", _local("mimo"), counts=FEW),
    "lrm_mimo_window": Method(
        "LRM MIMO, chosen window", "frf.lrm", _local("mimo", choose="window"), counts=FEW
    ),
    "lrm_mimo_chosen": Method("LRM MIMO, chosen window and orders", "frf.lrm", CHOSEN, counts=FEW),
    "lrm_mimo_iterated": Method("LRM MIMO, iterated", "frf.lrm", {**_local("mimo"), "iterations": 3}),
    "lrm_prior_poles": Method(
        "LRM, poles of the nominal robot", "frf.lrm", {**_local("scalar"), "prior_poles": True}, counts=FEW
    ),
    "lrm_scalar_jio": Method("LRM scalar, JIO", "frf.lrm", _local("scalar", "jio"), counts=FEW),
    "lrm_miso_jio": Method("LRM MISO, JIO", "frf.lrm", _local("miso", "jio"), counts=FEW),
    "lrm_mimo_jio": Method("LRM MIMO, JIO", "frf.lrm", _local("mimo", "jio"), counts=FEW),
    "lrm_mimo_jio_window": Method(
        "LRM MIMO, JIO, chosen window", "frf.lrm", _local("mimo", "jio", "window"), counts=(6, 24)
    ),
    "friction_h1": Method("H1, friction removed", "frf.h1", before=FRICTION, counts=(6, 12, 24)),
    "friction_jio": Method("JIO, friction removed", "frf.jio", before=FRICTION, counts=(6, 12, 24)),
    "friction_log": Method("LOG, friction removed", "frf.log", before=FRICTION, counts=(6, 12, 24)),
    "friction_lrm": Method("LRM MIMO chosen, friction removed", "frf.lrm", CHOSEN, FRICTION, counts=FEW),
    "mechanics_h1": Method(
        "H1, friction and moving inertia removed", "frf.h1", before=MECHANICS, counts=(6, 12, 24)
    ),
    "mechanics_jio": Method(
        "JIO, friction and moving inertia removed", "frf.jio", before=MECHANICS, counts=(6, 12, 24)
    ),
    "mechanics_lrm": Method(
        "LRM MIMO chosen, friction and moving inertia removed", "frf.lrm", CHOSEN, MECHANICS, counts=FEW
    ),
}
"""Compared with one another on the same records."""

PUBLISHED = ("log", "harmonic", "ari", "jio", "h1")
"""Ranking of Wernholt and Moberg (2008) on a real robot, best first (LOG and harmonic alike)."""
