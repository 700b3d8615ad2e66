"""What responses and torques say of stiffnesses, side by side on the page."""

from __future__ import annotations

import numpy as np

from robid_core import Diagnosis, ResponseCheck
from robid_report.response_check import response_check_table


def test_both_estimates_their_difference_and_the_judgement_stand_in_a_row() -> None:
    response_check = ResponseCheck(
        "frf.lrm, fit.log_response", "", 1.1, 3.48, ("gear_stiffness.axis_1",), ("N m/rad",), np.array([90.0]),
        np.array([0.8]), np.array([100.0]), np.array([0.6]), np.array([-10.0]),
    )  # fmt: skip
    table = response_check_table(Diagnosis("effects", "", response_check=response_check))
    assert table is not None
    assert (table["method"], table["limit"]) == ("frf.lrm, fit.log_response", "3.5")
    (row,) = table["rows"]
    assert (row["by_torques"], row["by_responses"]) == ("100.00 ± 0.60", "90.00 ± 0.80")
    assert (row["difference"].split()[0], row["apart"], row["agree"]) == ("−10.00", "−10.0", False)


def test_where_there_is_no_check_there_is_no_table() -> None:
    none, number = np.empty(0), float("nan")
    silent = ResponseCheck(
        "", "the record does not repeat", number, number, (), (), none, none, none, none, none
    )
    assert response_check_table(Diagnosis("effects", "", response_check=silent)) is None
    assert response_check_table(Diagnosis("effects", "")) is None
