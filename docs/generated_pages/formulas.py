"""Formulas as MathML, which browsers draw themselves: no script and no network, as MathJax would need."""

from __future__ import annotations

import re

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

# docutils puts the index of a letter with an accent below the letter.
_ACCENT_AND_INDEX = re.compile(
    r"<munderover>\s*(<m[in]>[^<]*</m[in]>)\s*(<m[in]>[^<]*</m[in]>)\s*(<mo[^>]*>[˙¨ˆ]</mo>)\s*</munderover>"
)


def use_mathml(app: Sphinx) -> None:
    """Make this the site's way to write formulas."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.config.html_math_renderer = "mathml"


def mathml(formula: str, block: bool = False) -> str:
    """Return a LaTeX formula as MathML."""
    written = tex2mathml(formula, as_block=block)
    return _ACCENT_AND_INDEX.sub(r'<msub><mover accent="true">\1\3</mover>\2</msub>', written)


def _inline(translator: HTML5Translator, node: nodes.math) -> None:
    translator.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def _block(translator: HTML5Translator, node: nodes.math_block) -> None:
    translator.body.append(f'<div class="formula">{mathml(node.astext(), block=True)}</div>')
    raise nodes.SkipNode
