"""Python in place of YAML: stages as functions, runs as mappings of artifacts."""

from robid_core.notebook.made_run import Run
from robid_core.notebook.stage_function import StageFunction, use

__all__ = ["Run", "StageFunction", "use"]
