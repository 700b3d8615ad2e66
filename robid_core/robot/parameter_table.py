"""The named numbers of a robot as a table for other programs: units and, of what was estimated, covariance."""

from __future__ import annotations

import csv
import io
import json
import math
from typing import TYPE_CHECKING, Any

from robid_core.errors import ConfigurationError

if TYPE_CHECKING:
    from robid_core.artifacts import Model
    from robid_core.robot.robot import Robot

SUFFIXES = (".csv", ".json")
COLUMNS = ("name", "value", "unit", "kind", "standard_error")


def parameter_table(robot: Robot, model: Model | None, suffix: str) -> str:
    """Return the text of a table, a row for each named number of the robot.

    CSV has behind the `COLUMNS` one column `covariance.<name>` for each estimated number; JSON has `parameters` (a list
    of rows) and `covariance`: {names, matrix}. What was not estimated, or whose error is not known, is empty in the
    one, null in the other. Covariances are in the product of the two numbers' units.

    Parameters
    ----------
    robot
        Whose numbers.
    model
        What the fit that found them gave back; None: no number is known to be estimated.
    suffix
        .csv or .json.

    Raises
    ------
    ConfigurationError
        For another suffix.
    """
    free = () if model is None else model.free_names
    matrix = [] if model is None else model.covariance.tolist()
    errors = {} if model is None else model.standard_errors()
    rows = [
        {
            "name": name,
            "value": value,
            "unit": robot.parameter_unit(name),
            "kind": robot.parameter_kind(name),
            "standard_error": _known(errors.get(name)),
        }
        for name, value in robot.parameters().items()
    ]
    if suffix == ".json":
        known = [[_known(entry) for entry in row] for row in matrix]
        whole: dict[str, Any] = {
            "robot": robot.name,
            "sha256": robot.sha256,
            "parameters": rows,
            "covariance": {"names": list(free), "matrix": known},
        }
        return json.dumps(whole, indent=1) + "\n"
    if suffix != ".csv":
        raise ConfigurationError(f"a table goes into {' or '.join(SUFFIXES)}, not into '{suffix}'")
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*COLUMNS, *(f"covariance.{name}" for name in free)])
    lines = dict(zip(free, matrix, strict=True))
    for row in rows:
        entries = [_known(entry) for entry in lines.get(str(row["name"]), [math.nan] * len(free))]
        writer.writerow(["" if cell is None else cell for cell in [*row.values(), *entries]])
    return stream.getvalue()


def _known(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value
