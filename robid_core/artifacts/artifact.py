"""The base of everything that is measured or computed: immutable, with named axes and units, one file each.

A subclass is a frozen dataclass. Each field is an array declared with `array(...)` (its axes and unit are
written into the file beside it), a plain value (`str`, `int`, `float`, `bool`, tuples of strings), a nested
artifact, a tuple or dict of nested artifacts, or None. An array that somebody may still write is copied
(`freezing.py`). Files are HDF5, open to MATLAB and Julia; nothing is pickled.
"""

from __future__ import annotations

import dataclasses
import typing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from robid_core.artifacts.freezing import FrozenDict, kept
from robid_core.errors import DataRejected


def array(
    axes: str,
    unit: str = "",
    *,
    optional: bool = False,
    finite: bool = True,
    keyword: bool = False,
    known: bool = False,
    rising: bool = False,
    covariance: bool = False,
    least: float | None = None,
) -> Any:
    """Declare an array field: its axes as words (`"n_config n_freq n_out n_in"`), its unit, and what it may hold.

    Axes with the same name must have the same length within one artifact. `finite=False` allows NaN (a value
    that does not exist, such as the standard error of a parameter that is fixed). What a result must be to be stored
    (`soundness.py`): `known`, not all of it NaN; `rising` along its axis; `covariance`, matrices that are symmetric and
    not negative; `least`, what no value is below.

    >>> from dataclasses import dataclass
    >>> import numpy as np, robid_core as robid
    >>> @dataclass(frozen=True, eq=False)
    ... class Wear(robid.Artifact):
    ...     depth: robid.FloatArray = robid.array("n_axis", "m")
    >>> Wear(np.array([1e-6, 2e-6])), Wear.unit("depth")
    (<Wear n_axis 2>, 'm')
    """
    metadata = {
        "axes": tuple(axes.split()),
        "unit": unit,
        "finite": finite,
        "known": known,
        "rising": rising,
        "covariance": covariance,
        "least": least,
    }
    if optional:
        return field(default=None, metadata=metadata, kw_only=keyword)
    return field(metadata=metadata, kw_only=keyword)


@dataclass(frozen=True, eq=False)
class Artifact:
    """An immutable measurement or result; equal content gives equal bytes on disk."""

    suffix: ClassVar[str] = ".h5"

    def __init_subclass__(cls, **given: Any) -> None:
        """Keep the short text of an artifact in every kind: `dataclass` writes one with all numbers where none is."""
        super().__init_subclass__(**given)
        if "__repr__" not in vars(cls):
            cls.__repr__ = Artifact.__repr__  # type: ignore[method-assign]

    def __post_init__(self) -> None:
        """Freeze the arrays and check axes, types and finiteness."""
        lengths: dict[str, int] = {}
        for item in dataclasses.fields(self):
            if "axes" not in item.metadata:
                continue
            value = getattr(self, item.name)
            if value is None:
                continue
            if not isinstance(value, np.ndarray):
                raise DataRejected(f"{self.place(item.name)}: an array is wanted, not {type(value).__name__}")
            if np.ma.is_masked(value):
                raise DataRejected(
                    f"{self.place(item.name)}: {int(np.ma.getmaskarray(value).sum())} values are masked, which no file "
                    "keeps; fill them with what they are (values.filled)"
                )
            self._check_array(item.name, np.asarray(value), item.metadata, lengths)
        self.__setstate__(vars(self).copy())

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take over fields, arrays and mappings frozen; pickle and copy come here and not to `__post_init__`."""
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                value = kept(value)
            elif isinstance(value, dict):
                value = FrozenDict(value)
            object.__setattr__(self, name, value)

    def _check_array(
        self, name: str, value: npt.NDArray[Any], metadata: typing.Mapping[str, Any], lengths: dict[str, int]
    ) -> None:
        axes = metadata["axes"]
        if value.ndim != len(axes):
            raise DataRejected(
                f"{self.place(name)}: shape {value.shape} does not have the axes ({', '.join(axes)})"
            )
        for axis, length in zip(axes, value.shape, strict=True):
            if lengths.setdefault(axis, length) != length:
                raise DataRejected(
                    f"{self.place(name)}: axis {axis} has length {length}, elsewhere in this artifact it has "
                    f"{lengths[axis]}"
                )
        if metadata["finite"] and value.dtype.kind in "fc" and not np.isfinite(value).all():
            first = tuple(int(i) for i in np.argwhere(~np.isfinite(value))[0])
            count = int((~np.isfinite(value)).sum())
            raise DataRejected(
                f"{self.place(name)}: {count} values are NaN or infinite, the first at "
                + ", ".join(f"{a}={i}" for a, i in zip(axes, first, strict=True))
            )

    @classmethod
    def place(cls, name: str) -> str:
        """Name a field for messages.

        >>> import robid_core as robid
        >>> robid.Frf.place("response")
        'Frf.response'
        """
        return f"{cls.__name__}.{name}"

    @classmethod
    def axes(cls, name: str) -> tuple[str, ...]:
        """Return the axis names of an array field.

        >>> import robid_core as robid
        >>> robid.Frf.axes("response")
        ('n_config', 'n_freq', 'n_out', 'n_in')
        """
        return tuple(cls._field(name).metadata["axes"])

    @classmethod
    def unit(cls, name: str) -> str:
        """Return the unit of an array field, in SI symbols.

        >>> import robid_core as robid
        >>> robid.Frf.unit("response")
        '(rad/s^2)/(N m)'
        """
        return str(cls._field(name).metadata["unit"])

    @classmethod
    def _field(cls, name: str) -> dataclasses.Field[Any]:
        return next(item for item in dataclasses.fields(cls) if item.name == name)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some fields changed.

        >>> import numpy as np, robid_core as robid
        >>> where = robid.Configurations(("axis_1",), np.array([[0.5], [1.0]]))
        >>> where.replace(axis_names=("hip",)).table()
        {'configuration': [0, 1], 'hip': [0.5, 1.0]}
        """
        return dataclasses.replace(self, **changes)

    def select(self, axis: str, index: Any) -> Self:
        """Return a copy with only some entries along a named axis (`index`: a mask, slice or integer array).

        >>> import numpy as np, robid_core as robid
        >>> where = robid.Configurations(("axis_1",), np.array([[0.5], [1.0], [1.5]]))
        >>> where.select("n_config", [0, 2]).angle.tolist()
        [[0.5], [1.5]]
        """
        changes = {}
        for item in dataclasses.fields(self):
            value = getattr(self, item.name)
            if value is not None and axis in item.metadata.get("axes", ()):
                where = [slice(None)] * value.ndim
                where[item.metadata["axes"].index(axis)] = index
                changes[item.name] = value[tuple(where)]
        return self.replace(**changes)

    def write(self, path: Path | str) -> None:
        """Write the artifact to `path` (created or overwritten); equal content gives equal bytes.

        >>> import pathlib, tempfile, numpy as np, robid_core as robid
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "where.h5"
        >>> robid.Configurations(("axis_1",), np.zeros((4, 1))).write(path)
        >>> robid.Configurations.read(path).n_config
        4
        """
        from robid_core.artifacts.hdf5 import write_hdf5

        write_hdf5(self, Path(path))

    @classmethod
    def read(cls, path: Path | str) -> Self:
        """Read an artifact of this class (or of a subclass that the file names) from `path`.

        >>> import pathlib, tempfile, robid_core as robid
        >>> from robid_core.testing import example_frf
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "frf.h5"
        >>> example_frf(robid.Robot.load("one_axis")).write(path)
        >>> robid.Frf.read(path).axis_names
        ('axis_1',)
        """
        from robid_core.artifacts.hdf5 import read_hdf5

        artifact = read_hdf5(Path(path))
        if not isinstance(artifact, cls):
            raise DataRejected(f"{path}: holds a {type(artifact).__name__}, not a {cls.__name__}")
        return artifact

    def __repr__(self) -> str:
        """Return its class and a sentence, on one line."""
        from robid_core.artifacts.summary import summary

        return f"<{type(self).__name__} {' '.join(summary(self).split())}>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows of it."""
        from robid_core.artifacts.display import artifact_html

        return artifact_html(self)
