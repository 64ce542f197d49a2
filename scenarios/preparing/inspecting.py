"""`railfmi inspect`: what a record or an FMU holds, as lines, as a table and, for a record, as pictures."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.signal import welch

from estimator.record import Array
from fmus.host.archive import describe, problems
from fmus.host.description import FmuDescription, FmuVariable
from scenarios.drawing.sheet import INK, NOISE, Plot, envelope, name_axes, sheet, sheets
from scenarios.drawing.typography import aligned, unit
from scenarios.output import writable, written_at_once
from scenarios.preparing.survey import Raster, survey
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_POWER = 0.99  # of a channel's variance lies below the frequency that is told
KINDS = ("input", "output", "parameter")  # of the variables that are listed
PANELS = 6  # channels on a sheet


class Inspected(Shown):
    """What a file holds."""


@dataclass(frozen=True, eq=False, repr=False)
class RecordInspected(Inspected):
    """The rasters of a record, and the pictures that were drawn of them."""

    rasters: tuple[Raster, ...]
    pictures: tuple[tuple[Path, ...], ...]

    def lines(self) -> list[str]:
        """Rates, remarks and channels of each raster."""
        found = list[str]()
        for raster, files in zip(self.rasters, self.pictures, strict=True):
            found += [*_of_raster(raster), *(f"picture: {file}" for file in files)]
        return found

    def to_frame(self) -> pd.DataFrame:
        """A row for each channel; noise is a standard deviation in the channel's unit, bandwidth in Hz."""
        rows = [
            {
                "channel": c.name, "unit": c.unit, "rate": 1 / r.step, "least": c.present.min(),
                "greatest": c.present.max(), "noise": c.noise, "bandwidth": bandwidth(c.x, r.step),
                "remarks": "; ".join(c.remarks),
            }
            for r in self.rasters
            for c in r.channels
        ]  # fmt: skip
        columns = ["channel", "unit", "rate", "least", "greatest", "noise", "bandwidth", "remarks"]
        return pd.DataFrame(rows, columns=columns).set_index("channel")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """All channels over time, one below the other, each from its least to its greatest value."""
        drawn = axes_or_new(ax)
        channels = [(r, c) for r in self.rasters for c in r.channels]
        for i, (r, c) in enumerate(channels):
            spread = float(np.ptp(c.present)) or 1.0
            drawn.plot(*envelope(r.t, (c.x - c.present.min()) / spread - 1.2 * i), linewidth=0.7)
        drawn.set_yticks([0.5 - 1.2 * i for i in range(len(channels))], [c.name for _, c in channels])
        drawn.set_xlabel("time in s")
        return drawn


@dataclass(frozen=True, eq=False, repr=False)
class FmuInspected(Inspected):
    """The variables of an FMU."""

    file: Path
    description: FmuDescription

    def lines(self) -> list[str]:
        """Its variables, and what it offers."""
        return [*_of_fmu(self.file, self.description)]

    def to_frame(self) -> pd.DataFrame:
        """A row for each input, output and parameter."""
        rows = [
            {
                "variable": v.name, "kind": _kind(v, self.description), "unit": v.unit, "start": v.start,
                "min": v.min, "max": v.max, "description": v.description,
            }
            for v in _shown(self.description)
        ]  # fmt: skip
        columns = ["variable", "kind", "unit", "start", "min", "max", "description"]
        return pd.DataFrame(rows, columns=columns).set_index("variable")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """How many variables of each kind it has."""
        drawn = axes_or_new(ax)
        count = self.to_frame()["kind"].value_counts()
        drawn.barh(list(count.index), list(count))
        drawn.set_xlabel("variables")
        return drawn


def inspect(file: str | Path, out: str | Path | None = None, time: str | None = None) -> Inspected:
    """What a file holds; out: folder for the pictures of a record, None draws none.

    time: the time column of a record, by default it is looked for.
    """
    path = Path(file)
    if path.suffix.lower() == ".fmu":
        return FmuInspected(path, describe(path))
    rasters = tuple(survey(path, time))
    if out is None:
        return RecordInspected(rasters, tuple(() for _ in rasters))
    folder = Path(out).absolute()
    plots = [list(_plots(r, f"_{i + 1}" if i else "")) if r.channels else [] for i, r in enumerate(rasters)]
    if any(plots):
        with written_at_once(writable(folder)) as part:
            for plot in chain.from_iterable(plots):
                plot.write(part)
    return RecordInspected(rasters, tuple(tuple(folder / f"{p.name}.png" for p in some) for some in plots))


def _of_raster(r: Raster) -> Iterator[str]:
    yield r.span
    for remark in (*r.remarks, *r.left_out):
        yield f"  {remark}"
    rows = [("channel", "unit", "least", "greatest", "noise", f"{MOST_POWER:.0%} of power below", "remarks")]
    for c in r.channels:
        x = c.present
        rows.append(
            (
                c.name,
                c.unit or "not stated",
                f"{x.min():.5g}",
                f"{x.max():.5g}",
                f"{c.noise:.2g}",
                f"{bandwidth(c.x, r.step):.3g} Hz",
                "; ".join(c.remarks),
            )
        )
    yield from aligned(rows)


def spectrum(x: Array, step: float) -> tuple[Array, Array]:
    """Frequencies, Hz, and power spectral density of a channel x (N,); lost samples are interpolated."""
    index = np.arange(x.size)
    there = np.isfinite(x)
    whole = np.interp(index, index[there], x[there])
    f, power = welch(whole, 1 / step, nperseg=min(x.size, 2048), detrend="constant")
    return np.asarray(f), np.asarray(power)


def bandwidth(x: Array, step: float) -> float:
    """Frequency, Hz, below which MOST_POWER of the variance of a channel x (N,) lies."""
    f, power = spectrum(x, step)
    whole = np.cumsum(power)
    return float(f[int(np.searchsorted(whole, MOST_POWER * whole[-1]))])


def _plots(r: Raster, ending: str) -> Iterator[Plot]:
    """Each channel over time, and its spectrum beside it."""
    for more, some in sheets(r.channels, PANELS):
        names = [c.name for c in some]
        layout = [[f"{i} t", f"{i} f"] for i in range(len(names))]
        figure, axes = sheet(0.4 + 1.35 * len(names), layout, width_ratios=[2.2, 1])
        for i, c in enumerate(some):
            axes[f"{i} t"].plot(*envelope(r.t, c.x), color=INK, linewidth=0.7)
            name_axes(axes[f"{i} t"], "", unit(c.unit), c.name)
            f, power = spectrum(c.x, r.step)
            axes[f"{i} f"].loglog(f[1:], np.sqrt(power[1:]) + 1e-300, color=NOISE, linewidth=0.8)
            name_axes(axes[f"{i} f"], "", f"{unit(c.unit) or '1'}/√Hz")
        axes[f"{len(names) - 1} t"].set_xlabel("time in s", fontsize=9)
        axes[f"{len(names) - 1} f"].set_xlabel("frequency in Hz", fontsize=9)
        yield Plot(f"record{ending}{more}", figure, f"The channels of {r.file.name} and their spectra.")


def _shown(d: FmuDescription) -> list[FmuVariable]:
    return [v for v in d.widened.variables.values() if v.causality in KINDS]


def _kind(v: FmuVariable, d: FmuDescription) -> str:
    return "state" if v.name in d.states else str(v.causality)


def _of_fmu(path: Path, d: FmuDescription) -> Iterator[str]:
    way = "co-simulation" if d.exchange is None else "model exchange, integrated by railfmi"
    yield f"{path.name}: {d.name}, FMI {d.fmi_version} for {way}"
    rows = [("variable", "kind", "unit", "start", "limits", "description")]
    for v in _shown(d):
        limits = f"{'' if v.min is None else f'{v.min:g}'} to {'' if v.max is None else f'{v.max:g}'}"
        start = "" if v.start is None else f"{v.start:g}"
        said = limits if limits != " to " else ""
        rows.append((v.name, _kind(v, d), v.unit or "not stated", start, said, v.description))
    yield from aligned(rows)
    if unused := d.widened.unused:
        yield f"not used, or by their elements only: {', '.join(unused)}"
    if whole := [v.name for v in _shown(d) if v.whole]:
        yield f"integers and Booleans, which are set and read but not estimated: {', '.join(whole)}"
    yield from _access(d)
    found = problems(path)
    if found:
        yield f"against the letter of the standard: {found[0]}" + (
            f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        )
    yield f"whether it can be used: railfmi check {path}"


def _access(d: FmuDescription) -> Iterator[str]:
    """What the description says of the ways to its states and of its steps."""
    if d.states:
        yield f"start values of {', '.join(d.states)} can be set; close-loop fits those that nobody declares"
    else:
        yield "no start value of a state can be set: a simulation begins at the FMU's own"
    if all(v.unit is None for v in d.variables.values()):
        yield "it states no units: an experiment has to say them with model_unit"
    yield "it saves and restores its state" if d.saves_state else "it does not save its state"
