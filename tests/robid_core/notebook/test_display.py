"""What a notebook shows of simulations, linear models and pipelines: a line and a table in place of raw arrays."""

from __future__ import annotations

import re

import numpy as np
import pytest

import robid_core as robid
from robid_core.mechanics import LinearModel, Simulation
from robid_core.mechanics.simulate import SimulationState


def cells(html: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(<td.*?)</tr>", html)
    return [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in rows]


def test_a_linear_model_tells_its_resonances_and_their_damping() -> None:
    """One oscillator of 5 Hz with a damping ratio of 0.02: eigenvalues are -z w +- i w sqrt(1 - z^2)."""
    w, ratio = 2 * np.pi * 5, 0.02
    a = np.array([[0.0, 1.0], [-(w**2), -2 * ratio * w]])
    model = LinearModel(
        a,
        np.array([[0.0], [1.0]]),
        np.eye(2),
        np.zeros((2, 1)),
        ("<angle>", "speed"),
        ("torque",),
        ("y", "dy"),
    )
    assert repr(model) == "LinearModel: 2 states, 1 inputs, 2 outputs; resonances: 5 Hz"
    assert cells(model._repr_html_()) == [["5", "2 %"]]
    assert "&lt;angle&gt;" in model._repr_html_()
    frequencies, ratios = model.resonances()
    assert frequencies == pytest.approx([5.0])
    assert ratios == pytest.approx([0.02])


def test_a_simulation_tells_how_far_each_axis_went() -> None:
    none = np.zeros((1, 2))
    state = SimulationState(*(none,) * 8)
    position = np.zeros((1, 100, 2))
    position[0, :, 1] = np.linspace(-0.5, 1.25, 100)
    shown = Simulation(position, np.full((1, 100, 2), -3.0), np.array([[0.0, 0.25]]), None, state)
    assert (
        repr(shown)
        == "Simulation: 1 lanes, 100 samples, 2 axes; at the torque limit 25 % of the time at most"
    )
    assert cells(shown._repr_html_()) == [
        ["0", "0", "0 to 0", "3", "0 %"],
        ["0", "1", "-0.5 to 1.25", "3", "25 %"],
    ]


def test_a_long_table_ends_with_how_much_is_left() -> None:
    position = np.zeros((40, 5, 1))
    state = SimulationState(*(np.zeros((40, 1)),) * 8)
    html = Simulation(position, position, np.zeros((40, 1)), None, state)._repr_html_()
    assert len(cells(html)) == 30
    assert "10 more rows" in html


def test_a_pipeline_tells_its_stages_and_what_was_set() -> None:
    where = {"use": "design.candidates", "with": {"count": 2}}
    pipeline = robid.Pipeline.from_dict({"robot": "one_axis", "stages": {"where": where}})
    assert "robot one_axis" in repr(pipeline)
    assert repr(pipeline).endswith("stages: where")
    assert cells(pipeline._repr_html_()) == [["where", "design.candidates", "count: 2"]]
