"""Arrays and mappings that nobody can change any more: what artifacts hold.

numpy marks an array read-only, not its memory: whoever has another view of it, the array that it is a view of
included, goes on writing. An array is frozen where no array between it and its memory can be written.
"""

from __future__ import annotations

from typing import Any, NoReturn, TypeVar

import numpy as np
import numpy.typing as npt

AnyArray = TypeVar("AnyArray", bound=npt.NDArray[Any])
Key = TypeVar("Key")
Value = TypeVar("Value")


def frozen(values: AnyArray) -> AnyArray:
    """Return the same array, read-only, and with it every array that it is a view of.

    For whoever makes a big array and gives it away: an artifact takes a frozen array as it is, and copies any other. A
    writeable view that was made before stays writeable; who freezes an array has none.

    >>> import numpy as np, robid_core as robid
    >>> robid.frozen(np.zeros(3)).flags.writeable
    False
    """
    owner: Any = values
    while isinstance(owner, np.ndarray):
        owner.flags.writeable = False
        owner = owner.base
    return values


def is_frozen(values: npt.NDArray[Any]) -> bool:
    """Tell whether neither the array nor one that it is a view of can be written."""
    owner: Any = values
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable:
            return False
        owner = owner.base
    return owner is None or isinstance(owner, bytes)


def kept(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the values frozen, copied where somebody else may write them, in an array that stays read-only.

    It is a view of a frozen array, which numpy does not let become writeable again; of a subclass its numbers stay.
    """
    if not is_frozen(values):
        values = frozen(np.array(values, order="K"))
    return np.asarray(values).view()


class FrozenDict(dict[Key, Value]):
    """A mapping that is not changed; `dict(mapping)` and `mapping | changes` are changeable copies."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError(
            "an artifact's mapping is read-only; replace it: artifact.replace(name=mapping | {...})"
        )

    __setitem__ = __delitem__ = __ior__ = clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle and copy as what it is made of: a dict is otherwise filled entry by entry."""
        return FrozenDict, (dict(self),)
