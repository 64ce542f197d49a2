"""The result of campaign, as it is written to result.json beside the tables."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from scenarios.campaign.indices import Index
from scenarios.campaign.policy import POLICY
from scenarios.shown import axes_or_new
from scenarios.tasks.result import TasksResult
from scenarios.tasks.store import FAILED

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMED = 10  # failures that are told on the command line
QUANTILES = (POLICY.lowest, 0.5, 1 - POLICY.lowest)


@dataclass(frozen=True)
class Measured:
    """A measure over all points: how many gave a number, least, greatest, mean, standard deviation,
    quantiles.

    quantiles: at 5, 50 and 95 %; all are None where no point gave a number. With Sobol's points they are
    those of the independent base points.
    """

    measure: str
    points: int
    least: float | None
    greatest: float | None
    mean: float | None
    std: float | None
    quantiles: tuple[float | None, ...]


@dataclass(frozen=True, repr=False)
class CampaignResult(TasksResult):
    """The result of a campaign; each field is a key of result.json.

    tasks: how many points are `planned`, `finished`, `failed` (answered with a reason) and `left` (not done,
    with a reason that may pass). indices: see Index; empty unless Sobol's points were sampled. limits: by
    which they were found, by name.
    """

    campaign: str
    sample: str
    points: int
    varied: list[str]
    measured: list[Measured]
    indices: list[Index]
    failed: list[dict[str, Any]]
    limits: dict[str, float] = field(default_factory=lambda: POLICY.values)

    @property
    def headline(self) -> str:
        """What was done, in one sentence."""
        failed = self.tasks["failed"]
        kind = self.sample.replace("-", " ").replace("sobol", "Sobol's points")
        return (
            f"{self.campaign}: {self.points} points ({kind}) over {len(self.varied)} keys, "
            f"{failed or 'none'} without an answer"
        )

    def lines(self) -> list[str]:
        """See Shown.lines."""
        said = [self.headline]
        for m in self.measured:
            if m.mean is None or m.std is None:
                said.append(f"{m.measure}: no point gave a number")
                continue
            low, middle, high = m.quantiles
            said.append(
                f"{m.measure}: median {middle:.4g}, 90 % of the points between {low:.4g} and {high:.4g}, "
                f"mean {m.mean:.4g}, standard deviation {m.std:.3g}"
            )
            said += [f"  {index_words(i)}" for i in self.indices if i.measure == m.measure]
        return said + [f"  point {f['point']}: {f['reason']}" for f in self.failed[:NAMED]]

    def to_frame(self) -> pd.DataFrame:
        """The indices, a row each; the measures where there are none."""
        return pd.DataFrame([asdict(x) for x in (self.indices or self.measured)])

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Total indices of the first measure, with their intervals."""
        drawn = axes_or_new(ax)
        some = [i for i in self.indices if i.measure == self.indices[0].measure]
        low, high = ([abs(i.total - x) for i, x in zip(some, xs, strict=True)] for xs in _ends(some))
        drawn.barh([i.key for i in some], [i.total for i in some], xerr=[low, high])
        drawn.set(xlabel="total index", title=self.campaign)
        return drawn


def _ends(some: Sequence[Index]) -> tuple[list[float], list[float]]:
    return [i.total_low for i in some], [i.total_high for i in some]


def index_words(i: Index) -> str:
    """The indices of a key, in words."""
    return (
        f"{i.key}: {_share(i.first, i.first_low, i.first_high)} of the variance alone, "
        f"{_share(i.total, i.total_low, i.total_high)} with all others"
    )


def _share(value: float, low: float, high: float) -> str:
    return f"{value:.2f} ({low:.2f} to {high:.2f})"


def measured(name: str, values: Sequence[float | None]) -> Measured:
    """A measure over points; values: None where a point gave no number."""
    found = np.array([v for v in values if v is not None], dtype=np.float64)
    if not len(found):
        return Measured(name, 0, None, None, None, None, (None,) * len(QUANTILES))
    return Measured(
        name, len(found), float(found.min()), float(found.max()), float(found.mean()),
        float(found.std(ddof=1)) if len(found) > 1 else 0.0,
        tuple(float(q) for q in np.quantile(found, QUANTILES)),
    )  # fmt: skip


def failures_of(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The points without an answer, with the reason."""
    return [{n: row[n] for n in ("point", "reason")} for row in rows if row["verdict"] == FAILED]
