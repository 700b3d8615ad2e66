"""What a page carries packed: Plotly, and the numbers of its figures; both as base64 of gzip, which figures.js unpacks.

Plotly is the bundle of its makers that has `scatter`, `bar` and `pie` alone (MIT, plotly-basic.LICENSE): 0.5 MB of a
page where the whole takes 2.0. It is part of no Python package. plotly-basic.min.js.gz is made again by

    npm pack plotly.js-basic-dist-min@4.1.1
    tar xzf plotly.js-basic-dist-min-4.1.1.tgz && gzip -9 -n package/plotly-basic.min.js
"""

from __future__ import annotations

import base64
import functools
import gzip
import hashlib
import json
from importlib import resources
from typing import Any

from markupsafe import Markup

BUNDLE = "plotly-basic.min.js.gz"


def json_for_script(data: Any) -> Markup:
    """JSON that may stand in a script element: no character of it can end the element or start a comment."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=True)
    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


def packed_json(data: Any) -> Markup:
    """JSON as base64 of gzip, of which nothing can end a script element."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=True)
    return Markup(base64.b64encode(gzip.compress(text.encode(), compresslevel=9, mtime=0)).decode())


def script_hash(script: str) -> str:
    """What a Content-Security-Policy calls an inline script: the base64 of its SHA-256."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


@functools.cache
def packed_library() -> tuple[str, str]:
    """Plotly as base64 of gzip, and the hash under which the page's policy allows what comes out."""
    packed = (resources.files("robid_report") / BUNDLE).read_bytes()
    return base64.b64encode(packed).decode(), script_hash(gzip.decompress(packed).decode())
