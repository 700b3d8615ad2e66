"""YAML 1.2 by its core schema, and the files that are refused before anything is built from them."""

import json
import math

import pytest
from hypothesis import given, strategies as st

from robid_core.yaml_file.characters import decode
from robid_core.yaml_file.kind import PIPELINE_FILE, ROBOT_FILE, FileKind
from robid_core.yaml_file.parsing import read_nodes
from robid_core.yaml_file.problems import ProblemList
from robid_core.yaml_file.scalars import plain_scalar

KINDS = pytest.mark.parametrize("kind", [PIPELINE_FILE, ROBOT_FILE], ids=lambda kind: kind.name)


def refused(data: bytes, kind: FileKind) -> list[str]:
    """Return what is told of a file that is no YAML of this kind."""
    problems = ProblemList("bad.yaml")
    text = decode(data, kind, problems)
    if text is not None:
        read_nodes(text, kind, problems)
    return [str(problem) for problem in problems.problems]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("010", 10),  # eight in YAML 1.1
        ("0o10", 8),
        ("0x1F", 31),
        ("-7", -7),
        ("1e2", 100.0),  # text to PyYAML
        (".5", 0.5),
        ("1.", 1.0),
        ("1:30", "1:30"),  # ninety in YAML 1.1
        ("1_000", "1_000"),  # a thousand in YAML 1.1
        ("0b11", "0b11"),  # three in YAML 1.1
        ("yes", "yes"),
        ("on", "on"),
        ("N", "N"),
        ("true", True),
        ("False", False),
        ("tRUE", "tRUE"),
        ("~", None),
        ("", None),
        ("null", None),
        ("-.inf", -math.inf),
        (".Inf", math.inf),
        ("inf", "inf"),
        ("nan", "nan"),
        ("2026-01-01", "2026-01-01"),  # a date in YAML 1.1
        ("=", "="),
        ("1e", "1e"),
    ],
)
def test_plain_scalars_mean_what_yaml_1_2_says(text: str, value: object) -> None:
    found = plain_scalar(text)
    assert found == value
    assert type(found) is type(value)


def test_not_a_number_is_read_as_such() -> None:
    assert math.isnan(plain_scalar(".nan"))  # type: ignore[arg-type]


@given(st.integers() | st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_survive_their_own_text(number: float) -> None:
    text = repr(number)
    found = plain_scalar(text)
    assert found == number
    assert type(found) is type(number)


text = st.text(st.characters(codec="utf-8", categories=("L", "N", "P", "S", "Zs")), max_size=8)
values = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**9), 10**9) | st.floats(-1e9, 1e9) | text,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(text.filter(bool), inner, max_size=4),
    max_leaves=12,
)


@given(values)
def test_json_is_yaml(value: object) -> None:
    """JSON is a subset of YAML 1.2 (section 1.3), and another library writes it: an independent oracle."""
    problems = ProblemList("x")
    root = read_nodes(json.dumps({"value": value}, ensure_ascii=False), PIPELINE_FILE, problems)
    assert not problems.problems
    assert root is not None
    assert root.plain() == {"value": value}


def test_every_value_knows_its_place() -> None:
    root = read_nodes("a:\n  b: [1, {c: 2}]\n  'd e': x\n", PIPELINE_FILE, ProblemList("x"))
    assert root is not None
    found = {
        path: root.at(path) for path in [("a",), ("a", "b"), ("a", "b", 1), ("a", "b", 1, "c"), ("a", "d e")]
    }
    assert {path: (mark.line, mark.column) for path, (_, mark) in found.items()} == {
        ("a",): (1, 1),
        ("a", "b"): (2, 3),
        ("a", "b", 1): (2, 10),
        ("a", "b", 1, "c"): (2, 11),
        ("a", "d e"): (3, 3),
    }


def doubling(levels: int) -> str:
    """Return a file whose n-th line repeats the line before it twice: 2^n values when written out."""
    lines = ["a0: &a0 [x, x]"]
    lines += [f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]" for n in range(1, levels)]
    return "\n".join(lines) + "\n"


REFUSED = {
    "deep nesting in flow": (b"x: " + b"[" * 40, "1:35", "nested deeper than 32 levels"),
    "deep nesting in blocks": (
        "\n".join("  " * level + "a:" for level in range(40)).encode(),
        "33:65",
        "nested deeper than 32 levels",
    ),
    "billion laughs": (doubling(32).encode(), "16:6", "more than 100000 values"),
    "deep by aliases": (
        ("a0: &a0 [x]\n" + "".join(f"a{n}: &a{n} [*a{n - 1}]\n" for n in range(1, 40))).encode(),
        "32:6",
        "more than 32 levels",
    ),
    "recursive alias": (b"a: &a [*a]\n", "1:8", "the alias '*a' stands inside the value it repeats"),
    "alias of nothing": (b"a: *b\n", "1:4", "the alias '*b' has no anchor before it"),
    "merge bomb": (b"a: &a {x: 1}\nb: {<<: [*a, *a, *a]}\n", "2:5", "merge keys are not part of YAML 1.2"),
    "tag on a list": (b"seed: !!python/tuple [1]\n", "1:7", "the tag '!!python/tuple' is refused"),
    "local tag": (b"seed: !mine 1\n", "1:7", "the tag '!mine' is refused"),
    "tag on a key": (b"!!str seed: 1\n", "1:1", "the tag '!!str' is refused"),
    "second document": (b"robid: 1\n---\nrobid: 1\n", "2:1", "a second document"),
    "half a character": (b'robid: 1\nname: "\\ud800"\n', "2:7", r"\ud800 is half a character"),
    "YAML 1.1": (b"%YAML 1.1\n---\nrobid: 1\n", "2:1", "YAML 1.1 is asked for"),
    "list for a key": (b"[a, b]: 1\n", "1:1", "a key must be plain text"),
    "byte order mark": (b"\xef\xbb\xbfrobid: 1\n", "1:1", "byte 0 is 0xef: a byte order mark"),
    "UTF-16": ("robid: 1\n".encode("utf-16"), "1:1", "byte 0 is 0xff: UTF-16"),
    "Latin-1": ("robid: 1\nname: é\n".encode("latin-1"), "2:7", "byte 15 is 0xe9: not UTF-8"),
    "control character": (
        b"robid: 1\nname: a\x1bb\n",
        "2:8",
        "byte 16 is 0x1b: a control character (U+001B)",
    ),
    "null byte": (b"robid: \x00\n", "1:8", "byte 7 is 0x00: a control character (U+0000)"),
    "right-to-left override": (
        "# é\u202e\n".encode(),
        "1:4",
        "byte 4 is 0xe2: an invisible character (U+202E)",
    ),
    "empty": (b"# nothing\n", "1:1", "the file is empty"),
    "tab": (b"a:\n\tb: 1\n", "2:1", "not YAML: found character '\\t'"),
}


@KINDS
@pytest.mark.parametrize(
    ("data", "place", "message"), REFUSED.values(), ids=[k.replace(" ", "_") for k in REFUSED]
)
def test_dangerous_or_unreadable_files_are_refused(
    data: bytes, place: str, message: str, kind: FileKind
) -> None:
    (line,) = [entry for entry in refused(data, kind) if message in entry]
    assert line.startswith(f"bad.yaml:{place}: ")


@KINDS
def test_a_file_has_the_size_of_its_kind(kind: FileKind) -> None:
    assert not refused(b"a: 1\n".ljust(kind.maximum_bytes, b"#"), kind)
    (line,) = refused(b"#" * (kind.maximum_bytes + 1), kind)
    assert line.startswith(f"bad.yaml:1:1: {kind.maximum_bytes + 1} bytes; {kind.noun} has at most ")


def test_a_pipeline_has_few_aliases_and_a_robot_as_many_as_it_has_values() -> None:
    data = b"a: &a 1\nb: [" + b"*a, " * 64 + b"*a]"
    (line,) = refused(data, PIPELINE_FILE)
    assert line == "bad.yaml:2:261: more than 64 aliases; write the values out"
    assert not refused(data, ROBOT_FILE)


def test_what_stands_in_an_alias_is_told_where_the_alias_is() -> None:
    text = "gear: &gear {stiffness: [1, 2]}\nother: *gear\nboth:\n  - *gear\n"
    root = read_nodes(text, ROBOT_FILE, ProblemList("x"))
    assert root is not None
    found = {
        path: root.at(path)
        for path in [
            ("gear", "stiffness", 1),
            ("other", "stiffness", 1),
            ("both", 0),
            ("both", 0, "stiffness"),
        ]
    }
    assert {path: (mark.line, mark.column) for path, (_, mark) in found.items()} == {
        ("gear", "stiffness", 1): (1, 29),
        ("other", "stiffness", 1): (2, 1),
        ("both", 0): (4, 5),
        ("both", 0, "stiffness"): (4, 5),
    }
    assert all(path == existing for path, (existing, _) in found.items())


def test_every_forbidden_character_is_listed() -> None:
    found = refused("robid: \u200e1\nname: \u2066x\u2069\n".encode(), PIPELINE_FILE)
    assert [line.split(": ")[0] for line in found] == ["bad.yaml:1:8", "bad.yaml:2:7", "bad.yaml:2:9"]


@given(st.binary(max_size=200))
def test_no_bytes_make_the_reader_fail(data: bytes) -> None:
    problems = ProblemList("x")
    text = decode(data, PIPELINE_FILE, problems)
    root = read_nodes(text, PIPELINE_FILE, problems) if text is not None else None
    assert root is not None or problems.problems


@given(st.text("{}[]:,-?&*!|>'\"%@`#ab1 \n", max_size=60))
def test_no_text_makes_the_reader_fail(text: str) -> None:
    problems = ProblemList("x")
    assert read_nodes(text, PIPELINE_FILE, problems) is not None or problems.problems


def test_the_cost_of_a_bomb_is_the_cost_of_its_text() -> None:
    """Aliases are counted, never copied: the node tree shares them, so the work is linear in the file."""
    text = doubling(17)
    root = read_nodes(text, PIPELINE_FILE, ProblemList("x"))
    assert root is None  # 2^17 values
    shared = read_nodes(doubling(10), PIPELINE_FILE, ProblemList("x"))
    assert shared is not None
    last = shared.get("a9")
    assert last is not None
    assert isinstance(last.value, list)
    assert last.value[0] is last.value[1]
    assert last.size == 2**11 - 1


def test_lines_that_are_indented_with_no_break_spaces_are_named() -> None:
    text = "stages:\n  a: {use: x}\n\u00a0\u00a0b: {use: y}\n  c: {use: z}\n"
    assert refused(text.encode(), PIPELINE_FILE) == [
        "bad.yaml:3:1: not YAML: indented with a no-break space (U+00A0); type plain spaces"
    ]


def test_quoted_text_stays_text() -> None:
    root = read_nodes("a: '3'\nb: \"yes\"\nc: |\n  1\n", PIPELINE_FILE, ProblemList("x"))
    assert root is not None
    assert root.plain() == {"a": "3", "b": "yes", "c": "1\n"}
