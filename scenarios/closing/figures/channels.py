"""Measured inputs and outputs, and the residual before and after, over time and frequency."""

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter
from scipy.signal import welch

from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
from estimator.record import Array, Record
from scenarios.closing.page.glossary import Glossary
from scenarios.drawing.sheet import (
AFTER,
BEFORE,
CLOUD,
INK,
NOISE,
Plot,
envelope,
legend,
name_axes,
shade_test,
sheet,
sheets,
times,
)  # fmt: skip
from scenarios.drawing.typography import label, unit

FEW, FAR, MARGIN = 2e-3, 1.0, 0.15  # share of the samples; reach and margin as shares of that of the others
SEGMENTS = 8  # segments of the test part over which the spectrum is averaged
Series = list[tuple[str, Hypothesis, str]]


def series(found: Outcome, free: Hypothesis | None) -> Series:
    """The residuals to draw: name, hypothesis and colour; free: the force of free form, if any."""
    if found.chosen is None and free:
        return [("calibrated", found.base, BEFORE), ("with a force of free form", free, AFTER)]
    if found.chosen is None:
        good = found.judgement.verdict == "no_discrepancy"
        colour = AFTER if good else BEFORE
        return [("as declared", found.declared, CLOUD), ("calibrated", found.base, colour)]
    return [("before (calibrated)", found.base, BEFORE), ("after", found.chosen, AFTER)]


def record_plots(problem: Problem, words: Glossary) -> Iterator[Plot]:
    """Every output and input over time, with the test part shaded."""
    record = problem.record
    channels = [(n, False, j) for j, n in enumerate(record.outputs)]
    channels += [(n, True, j) for j, n in enumerate(record.inputs)]
    for ending, some in sheets(channels, 6):
        figure, axes = sheet(0.4 + 1.05 * len(some), [[n] for n, _, _ in some], sharex=True)
        for name, is_input, j in some:
            for t, run in zip(times(record), record.runs, strict=True):
                x = (run.u if is_input else run.y)[:, j]
                axes[name].plot(*envelope(t, x), color=NOISE if is_input else INK, linewidth=0.7)
            shade_test(axes[name], record)
            name_axes(axes[name], "", unit(words.unit(name)), f"{name} ({'input' if is_input else 'output'})")
        axes[some[-1][0]].set_xlabel(time_label(record), fontsize=9)
        yield Plot(
            f"record{ending}",
            figure,
            "Inputs and outputs. Shaded: the test part, used neither for fitting nor for choosing.",
        )


def residual_plots(
    problem: Problem, found: Outcome, words: Glossary, free: Hypothesis | None
) -> Iterator[Plot]:
    """Residual of each output over time; if something was added, also at the scale of the noise."""
    record, shown = problem.record, series(found, free)
    zoom = found.chosen is not None or free is not None
    for ending, some in sheets(record.outputs, 1 if zoom else 3):
        layout = [[f"{n}{z}"] for n in some for z in ("", "+")[: 1 + zoom]]
        heights = [h for _ in some for h in (1.6, 1.0)[: 1 + zoom]]
        figure, axes = sheet(0.8 + 1.15 * sum(heights), layout, sharex=True, height_ratios=heights)
        for name in some:
            j = record.outputs.index(name)
            draw_residual(axes[name], record, shown, j, found.noise[j])
            name_axes(axes[name], "", label("residual", words.unit(name)), name)
            if zoom:
                draw_residual(axes[f"{name}+"], record, shown[1:], j, found.noise[j])
                name_axes(axes[f"{name}+"], "", "after, enlarged")
        legend(figure, axes[some[0]])
        axes[layout[-1][0]].set_xlabel(time_label(record), fontsize=9)
        yield Plot(f"residual_time{ending}", figure, _residual_caption(zoom))


def _residual_caption(zoom: bool) -> str:
    text = "Residual: measured minus simulated output in free simulation. Shaded: the test part."
    more = " The lower panels show the residual after, at the scale of the noise." if zoom else ""
    return f"{text}{more} Dashed: ± 2 standard deviations of the noise."


def draw_residual(ax: Axes, record: Record, shown: Series, j: int, noise: float) -> None:
    """Residuals of output j over time, with two standard deviations of its noise."""
    shade_test(ax, record)
    for name, h, colour in shown:
        for i, (t, r) in enumerate(zip(times(record), h.residuals, strict=True)):
            text = name if i == 0 else None
            ax.plot(*envelope(t, r[:, j]), color=colour, linewidth=0.7, label=text)
    for level in (-2 * noise, 2 * noise):
        ax.axhline(level, color=INK, linewidth=0.6, linestyle=(0, (4, 3)))
    _leave_out_single_samples(ax, np.concatenate([r[:, j] for _, h, _ in shown for r in h.residuals]))


def _leave_out_single_samples(ax: Axes, values: Array) -> None:
    """Cut an axis where a few samples (n,) would squeeze all others together, and say how far they reach."""
    values = values[np.isfinite(values)]
    least, low, high, most = (float(v) for v in np.quantile(values, [0.0, FEW, 1 - FEW, 1.0]))
    below, above = low - least > FAR * (high - low), most - high > FAR * (high - low)
    if not (below or above):
        return
    margin = MARGIN * (high - low)
    ax.set_ylim((low if below else least) - margin, (high if above else most) + margin)
    for cut, end, y, edge in ((below, least, 0.03, "bottom"), (above, most, 0.97, "top")):
        if cut:
            ax.text(
                0.99, y, f"single samples reach {end:.2g}", ha="right", va=edge, transform=ax.transAxes,
                fontsize=7, color=NOISE,
            )  # fmt: skip


def spectrum_plots(
    problem: Problem, found: Outcome, words: Glossary, free: Hypothesis | None
) -> Iterator[Plot]:
    """Amplitude spectral density of each residual on the test part, with the level of the noise."""
    for ending, some in sheets(problem.record.outputs, 6):
        rows = [some[i : i + 2] for i in range(0, len(some), 2)]
        layout = [row if len(row) == 2 or len(rows) == 1 else [*row, "."] for row in rows]
        figure, axes = sheet(0.5 + 2.2 * len(rows), layout)
        for name in some:
            j = problem.record.outputs.index(name)
            _spectrum(axes[name], problem, series(found, free), j, found.noise[j])
            density = f"{unit(words.unit(name)) or '1'} per √Hz"
            name_axes(axes[name], "frequency in Hz", f"density in {density}", name)
        legend(figure, axes[some[0]])
        yield Plot(f"residual_spectrum{ending}", figure, SPECTRUM)


SPECTRUM = (
    "Amplitude spectral density of the residual on the test part (Welch's method). "
    "Dashed: the level of the noise alone."
)


def _spectrum(ax: Axes, problem: Problem, shown: Series, j: int, noise: float) -> None:
    k = int(np.argmax([run.test.sum() for run in problem.record.runs]))
    run = problem.record.runs[k]
    rate = 1 / run.sample
    for name, h, colour in shown:
        f, density = _density(h.residuals[k][run.test, j], rate)
        ax.loglog(f, density, color=colour, linewidth=1.1, label=name)
    level = noise * np.sqrt(2 / rate)
    ax.axhline(level, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), label="noise")
    low, high = np.log10(ax.get_ylim())
    ax.set_ylim(10 ** np.floor(low), 10 ** np.ceil(high))
    ax.yaxis.set_minor_formatter(NullFormatter())


def _density(x: Array, rate: float) -> tuple[Array, Array]:
    """Frequencies between zero and the Nyquist frequency, and the density of x (N,) at `rate` Hz.

    Both ends of the frequency range are left out.
    """
    f, power = welch(x, rate, nperseg=max(min(len(x), 64), 2 * len(x) // SEGMENTS))
    return f[1:-1], np.sqrt(power[1:-1])


def time_label(record: Record) -> str:
    """The label of a record's time axis."""
    again = any(b.t[0] <= a.t[-1] for a, b in zip(record.runs, record.runs[1:], strict=False))
    return "time in s (test file drawn after the first)" if again else "time in s"
