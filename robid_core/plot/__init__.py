"""Figures of results, by Plotly: those of the page and those of a notebook, from the same numbers in the same style."""

from robid_core.plot.bode import Entry, bode_data, bode_layout, comparison_of
from robid_core.plot.estimates import correlation, parameters
from robid_core.plot.figures import distortion, friction, residuals, response, time
from robid_core.plot.panels import distortion_panels, panel_layout, residual_panels
from robid_core.plot.pool import pooled
from robid_core.plot.recorded import record
from robid_core.plot.rounding import compact
from robid_core.plot.style import DARK, Figure
from robid_core.plot.traces import kept_samples, noun, traces

__all__ = [
    "DARK",
    "Entry",
    "Figure",
    "bode_data",
    "bode_layout",
    "compact",
    "comparison_of",
    "correlation",
    "distortion",
    "distortion_panels",
    "friction",
    "kept_samples",
    "noun",
    "panel_layout",
    "parameters",
    "pooled",
    "record",
    "residual_panels",
    "residuals",
    "response",
    "time",
    "traces",
]
