"""Robot files as YAML 1.2: what a parser makes of them silently is refused, or read as it stands."""

from __future__ import annotations

from pathlib import Path

import pytest

from robid_core.robot.problems import RobotProblems
from robid_core.robot.yaml_source import MAXIMUM_BYTES, plain_scalar, read_document


def refusal(folder: Path, content: str | bytes) -> str:
    """Return what is told of a file, all its problems in lines."""
    (folder / "robot.yaml").write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(RobotProblems) as refused:
        read_document(folder / "robot.yaml").raise_if_any()
    return str(refused.value)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("a: 1\nb: 2\na: 3\n", "robot.yaml:3:1: a: repeated key 'a': it stands at line 1 already; keep one"),
        ("a:\n  b: 1\n  b: {c: 2}\n", "robot.yaml:3:3: a.b: repeated key 'b': it stands at line 2 already"),
        ("a: !!python/object/apply:os.system [ls]\n", "robot.yaml:1:4: a: the tag '!!python/object/apply:os.system'"),
        ("a: !!float 1\n", "robot.yaml:1:4: a: the tag '!!float' is refused"),
        ("a: &x [*x]\n", "robot.yaml:1:8: the alias '*x' has no anchor before it; write the value out"),
        ("a: *x\n", "robot.yaml:1:4: the alias '*x' has no anchor before it"),
        ("a: 1\n---\nb: 2\n", "robot.yaml:2:1: a second document"),
        ("a: [1,\n", "robot.yaml:2:1: not YAML: expected the node content, but found '<stream end>'"),
        ("a: {b: [1, 2}\n", "robot.yaml:1:13: not YAML: "),
        ("a:\n\t- 1\n", "robot.yaml:2:1: not YAML: found character '\\t' that cannot start any token"),
        ("a: \x01\n", "robot.yaml:1:1: not YAML: unacceptable character"),
        ("? [1, 2]\n: 3\n", "robot.yaml:1:3: a key must be plain text"),
        ("", "robot.yaml:1:1: a robot file holds keys and values; begin with robid_robot: 1"),
        ("- 1\n", "robot.yaml:1:1: a robot file holds keys and values"),
        ("a: " + "[" * 40 + "]" * 40, "robot.yaml:1:35: nested deeper than 32 levels"),
        (b"name: caf\xe9\n", "robot.yaml:1:1: byte 9 is 0xe9: not UTF-8"),
        (b"#" * (MAXIMUM_BYTES + 1), f"robot.yaml:1:1: {MAXIMUM_BYTES + 1} bytes; a robot file has at most 1024 KiB"),
    ],
)  # fmt: skip
def test_what_yaml_would_let_pass_is_refused_where_it_stands(
    tmp_path: Path, content: str | bytes, told: str
) -> None:
    assert refusal(tmp_path, content).startswith(told)


def test_aliases_that_blow_up_are_refused_before_they_do(tmp_path: Path) -> None:
    lines = ["a: &a [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]"]
    lines += [f"{b}: &{b} [{', '.join([f'*{a}'] * 10)}]" for a, b in zip("abcdefgh", "bcdefghi", strict=True)]
    assert "with its aliases written out the file has more than 100000 values" in refusal(
        tmp_path, "\n".join(lines)
    )


def test_an_alias_means_the_value_and_stands_where_it_is_written(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text("gear: &gear {stiffness: 1.0e+5}\nother: *gear\n")
    document = read_document(tmp_path / "robot.yaml")
    assert document.data == {"gear": {"stiffness": 1e5}, "other": {"stiffness": 1e5}}
    assert document.mark(("other", "stiffness")).line == 2
    assert document.mark(("gear", "stiffness")).line == 1


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("yes", "yes"), ("on", "on"), ("1:30", "1:30"), ("1_000", "1_000"), ("010", 10), ("0x10", "0x10"),
        ("1e5", 1e5), (".5", 0.5), ("-2.", -2.0), ("+3", 3), ("~", None), ("", None), ("NULL", None), ("True", True),
        ("tRUE", "tRUE"), ("-.inf", -float("inf")), ("2026-11-21", "2026-11-21"), ("1" * 301, "1" * 301),
    ],
)  # fmt: skip
def test_plain_scalars_are_those_of_yaml_1_2(text: str, value: object) -> None:
    found = plain_scalar(text)
    assert found == value
    assert type(found) is type(value)


def test_text_in_quotes_stays_text(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text("a: '1'\nb: \"true\"\nc: |\n  1\n")
    assert read_document(tmp_path / "robot.yaml").data == {"a": "1", "b": "true", "c": "1\n"}


def test_a_file_that_cannot_be_opened_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(RobotProblems, match=r"^none.yaml:1:1: cannot be read: No such file or directory"):
        read_document(tmp_path / "none.yaml")
