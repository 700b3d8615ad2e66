"""Every key of a pipeline, misspelt: one problem, at that key, which offers the right one (fault Y01)."""

from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from robid_core.pipeline import Pipeline
from robid_core.yaml_file.kind import PIPELINE_FILE
from robid_core.yaml_file.nodes import Node
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.problems import FileProblems, KeyPath, ProblemList, nearest

TEXT = """\
robid: 1
name: example
seed: 7
robot: {model: one_axis, dynamics: kernel}
drives: {use: can, with: {plant: one_axis_true, bitrate: 1000000}}
executor: {use: pool, with: {workers: 2, address: here}}
stages:
  where:
    use: design.candidates
    with:
      count: 4
  excite:
    use: excitation.multisine
    with: {band_hz: [4, 80], lines: 100, odd: true}
  acquire:
    use: acquisition.drives
    inputs: {configurations: where, excitation: excite}
    with: {periods: 2, settle_periods: 1}
  frf: {use: frf.log, inputs: {record: acquire}, with: {discard: 1}}
  fit:
    with: {starts: 20, tolerance: 1e-6, criterion: response, estimator: {use: frf.h1, with: {discard: 1}}}
    use: fit.log_response
  page: {use: report.html, inputs: {fit: fit, frf: frf}}
"""


def keys(node: Node, path: KeyPath = ()) -> list[tuple[KeyPath, int, int]]:
    """Return (path, line, column) of every key that is the file format's or a plugin's; not the stages' names."""
    found = []
    for key, entry in node.entries().items():
        mark = node.keys[key]
        if path != ("stages",):
            found.append(((*path, key), mark.line, mark.column))
        found += keys(entry, (*path, key))
    return found


ROOT = read_nodes(TEXT, PIPELINE_FILE, ProblemList("x"))
assert ROOT is not None
KEYS = keys(ROOT)


def misspelt(line: int, column: int, old: str, new: str) -> str:
    lines = TEXT.splitlines(keepends=True)
    text = lines[line - 1]
    assert text[column - 1 :].startswith(old)
    lines[line - 1] = text[: column - 1] + new + text[column - 1 + len(old) :]
    return "".join(lines)


def test_the_text_itself_is_right(load: Callable[..., Pipeline]) -> None:
    assert len(load(TEXT).stages) == 6
    assert len(KEYS) > 40


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_damage_to_a_file_is_a_traceback(load: Callable[..., Pipeline], data: st.DataObject) -> None:
    text = TEXT
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        end = data.draw(st.integers(start, min(len(text), start + 30)))
        piece = data.draw(
            st.sampled_from(
                ["", " ", "\n", "{", "}", "[", "*a", "&a ", ": ", "- ", "null", "-1", "'", "fit", "~"]
            )
        )
        text = text[:start] + piece + text[end:]
    try:
        load(text.encode())  # as bytes: the fixture would take leading line ends away
    except FileProblems as error:
        places = [(problem.line, problem.column) for problem in error.problems]
        assert places == sorted(places)
        lines = text.splitlines()
        for line, column in places:
            assert 1 <= line <= len(lines) + 1
            assert 1 <= column <= max(len(lines[line - 1]) if line <= len(lines) else 0, 0) + 1


@pytest.mark.parametrize("number", range(len(KEYS)), ids=lambda n: ".".join(map(str, KEYS[n][0])))
@settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_misspelt_key_is_one_problem_at_its_place(
    load: Callable[..., Pipeline], number: int, data: st.DataObject
) -> None:
    path, line, column = KEYS[number]
    key = str(path[-1])
    position = data.draw(st.integers(0, len(key) - 1))
    letter = data.draw(st.sampled_from("qxz"))
    kind = data.draw(st.sampled_from(["replace", "insert", "delete", "swap"]))
    wrong = {
        "replace": key[:position] + letter + key[position + 1 :],
        "insert": key[:position] + letter + key[position:],
        "delete": key[:position] + key[position + 1 :],
        "swap": key[:position] + key[position : position + 2][::-1] + key[position + 2 :],
    }[kind]
    siblings = [str(p[-1]) for p, _, _ in KEYS if p[:-1] == path[:-1]]
    if wrong in siblings or not wrong:
        return
    with pytest.raises(FileProblems) as caught:
        load(misspelt(line, column, key, wrong))
    (problem,) = caught.value.problems
    assert (problem.line, problem.column) == (line, column)
    assert f"'{wrong}'" in problem.message
    if nearest(wrong, [key]):
        assert f"'{key}'" in problem.message or "did you mean" in problem.message
