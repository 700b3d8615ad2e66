"""Robot files as YAML 1.2: what a parser makes of them silently is refused, or read as it stands."""

from __future__ import annotations

from pathlib import Path

import pytest

from robid_core.robot.file.document import read_document
from robid_core.yaml_file.problems import FileProblems


def refusal(folder: Path, content: str | bytes) -> str:
    """Return what is told of a file, all its problems in lines."""
    (folder / "robot.yaml").write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(FileProblems) as refused:
        read_document(folder / "robot.yaml").problems.raise_if_any()
    return str(refused.value)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("a: 1\nb: 2\na: 3\n", "robot.yaml:3:1: a: repeated key 'a': it stands at line 1 already; keep one"),
        ("a: !!float 1\n", "robot.yaml:1:4: a: the tag '!!float' is refused"),
        ("a: &x [*x]\n", "robot.yaml:1:8: a[0]: the alias '*x' stands inside the value it repeats; write the value"),
        ("a: 1\n---\nb: 2\n", "robot.yaml:2:1: a second document; a robot file holds one"),
        ("a: \x01\n", "robot.yaml:1:4: byte 3 is 0x01: a control character (U+0001); delete it"),
        ("", "robot.yaml:1:1: the file is empty; begin with `robid_robot: 1` and `name: ...`"),
        ("- 1\n", "robot.yaml:1:1: a robot file holds keys and values; begin with `robid_robot: 1`"),
        (b"#" * (1024 * 1024 + 1), "robot.yaml:1:1: 1048577 bytes; a robot file has at most 1024 KiB"),
    ],
)  # fmt: skip
def test_what_yaml_would_let_pass_is_refused_where_it_stands(
    tmp_path: Path, content: str | bytes, told: str
) -> None:
    assert refusal(tmp_path, content).startswith(told)


def test_an_alias_means_the_value_and_stands_where_it_is_written(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text("gear: &gear {stiffness: 1.0e+5}\nother: *gear\n")
    document = read_document(tmp_path / "robot.yaml")
    assert document.data == {"gear": {"stiffness": 1e5}, "other": {"stiffness": 1e5}}
    assert document.mark(("other", "stiffness")).line == 2
    assert document.mark(("gear", "stiffness")).line == 1


def test_text_in_quotes_stays_text(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text("a: '1'\nb: \"true\"\nc: |\n  1\n")
    assert read_document(tmp_path / "robot.yaml").data == {"a": "1", "b": "true", "c": "1\n"}


def test_a_file_that_cannot_be_opened_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(FileProblems, match=r"^none.yaml:1:1: cannot be read: No such file or directory"):
        read_document(tmp_path / "none.yaml")
