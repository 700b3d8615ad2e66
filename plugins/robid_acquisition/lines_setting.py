"""The setting `lines`: numbers of periods, and no frequencies."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, NonNegativeInt


def _no_frequencies(value: Any) -> Any:
    """Refuse numbers that are not whole in words that say what lines are."""
    numbers = [one for one in value if isinstance(one, float)] if isinstance(value, list | tuple) else []
    wrong = next((number for number in numbers if not number.is_integer()), None)
    if wrong is not None:
        raise ValueError(
            f"{wrong:g} is no whole number: lines count the periods of a sine in period_s; is it in Hz? Then times "
            "period_s is meant, and lines: auto finds them"
        )
    return tuple(value) if isinstance(value, list) else value


Lines = Annotated[tuple[NonNegativeInt, ...] | Literal["auto"], BeforeValidator(_no_frequencies)]
