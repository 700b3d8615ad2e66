"""Formulas as MathML, which browsers draw themselves: no script and no network, as MathJax would need."""

from __future__ import annotations

import re
import unicodedata

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

# docutils puts the index of a letter with an accent below the letter, and browsers the accent too near to it.
_ACCENTS = {
    "˙": "\N{COMBINING DOT ABOVE}",
    "¨": "\N{COMBINING DIAERESIS}",
    "ˆ": "\N{COMBINING CIRCUMFLEX ACCENT}",
}
_ACCENT = rf"<mo[^>]*>([{''.join(_ACCENTS)}])</mo>"
_WITH_INDEX = re.compile(
    rf"<munderover>\s*<mi>([A-Za-z])</mi>\s*(<m[in]>[^<]*</m[in]>)\s*{_ACCENT}\s*</munderover>"
)
_ALONE = re.compile(rf"<mover[^>]*>\s*<mi>([A-Za-z])</mi>\s*{_ACCENT}\s*</mover>")


def use_mathml(app: Sphinx) -> None:
    """Make this the site's way to write formulas."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.config.html_math_renderer = "mathml"


def mathml(formula: str, block: bool = False) -> str:
    """Return a LaTeX formula as MathML."""
    written = tex2mathml(formula, as_block=block)
    written = _WITH_INDEX.sub(lambda m: f"<msub>{_accented(m[1], m[3])}{m[2]}</msub>", written)
    return _ALONE.sub(lambda m: _accented(m[1], m[2]), written)


def _accented(letter: str, accent: str) -> str:
    """Return an italic letter with its accent as one identifier."""
    case = "CAPITAL" if letter.isupper() else "SMALL"
    return f"<mi>{unicodedata.lookup(f'MATHEMATICAL ITALIC {case} {letter.upper()}')}{_ACCENTS[accent]}</mi>"


def _inline(translator: HTML5Translator, node: nodes.math) -> None:
    translator.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def _block(translator: HTML5Translator, node: nodes.math_block) -> None:
    translator.body.append(f'<div class="formula">{mathml(node.astext(), block=True)}</div>')
    raise nodes.SkipNode
