"""What iterations of local rational fits are worth, by parametrisation and number of passes."""

from __future__ import annotations

from typing import Literal, get_args

from studies.frf_methods.methods import METHODS, Method

Parametrization = Literal["scalar", "miso", "mimo"]
PASSES = (0, 1, 3)
COUNTS = (1, 6, 24)


def methods() -> dict[str, Method]:
    """LOG, which the errors are held against, and every parametrisation with none, one and three passes."""
    found = {"log": METHODS["log"]}
    for parametrization in get_args(Parametrization):
        for passes in PASSES:
            settings = {"parametrization": parametrization, "iterations": passes}
            title = f"LRM {parametrization.upper() if parametrization != 'scalar' else 'scalar'}"
            words = f", at most {passes} iteration{'s' if passes > 1 else ''}" if passes else ""
            found[f"{parametrization}_{passes}"] = Method(title + words, "frf.lrm", settings, counts=COUNTS)
    return found
