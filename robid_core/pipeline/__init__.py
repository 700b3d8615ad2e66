"""Pipelines: reading pipeline.yaml, telling every mistake at once, wiring stages by type, the JSON schema."""

from robid_core.pipeline.pipeline import Pipeline, PluginChoice, RobotChoice, StageNode
from robid_core.pipeline.problems import PipelineProblems, Problem

__all__ = ["Pipeline", "PipelineProblems", "PluginChoice", "Problem", "RobotChoice", "StageNode"]
