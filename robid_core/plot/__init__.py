"""Figures of results, by Plotly: those of the page and those of a notebook, from the same numbers in the same style."""

from robid_core.plot.bode import Entry, beside, bode_data, bode_layout
from robid_core.plot.estimates import correlation, parameters
from robid_core.plot.figures import distortion, friction, residuals, response, time
from robid_core.plot.panels import (
    DECADES,
    PANEL,
    distortion_panels,
    level_of_response,
    panel_layout,
    residual_panels,
)
from robid_core.plot.pool import pooled
from robid_core.plot.recorded import record
from robid_core.plot.rounding import compact
from robid_core.plot.style import DARK, Figure
from robid_core.plot.traces import kept_samples, noun, traces

__all__ = [
    "DARK",
    "DECADES",
    "Entry",
    "Figure",
    "PANEL",
    "beside",
    "bode_data",
    "bode_layout",
    "compact",
    "correlation",
    "distortion",
    "distortion_panels",
    "friction",
    "kept_samples",
    "level_of_response",
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
