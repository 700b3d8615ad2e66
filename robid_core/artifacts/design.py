"""Configurations chosen for what they tell about the parameters."""

from __future__ import annotations

from dataclasses import dataclass, field

from robid_core.arrays import FloatArray, IntArray
from robid_core.artifacts.artifact import array
from robid_core.artifacts.configurations import Configurations
from robid_core.artifacts.tables import Table


@dataclass(frozen=True, eq=False)
class Design(Configurations):
    """Configurations in order of weight, with the certificate that no other choice is better.

    `weight` is the share of experiments for each chosen configuration (relaxed optimum, sums to 1);
    `experiments` the whole numbers after rounding; `gap` the bound of the equivalence theorem: the optimum
    of the criterion is at most `gap` away.
    """

    criterion: str = field(kw_only=True)
    parameter_names: tuple[str, ...] = field(kw_only=True)
    gap: float = field(kw_only=True)
    efficiency: float = field(kw_only=True)
    weight: FloatArray = array("n_config", keyword=True)
    experiments: IntArray = array("n_config", keyword=True)
    candidate_index: IntArray = array("n_config", keyword=True)
    information: FloatArray = array("n_parameter n_parameter", keyword=True, covariance=True)
    predicted_standard_error: FloatArray = array("n_parameter", "relative", finite=False, keyword=True)

    def table(self) -> Table:
        """Return a row for each configuration: its angles, its weight and how often it is measured.

        >>> import robid_core as robid
        >>> from robid_core.testing import example_design
        >>> table = example_design(robid.Robot.load("one_axis")).table()
        >>> list(table), sum(table["weight"])
        (['configuration', 'axis_1', 'weight', 'experiments'], 1.0)
        """
        return Table(
            {**super().table(), "weight": self.weight.tolist(), "experiments": self.experiments.tolist()}
        )
