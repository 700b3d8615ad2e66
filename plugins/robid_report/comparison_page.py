"""The page of a comparison: what several runs found, side by side, in one file without network.

`robid diff RUN RUN --page FILE` makes it from runs, a pipeline from several of its fits. No clock and fixed ids, as
`report.html`.
"""

from __future__ import annotations

import itertools
from importlib import resources
from typing import Any

from markupsafe import Markup

from robid_core import ConfigurationError, Fit, Frf, Report, ReportStage
from robid_core.plot import DARK, pooled
from robid_report.comparison_figures import COLOURS, overlaid
from robid_report.comparison_rows import compared_rows
from robid_report.numbers import breakable, significant
from robid_report.packed import packed_json, packed_library, script_hash


class ComparisonPage(ReportStage):
    """One page that shows several fits side by side: parameters with intervals, and responses overlaid.

    compare: {use: report.comparison, inputs: {fits: [log_fit, fit]}, with: {labels: [responses, torque]}}
    """

    title: str = "Comparison"
    """Heading of the page."""
    labels: tuple[str, ...] = ()
    """What each fit is called, in order; by default 1, 2, 3..."""
    response_labels: tuple[str, ...] = ()
    """What each response is called; by default like the fits."""

    def run(self, fits: tuple[Fit, ...], frfs: tuple[Frf, ...] = ()) -> Report:
        """Put the fits beside each other and the responses over each other."""
        named = dict(zip(_labels("labels", self.labels, len(fits)), fits, strict=True))
        wanted = self.response_labels or (self.labels if len(frfs) == len(fits) else ())
        measured = dict(zip(_labels("response_labels", wanted, len(frfs)), frfs, strict=True))
        comparable = len({frf.axis_names for frf in measured.values()}) == 1
        figures = overlaid(measured) if comparable else []
        content = {
            "title": self.title,
            "labels": list(named),
            "rows": compared_rows(named),
            "doubts": [
                f"{label}: {doubt}"
                for label, fit in named.items()
                for doubt in fit.doubts
                if not doubt.is_remark
            ],
            "fits": [
                (label, fit.method, significant(fit.misfit, 3), fit.status.partition(";")[0])
                for label, fit in named.items()
            ],
            "figures": figures,
            "keys": [(label, *colours) for label, colours in zip(measured, itertools.cycle(COLOURS.items()))],
            "remark": "The runs share no configuration, so that their responses are not of the same pose."
            if measured
            else "",
        }
        return Report(html=render(content))


def render(content: dict[str, Any]) -> str:
    """Fill the template; figures go to the page's script as data."""
    from jinja2 import Environment, StrictUndefined  # slow to import

    files = resources.files("robid_report")
    read = {
        name: (files / name).read_text(encoding="utf-8")
        for name in ("comparison.html.j2", "comparison.js", "figures.js", "page.css")
    }
    scripts = [read["figures.js"], read["comparison.js"]] if content["figures"] else []
    allowed, library = [script_hash(script) for script in scripts], ""
    if scripts:
        library, own = packed_library()
        allowed.append(own)
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["breakable"] = breakable
    page: str = environment.from_string(read["comparison.html.j2"]).render(
        **content,
        data=packed_json(pooled({"figures": content["figures"], "dark": {**DARK, **COLOURS}})),
        style=Markup(read["page.css"]),
        library=Markup(library),
        scripts=[Markup(script) for script in scripts],
        policy=Markup(" ".join(f"'{one}'" for one in allowed) or "'none'"),
    )
    return page


def _labels(setting: str, labels: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Return a label for each; ConfigurationError where there are others than as many, or two are the same."""
    found = labels or tuple(str(number + 1) for number in range(count))
    if len(found) != count or len(set(found)) != count:
        raise ConfigurationError(
            f"{setting}: {', '.join(found)} are not a name of its own for each of {count}; give as many, all different"
        )
    return found
