"""Stages of the pipelines in `examples`, as their files set them, and what they need to run in a test."""

from __future__ import annotations

import json
import logging
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

from robid_core import Context
from robid_core.registry import STAGES, registry
from robid_core.stage import map_in_process

PROJECT = Path(__file__).parents[2]
DATA = Path(os.environ.get("ROBID_DATA", PROJECT.parent / "shared" / "data"))
LOG = "test.example"


def needs(file: str, origin: str) -> pytest.MarkDecorator:
    """Skip where a recording is absent, with where to get it."""
    there = (DATA / file).is_file()
    return pytest.mark.skipif(
        not there, reason=f"{DATA / file} is absent; get it from {origin} and set ROBID_DATA"
    )


def stage_of(pipeline: str, name: str) -> Any:
    """Return a stage of the text of a pipeline file."""
    node = YAML(typ="safe", pure=True).load(pipeline)["stages"][name]
    settings = json.dumps(node.get("with", {}))
    return registry().load(STAGES, node["use"]).model_validate_json(settings, strict=True)


def context() -> Context:
    """Return one that finds the recordings."""
    silent = logging.getLogger(LOG)
    return Context(np.random.default_rng(0), map_in_process, lambda *_: None, silent, data_root=DATA)
