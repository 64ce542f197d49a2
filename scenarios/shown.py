"""What every result offers in Python and in a notebook."""

from abc import ABC, abstractmethod
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


class Shown(ABC):
    """A result that tells itself in lines, as a table, and as a plot."""

    @abstractmethod
    def lines(self) -> list[str]:
        """What the command prints, the answer first."""

    @abstractmethod
    def to_frame(self) -> "pd.DataFrame":
        """The main numbers as a table."""

    @abstractmethod
    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """The main numbers drawn into axes, by default into new ones."""

    def __repr__(self) -> str:
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        first, *more = self.lines() or [""]
        rest = "".join(f"<br>{escape(line.strip())}" for line in more)
        return f"<p><b>{escape(first)}</b>{rest}</p>{self.to_frame().to_html(float_format='{:.4g}'.format)}"


def axes_or_new(ax: "Axes | None") -> "Axes":
    """The axes, or those of a new figure."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]
