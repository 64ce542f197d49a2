"""Measured against simulated outputs over time, before and after: as pictures, and as a chart to zoom."""

from collections.abc import Iterator

import numpy as np
from markupsafe import Markup

from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
from estimator.record import Array
from scenarios.closing.figures.channels import series, time_label
from scenarios.closing.page.glossary import Glossary
from scenarios.drawing.chart.chart import Line, Panel, chart
from scenarios.drawing.sheet import (
    CLOUD,
    Plot,
    envelope,
    legend,
    name_axes,
    shade_test,
    sheet,
    sheets,
    times,
)
from scenarios.drawing.typography import unit

FIRST = 3  # outputs beside the headline, those with the largest error over noise
COLOURS = ("--before", "--after")  # of the style sheet
CAPTION = (
    "Measured and simulated outputs over time. The simulation runs freely from the start of the record; no "
    "measured output is fed back. Shaded: the test part, used neither for fitting nor for choosing."
)


def by_error(problem: Problem, found: Outcome) -> list[str]:
    """The outputs, the one with the largest error over noise before first."""
    worst = np.argsort(-found.base.rms(problem, "test") / found.noise, kind="stable")
    return [problem.record.outputs[j] for j in worst]


def simulation_plots(
    problem: Problem, found: Outcome, words: Glossary, free: Hypothesis | None
) -> Iterator[Plot]:
    """A picture for each sheet of outputs."""
    record = problem.record
    for ending, some in sheets(by_error(problem, found), FIRST):
        figure, axes = sheet(0.7 + 1.75 * len(some), [[name] for name in some], sharex=True)
        for name in some:
            j, ax = record.outputs.index(name), axes[name]
            shade_test(ax, record)
            for i, (t, run) in enumerate(zip(times(record), record.runs, strict=True)):
                ax.plot(
                    *envelope(t, run.y[:, j]), color=CLOUD, linewidth=2.4, label=None if i else "measured"
                )
                for says, h, colour in series(found, free):
                    simulated = run.y[:, j] - h.residuals[i][:, j]
                    ax.plot(*envelope(t, simulated), color=colour, linewidth=0.8, label=None if i else says)
            name_axes(ax, "", unit(words.unit(name)), name)
        legend(figure, axes[some[0]])
        axes[some[-1]].set_xlabel(time_label(record), fontsize=9)
        yield Plot(f"simulated{ending}", figure, CAPTION)


def simulation_chart(problem: Problem, found: Outcome, words: Glossary, free: Hypothesis | None) -> Markup:
    """The same lines for a chart, for the outputs of the first picture."""
    record, at = problem.record, times(problem.record)
    t = np.concatenate(at)
    order = np.argsort(t, kind="stable")

    def line(parts: list[Array]) -> Array:
        return np.concatenate(parts)[order]

    panels = []
    for name in by_error(problem, found)[:FIRST]:
        j = record.outputs.index(name)
        lines = [Line("measured", line([run.y[:, j] for run in record.runs]), "--measured", 2.5)]
        for (says, h, _), colour in zip(series(found, free), COLOURS, strict=True):
            simulated = [run.y[:, j] - r[:, j] for run, r in zip(record.runs, h.residuals, strict=True)]
            lines.append(Line(says, line(simulated), colour))
        of = unit(words.unit(name))
        panels.append(Panel(f"{name}, {of}" if of else name, t[order], lines))
    shaded = [
        (float(s[r.test][0]), float(s[r.test][-1]))
        for s, r in zip(at, record.runs, strict=True)
        if r.test.any()
    ]
    return chart(panels, shaded, time_label(record))
