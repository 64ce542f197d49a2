"""The main finding in one small figure: residual before and after, and the law found."""

import numpy as np

from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
from scenarios.closing.figures.channels import draw_residual, series, time_label
from scenarios.closing.figures.forces import draw_law, laws_found
from scenarios.closing.page.glossary import Glossary
from scenarios.drawing.sheet import (
    Plot,
    legend,
    name_axes,
    sheet,
)
from scenarios.drawing.typography import label


def headline_plot(problem: Problem, found: Outcome, words: Glossary, free: Hypothesis | None) -> Plot:
    """Residual of the output with the largest error over noise, and the first law found, if any."""
    j = int(np.argmax(found.base.rms(problem, "test") / found.noise))
    name, laws = problem.record.outputs[j], laws_found(found)
    ratios = [1.35, 1] if laws else [1]
    figure, axes = sheet(2.7, [["residual", "law"][: len(ratios)]], width_ratios=ratios)
    draw_residual(axes["residual"], problem.record, series(found, free), j, found.noise[j])
    name_axes(axes["residual"], time_label(problem.record), label("residual", words.unit(name)), name)
    legend(figure, axes["residual"])
    caption = f"Residual of {name} in free simulation; the test part is shaded."
    if laws:
        port = laws[0].missing.port.name
        draw_law(axes["law"], laws[0], words)
        axes["law"].set_title(f"missing at {port}", loc="left", fontsize=9, fontweight="bold")
        caption += f" Second panel: the missing force at the port “{port}” (dots) and the law found (line)."
    return Plot("headline", figure, caption)
