"""Runs: what is kept and what is made, the manifest, the lock, motions at most once."""

from robid_core.run.folder import RunFolder
from robid_core.run.manifest import Manifest, StageRecord
from robid_core.run.options import ALL, RunOptions, RunResult
from robid_core.run.plan import Action, Decision
from robid_core.run.progress import Listener, Silence
from robid_core.run.runner import preview_run, run_pipeline

__all__ = [
    "ALL",
    "Action",
    "Decision",
    "Listener",
    "Manifest",
    "RunFolder",
    "RunOptions",
    "RunResult",
    "Silence",
    "StageRecord",
    "preview_run",
    "run_pipeline",
]
