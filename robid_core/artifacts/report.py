"""A page for people, and the truth that only the page may see."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Self

from robid_core.arrays import FloatArray
from robid_core.artifacts.artifact import Artifact, array
from robid_core.errors import StoreError


@dataclass(frozen=True, eq=False)
class Report(Artifact):
    """One self-contained HTML page."""

    suffix: ClassVar[str] = ".html"

    html: str

    def __post_init__(self) -> None:
        """Raise TypeError or ValueError for what is no page."""
        if not isinstance(self.html, str):
            raise TypeError(f"Report.html is a text, not {type(self.html).__name__}")
        if not self.html:
            raise ValueError("Report.html is empty: a page has something to show")

    def write(self, path: Path | str) -> None:
        """Write the page itself.

        >>> import pathlib, tempfile, robid_core as robid
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "page.html"
        >>> robid.Report("<p>stiff</p>").write(path)
        >>> path.read_text()
        '<p>stiff</p>'
        """
        Path(path).write_text(self.html, encoding="utf-8")

    @classmethod
    def read(cls, path: Path | str) -> Self:
        """Read the page back; StoreError where it cannot be read, is empty, or is no text.

        >>> import pathlib, tempfile, robid_core as robid
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "page.html"
        >>> robid.Report("<p>stiff</p>").write(path)
        >>> robid.Report.read(path).html
        '<p>stiff</p>'
        """
        try:
            text = Path(path).read_text(encoding="utf-8")
            if not text:
                raise StoreError(f"{path}: empty; robid run makes it again")
            return cls(html=text)
        except UnicodeDecodeError as error:
            raise StoreError(
                f"{path}: damaged at byte {error.start}, where no text is; robid run makes it again"
            ) from error
        except OSError as error:
            raise StoreError(f"{path}: cannot be read: {error.strerror or error}") from error


@dataclass(frozen=True, eq=False)
class Truth(Artifact):
    """The parameters of a simulated plant, handed to the report after the run and to no other stage."""

    plant: str
    names: tuple[str, ...]
    value: FloatArray = array("n_parameter")

    def as_mapping(self) -> dict[str, float]:
        """Return the true values by name.

        >>> import numpy as np, robid_core as robid
        >>> robid.Truth("one_axis_true", ("gear_stiffness.axis_1",), np.array([6e4])).as_mapping()
        {'gear_stiffness.axis_1': 60000.0}
        """
        return dict(zip(self.names, self.value.tolist(), strict=True))
