"""What a user reads uses the field's words: laws are seen by signals, values are stated, and nobody is "told" them."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest

from robid_core.registry import EFFECTS, registry

pytest.importorskip("sphinx", reason="the extra `docs` is not installed")
DOCS = Path(__file__).parents[2] / "docs"
sys.path.append(str(DOCS))

from generated_pages import commands, names, robot_file, stages  # noqa: E402

REFUSED = re.compile(r"\b(meets|told|tells|puts?\s+aside)\b", re.IGNORECASE)
CODE = re.compile(r"```.*?```|``.+?``|`[^`]+`|^ *(?:>>>|\.\.\. ).*$", re.DOTALL | re.MULTILINE)
UNREAD = "python/residual.rst"  # pure functions for authors of fits, whose docstrings are not gone over yet


def refused(text: str) -> list[str]:
    """Return the words that must not stand in a text, with what is around them; code is passed over."""
    prose = CODE.sub("`", text)
    return [
        " ".join(prose[max(0, found.start() - 60) : found.end() + 30].split())
        for found in REFUSED.finditer(prose)
    ]


def strings_of(source: str) -> Iterator[str]:
    """Docstrings of a module, a class or a function, of its members and of its fields."""
    for node in ast.walk(ast.parse(textwrap.dedent(source))):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            yield node.value.value


def test_prose_is_read_and_code_is_not() -> None:
    assert len(refused("Where it meets the law it is told.")) == 2
    assert refused("which is put\n    aside") == ["which is put aside"]
    assert refused("The field `told`, ``tells`` and\n>>> told = 1\n```\ntells\n```\nmeet, foretold") == []
    assert list(strings_of('class A:\n    """One."""\n    b: int\n    """Two."""\n')) == ["One.", "Two."]


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: str(page.name))
def test_written_pages_use_the_fields_words(page: Path) -> None:
    assert refused(page.read_text(encoding="utf-8")) == []


def test_pages_of_stages_commands_and_robot_files_use_the_fields_words() -> None:
    for name, text in {**stages.pages(), **commands.pages(), **robot_file.pages()}.items():
        assert refused(text) == [], name


def test_pages_of_effects_use_the_fields_words() -> None:
    for plugin in registry().plugins(EFFECTS):
        if plugin.distribution == "robid":
            module = sys.modules[plugin.load().__module__]
            assert [refused(text) for text in strings_of(inspect.getsource(module)) if refused(text)] == [], (
                plugin.name
            )


def test_pages_of_python_names_use_the_fields_words() -> None:
    found = []
    for page, text in names.pages().items():
        if page == UNREAD:
            continue
        for module, name in re.findall(r"\.\. auto(?:class|function):: ([\w.]+)\.(\w+)$", text, re.MULTILINE):
            value = getattr(importlib.import_module(module), name)
            try:
                source = inspect.getsource(value)
            except (OSError, TypeError):  # compiled, or a type alone
                source = repr(inspect.getdoc(value) or "")
            found += [(page, name, word) for one in strings_of(source) for word in refused(one)]
    assert found == []
