"""Pipelines: reading pipeline.yaml, telling every mistake at once, wiring stages by type, the JSON schema."""

from robid_core.pipeline.pipeline import Pipeline, PluginChoice, RobotChoice, StageNode
from robid_core.yaml_file.problems import FileProblems, Problem

__all__ = ["FileProblems", "Pipeline", "PluginChoice", "Problem", "RobotChoice", "StageNode"]
