"""The JSON schema accepts what the reader accepts and refuses what it refuses, as far as a schema can say it."""

from typing import Any

import jsonschema  # type: ignore[import-untyped]
import pytest

from robid_core.pipeline.schema import pipeline_schema
from robid_core.registry import Registry
from robid_core.yaml_file.kind import PIPELINE_FILE
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.problems import ProblemList

GOOD = """\
robid: 1
name: example
seed: 7
robot: one_axis
drives: {use: can, with: {plant: one_axis_true}}
executor: {use: pool, with: {workers: 3}}
stages:
  where: {use: design.candidates, with: {count: 4}}
  excite: {use: excitation.multisine, with: {band_hz: [4, 80], lines: 100}}
  acquire: {use: acquisition.drives, inputs: {configurations: where}}
  read: {use: acquisition.recorded, with: {path: a, filters: [{cutoff_hz: 3}]}}
  frf: {use: 'unknown:frf.log'}
  fit: {use: fit.log_response, with: {starts: 20, estimator: {use: frf.h1, with: {discard: 1}}}}
  joint: {use: fit.joint, inputs: {frfs: [frf], records: acquire}}
  page: {use: report.html}
"""


def value(text: str) -> Any:
    root = read_nodes(text, PIPELINE_FILE, ProblemList("x"))
    assert root is not None
    return root.plain()


@pytest.fixture(scope="module", name="validator")
def schema_validator(plugins: Registry) -> jsonschema.Draft7Validator:
    schema = pipeline_schema(plugins)
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def test_a_good_pipeline_is_valid(validator: jsonschema.Draft7Validator) -> None:
    validator.validate(value(GOOD))


@pytest.mark.parametrize(
    ("old", "new", "path", "message"),
    [
        ("robid: 1", "robid: 2", ["robid"], "1 was expected"),
        ("seed: 7", "seed: -1", ["seed"], "less than the minimum"),
        ("seed: 7", "sed: 7", [], "'sed' was unexpected"),
        ("plant: one_axis_true", "plants: x", ["drives", "with"], "'plants' was unexpected"),
        ("workers: 3", "workers: x", ["executor", "with", "workers"], "is not of type 'integer'"),
        ("frf.log", "frf.lgo", ["stages", "frf", "use"], "is not one of"),
        ("count: 4", "count: 0", ["stages", "where", "with", "count"], "less than or equal to the minimum"),
        ("with: {count: 4}", "with: {}", ["stages", "where", "with"], "'count' is a required property"),
        (", with: {count: 4}", "", ["stages", "where"], "'with' is a required property"),
        ("[4, 80]", "[4]", ["stages", "excite", "with", "band_hz"], "is too short"),
        ("[4, 80]", "[4, x]", ["stages", "excite", "with", "band_hz", 1], "is not of type 'number'"),
        ("configurations:", "configs:", ["stages", "acquire", "inputs"], "'configs' was unexpected"),
        ("[frf]", "[frf, 3]", ["stages", "joint", "inputs", "frfs", 1], "is not of type 'string'"),
        ("[frf]", "[]", ["stages", "joint", "inputs", "frfs"], "should be non-empty"),
        (
            "{configurations: where}",
            "{configurations: [where]}",
            ["stages", "acquire", "inputs", "configurations"],
            "is not of type 'string'",
        ),
        ("cutoff_hz", "cutof_hz", ["stages", "read", "with", "filters", 0], "'cutof_hz' was unexpected"),
        ("  page: {use: report.html}", "  p-1: {use: report.html}", ["stages"], "does not match"),
        ("{use: report.html}", "{with: {}}", ["stages", "page"], "'use' is a required property"),
    ],
)
def test_a_wrong_pipeline_is_refused_where_it_is_wrong(
    validator: jsonschema.Draft7Validator, old: str, new: str, path: list[str | int], message: str
) -> None:
    assert GOOD.count(old) == 1
    errors = [
        (list(e.absolute_path), e.message) for e in validator.iter_errors(value(GOOD.replace(old, new)))
    ]
    assert any(where == path and message in text for where, text in errors), errors


def test_descriptions_reach_the_editor(plugins: Registry) -> None:
    schema = pipeline_schema(plugins)
    multisine = schema["definitions"]["stages.excitation.multisine"]
    assert multisine["description"] == "A multisine."
    assert multisine["properties"]["band_hz"]["description"] == "Lowest and highest frequency."
    use = schema["definitions"]["stage"]["properties"]["use"]
    assert use["enumDescriptions"][use["enum"].index("frf.log")] == "Logarithmic mean."
    assert "robid_module_that_is_not_there" in use["enumDescriptions"][use["enum"].index("broken.module")]


def test_nothing_of_later_drafts_is_left(plugins: Registry) -> None:
    text = repr(pipeline_schema(plugins))
    for word in ("$defs", "prefixItems", "discriminator", "dependentRequired", "unevaluated"):
        assert word not in text
