"""What a page owes: whole HTML, nothing loaded from elsewhere, no script but its own, text of others as text."""

from __future__ import annotations

import base64
import hashlib
import re
from html.parser import HTMLParser

from robid_core.artifacts import Artifact, Report
from robid_core.testing.broken import ContractBroken

VOID = frozenset(
    ("area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr")
)
OPTIONAL_END = frozenset(
    (
        "li",
        "p",
        "td",
        "th",
        "tr",
        "tbody",
        "thead",
        "tfoot",
        "dt",
        "dd",
        "option",
        "colgroup",
        "html",
        "body",
        "head",
    )
)
LOADING = {"src", "srcset", "data", "poster", "action", "formaction", "background", "manifest"}
LOADING_TAGS = frozenset(("iframe", "object", "embed", "frame", "base"))
DATA_TYPES = ("application/json", "application/ld+json", "text/plain")
MARK = "planted-by-the-kit"
PLANTED = f'<{MARK} onclick="1">"\'&'
FREE_TEXTS = ("method", "status", "verdict", "estimator", "pooling", "source", "misfit_against")
"""Fields of artifacts that hold words of whoever made them."""
POLICY = "Content-Security-Policy"


class Page(HTMLParser):
    """Elements, scripts and styles of a page, and the first thing that is not whole."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.scripts: list[tuple[dict[str, str], str]] = []
        self.styles: list[str] = []
        self.fault = ""
        self.doctype = False
        self._open: list[tuple[str, dict[str, str], list[str]]] = []
        self.feed(html)
        self.close()
        left = [tag for tag, _, _ in self._open if tag not in OPTIONAL_END]
        if left and not self.fault:
            self.fault = f"<{left[-1]}> is never closed"

    def handle_decl(self, decl: str) -> None:
        """Note the doctype."""
        self.doctype |= decl.lower().startswith("doctype html")

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep an element."""
        found = {name: value or "" for name, value in attrs}
        self.elements.append((tag, found))
        if tag not in VOID:
            self._open.append((tag, found, []))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep an element that is closed at once, as SVG has them."""
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        """Close an element, and those inside whose end may be left out."""
        while self._open and self._open[-1][0] != tag and self._open[-1][0] in OPTIONAL_END:
            self._open.pop()
        if not self._open or self._open[-1][0] != tag:
            self.fault = self.fault or f"</{tag}> closes nothing at line {self.getpos()[0]}"
            return
        _, attributes, text = self._open.pop()
        if tag == "script":
            self.scripts.append((attributes, "".join(text)))
        elif tag == "style":
            self.styles.append("".join(text))

    def handle_data(self, data: str) -> None:
        """Keep the text of the innermost element."""
        if self._open:
            self._open[-1][2].append(data)


def check_page(name: str, report: Report) -> None:
    """Check one page; ContractBroken says what is wrong with it."""
    page = Page(report.html)
    if not page.doctype:
        raise ContractBroken(f"{name}: the page does not begin with <!doctype html>")
    if page.fault:
        raise ContractBroken(f"{name}: the page is not whole: {page.fault}")
    tags = {tag for tag, _ in page.elements}
    if "title" not in tags:
        raise ContractBroken(f"{name}: the page has no <title>")
    if not any(tag == "meta" and "charset" in attributes for tag, attributes in page.elements):
        raise ContractBroken(f'{name}: the page does not say <meta charset="utf-8">')
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    if len(set(ids)) < len(ids):
        raise ContractBroken(f"{name}: two elements have the id '{next(i for i in ids if ids.count(i) > 1)}'")
    _check_loads(name, page)
    _check_scripts(name, page)


def _check_loads(name: str, page: Page) -> None:
    """Check that nothing is loaded; links that a person may follow are none."""
    for tag, attributes in page.elements:
        loading = LOADING | ({"href", "xlink:href"} if tag not in ("a", "area") else set())
        for attribute in loading & attributes.keys():
            value = attributes[attribute].strip()
            if value and not value.startswith(("#", "data:")):
                raise ContractBroken(
                    f'{name}: <{tag} {attribute}="{value[:60]}"> loads from elsewhere; put it into the page'
                )
        if tag in LOADING_TAGS:
            raise ContractBroken(f"{name}: <{tag}> brings in what is not of the page")
        if tag == "meta" and attributes.get("http-equiv", "").lower() == "refresh":
            raise ContractBroken(f"{name}: the page sends its reader elsewhere by a refresh")
    styles = [*page.styles, *(attributes.get("style", "") for _, attributes in page.elements)]
    for style in styles:
        found = re.search(r"@import|url\(\s*[\"']?(?!data:|#)[^)]{0,40}", style)
        if found:
            raise ContractBroken(f"{name}: the style loads from elsewhere: {found[0]}")


def _check_scripts(name: str, page: Page) -> None:
    """Check that there is no script but inline ones that the page's own policy names by their hash."""
    policy = next(
        (a.get("content", "") for tag, a in page.elements if tag == "meta" and a.get("http-equiv") == POLICY),
        "",
    )
    for attributes, text in page.scripts:
        if attributes.get("type", "").lower() in DATA_TYPES:
            continue
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        named = f"'sha256-{digest}'" in policy and "default-src 'none'" in policy
        if not named:
            raise ContractBroken(
                f"{name}: the page has a script ({' '.join(text.split())[:40]!r}) that its "
                f"Content-Security-Policy does "
                "not allow by its hash beside default-src 'none'; leave scripts out, or name them so"
            )
    for tag, attributes in page.elements:
        handlers = [attribute for attribute in attributes if attribute.startswith("on")]
        if handlers:
            raise ContractBroken(f"{name}: <{tag} {handlers[0]}=...> is a script in an attribute")
        if any(value.strip().lower().startswith("javascript:") for value in attributes.values()):
            raise ContractBroken(f"{name}: a link of <{tag}> is a script")


def check_text_stays_text(name: str, report: Report) -> None:
    """Check a page of artifacts whose texts are markup (`planted`): none of it became an element."""
    if any(tag == MARK for tag, _ in Page(report.html).elements):
        raise ContractBroken(
            f"{name}: text of an artifact became an element of the page; escape names, units and sentences "
            "(html.escape, or a template that does)"
        )


def planted(artifact: Artifact) -> Artifact:
    """Return an artifact with markup behind each of its free texts."""
    texts = {name: getattr(artifact, name, None) for name in FREE_TEXTS}
    return artifact.replace(**{name: text + PLANTED for name, text in texts.items() if isinstance(text, str)})
