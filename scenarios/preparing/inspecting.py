"""`railfmi inspect`: what a record or an FMU holds, as lines and, for a record, a picture."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.signal import welch

from estimator.record import Array
from fmus.host.archive import describe, problems
from fmus.host.description import FmuDescription
from scenarios.drawing.sheet import INK, NOISE, Plot, envelope, name_axes, sheet, sheets
from scenarios.drawing.typography import aligned, unit
from scenarios.output import writable, written_at_once
from scenarios.preparing.survey import Raster, survey

MOST_POWER = 0.99  # of a channel's variance lies below the frequency that is told
KINDS = ("input", "output", "parameter")  # of the variables that are listed
PANELS = 6  # channels on a sheet


def inspect(file: str | Path, out: str | Path | None = None, time: str | None = None) -> list[str]:
    """What a file holds, as lines; out: folder for the pictures of a record, None draws none.

    time: the time column of a record, by default it is looked for.
    """
    path = Path(file)
    if path.suffix.lower() == ".fmu":
        return [*_of_fmu(path)]
    lines, plots = list[str](), list[Plot]()
    folder = None if out is None else Path(out).absolute()
    for i, raster in enumerate(survey(path, time)):
        lines += [*_of_raster(raster)]
        if folder is not None and raster.channels:
            more = list(_plots(raster, f"_{i + 1}" if i else ""))
            lines += [f"picture: {folder / plot.name}.png" for plot in more]
            plots += more
    if folder is not None and plots:
        with written_at_once(writable(folder)) as part:
            for plot in plots:
                plot.write(part)
    return lines


def _of_raster(r: Raster) -> Iterator[str]:
    rate = 1 / r.step
    yield (
        f"{r.file.name}: {r.t.size} rows from {r.t[0]:.9g} to {r.t[-1]:.9g} s, {rate:.6g} Hz, time in column "
        f"'{r.time}'"
    )
    for remark in r.remarks:
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


def _of_fmu(path: Path) -> Iterator[str]:
    about = describe(path)
    d = about.widened
    way = "co-simulation" if d.exchange is None else "model exchange, integrated by railfmi"
    yield f"{path.name}: {d.name}, FMI {d.fmi_version} for {way}"
    rows = [("variable", "kind", "unit", "start", "limits", "description")]
    for v in d.variables.values():
        if v.causality in KINDS:
            limits = f"{'' if v.min is None else f'{v.min:g}'} to {'' if v.max is None else f'{v.max:g}'}"
            rows.append(
                (
                    v.name,
                    "state" if v.name in d.states else v.causality,
                    v.unit or "not stated",
                    "" if v.start is None else f"{v.start:g}",
                    limits if limits != " to " else "",
                    v.description,
                )
            )
    yield from aligned(rows)
    if d.unused:
        yield f"not used, or by their elements only: {', '.join(d.unused)}"
    if whole := [v.name for v in d.variables.values() if v.whole and v.causality in KINDS]:
        yield f"whole numbers and truths, which are set and read but not estimated: {', '.join(whole)}"
    yield from _access(about)
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
