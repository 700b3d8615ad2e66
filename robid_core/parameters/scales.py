"""Natural scales, bounds and default priors of parameters, by what they are of.

A prior is the standard deviation in the natural scale: 0.01 is one percent of a mass, of the radius of gyration for a
centre of mass, of the second moments for an inertia.
"""

from __future__ import annotations

from robid_core.robot.file.parameter_places import ParameterPlace

WIDE = 1.0  # of a logarithm: a factor of 2.7 either way
TOLERANCE = 0.01  # of what a drawing or a data sheet tells
LARGEST_CHANGE = 3.0  # natural logarithm: a factor of 20

LOGARITHM, LINEAR, MOMENT = "logarithm", "linear", "moment"


def scale_kind(place: ParameterPlace, value: float) -> str:
    """Return how a parameter is changed: by its logarithm, by adding to it, or with the other moments of its body."""
    head = place.name.partition(".")[0]
    if head == "inertia":
        return MOMENT
    if head in ("centre_of_mass", "coupling", "gear_ratio") or place.name.endswith(".offset"):
        return LINEAR
    if place.row is not None:
        return LOGARITHM if place.row.lower >= 0 and value > 0 else LINEAR
    return LOGARITHM if value > 0 else LINEAR


def default_prior(place: ParameterPlace) -> float:
    """Return the standard deviation that is assumed where nobody says another: wide, or what data sheets promise."""
    return TOLERANCE if place.group == "static" else WIDE


def is_not_negative(place: ParameterPlace) -> bool:
    """Whether a parameter without bounds of its own dissipates: told as zero, it stays there or goes up."""
    head = place.name.partition(".")[0]
    rubs = head == "friction" and not place.name.endswith(".offset")
    return place.row is None and (rubs or head.endswith("_damping"))


def linear_scale(place: ParameterPlace, value: float) -> float:
    """Return the unit of a parameter that is changed by adding: its own size, its default's, or that of its bounds."""
    if place.row is not None:
        sizes = [abs(value), abs(place.row.default), (place.row.upper - place.row.lower) / 10]
        return next((size for size in sizes if 0 < size < float("inf")), 1.0)
    return abs(value) if value else 1.0
