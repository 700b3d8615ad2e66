"""What every part of a robot file has in common: read strictly, and refused with the place of the mistake."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

from robid_core.yaml_file.problems import KeyPath

LARGEST = 1e15  # beyond it no number of a robot means anything, and squares may overflow
SMALLEST = 1 / LARGEST  # of numbers that something is divided by


def _not_tiny(value: float) -> float:
    if value < SMALLEST:
        raise refusal(
            f"{value:g} is too small to be computed with, it must be at least {SMALLEST:g}; is the unit right?"
        )
    return value


def _three_numbers(value: Any) -> Any:
    """Refuse one number, and more than three, in words that say what is wanted; the rest is pydantic's."""
    if _is_number(value):
        raise refusal(
            f"{value:g} is written here, three numbers are wanted, along x, y and z: [0, 0, {value:g}]"
        )
    if isinstance(value, tuple) and len(value) > 3 and all(map(_is_number, value)):
        told = f"{len(value)} entries, there must be 3"
        if any(isinstance(number, int) and number >= 0 for number in value[1:]):
            told += "; decimal commas? A comma parts the entries: write points, as in [0, 0, 0.3]"
        raise refusal(told)
    return value


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Vector = Annotated[tuple[Number, Number, Number], BeforeValidator(_three_numbers)]
Positive = Annotated[float, Field(gt=0, le=LARGEST), AfterValidator(_not_tiny)]
NonNegative = Annotated[float, Field(ge=0, le=LARGEST)]
Identifier = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]

_REASON = "reason"


class Part(BaseModel):
    """A mapping of the robot file: no unknown key, no value of another type, no infinity."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, use_attribute_docstrings=True
    )


def refusal(reason: str) -> PydanticCustomError:
    """Return what a validator raises: `reason` says what is wrong, with the number, and what to do."""
    return PydanticCustomError("refused", "{reason}", {_REASON: reason})


def line_errors(error: ValidationError, prefix: KeyPath = ()) -> list[InitErrorDetails]:
    """Return the errors of a part, to be raised again by the whole in which it stands at `prefix`."""
    found = []
    for item in error.errors(include_url=False):
        context = item.get("ctx", {})
        if item["type"] == "too_short" and len(item["input"]) >= context["min_length"]:
            continue  # pydantic counts what is right; the wrong ones are told
        location = (*prefix, *item["loc"])
        if item["type"] == "refused":
            kind: str | PydanticCustomError = refusal(context[_REASON])
            context = {}
        elif item["type"] in ("value_error", "assertion_error"):
            kind, context = refusal(str(context["error"])), {}
        else:
            kind = item["type"]
        found.append(InitErrorDetails(type=kind, loc=location, input=item["input"], ctx=context))
    return found


def with_tuples(data: Any) -> Any:
    """Return plain data with every list a tuple: YAML and JSON know lists only, a description is immutable."""
    if isinstance(data, dict):
        return {key: with_tuples(value) for key, value in data.items()}
    return tuple(with_tuples(value) for value in data) if isinstance(data, list | tuple) else data
