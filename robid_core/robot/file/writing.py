"""A whole robot as the text of a file, and the hash of that."""

from __future__ import annotations

import hashlib
import io

from robid_core.robot.file.description import RobotDescription


def robot_yaml(description: RobotDescription) -> str:
    """Return a whole robot as the text of a file: equal descriptions give equal text."""
    from ruamel.yaml import YAML

    stream = io.StringIO()
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.width = 120
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.dump(description.model_dump(mode="json"), stream)
    return stream.getvalue()


def robot_sha256(description: RobotDescription) -> str:
    """Return the hash of `robot_yaml`."""
    return text_sha256(robot_yaml(description))


def text_sha256(text: str) -> str:
    """Return the hash of the text of a robot file."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()
