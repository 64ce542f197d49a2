"""The force of free form that comes nearest to the record when no law explains it."""

import numpy as np

from estimator.closeloop.hypotheses.hypothesis import Hypothesis
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.screening.missing_force import MissingForce
from estimator.closeloop.search.free_form import curve_of
from estimator.record import Array
from scenarios.closing.figures.forces import averages
from scenarios.closing.page.glossary import Glossary
from scenarios.drawing.sheet import (
    AFTER,
    CLOUD,
    LAW,
    Plot,
    legend,
    name_axes,
    sheet,
)
from scenarios.drawing.typography import label

CAPTION = (
    "Force of free form at the port “{port}” over the {against} of the port (line; band: two standard "
    "errors). It was fitted inside the FMU. The dots are the force inferred from the residual without "
    "assuming a law. The curve does not identify a cause."
)


def free_form_plot(found: Outcome, h: Hypothesis, words: Glossary) -> Plot:
    """The curve with its band, and the missing force at its port."""
    curve = curve_of(h)
    figure, axes = sheet(2.9, [["curve"]])
    ax = axes["curve"]
    for m in found.forces:
        if m.port.name == curve.location:
            x = _over(m, curve.against, float(curve.x[-1]))
            inside = (x >= curve.x[0]) & (x <= curve.x[-1])
            ax.plot(x[inside], m.force[inside], ".", color=CLOUD, markersize=1.5, alpha=0.5, rasterized=True)
            ax.plot(
                *averages(x[inside], m.force[inside]), "o", color=AFTER, markersize=3, label="missing force"
            )
            over = m.port.velocity if curve.against == "velocity" else m.port.motion[0]
            x_label, y_label = label(over, words.unit(over)), label("force", words.unit(m.port.force))
            name_axes(ax, x_label, y_label, m.port.name)
    ax.fill_between(
        curve.x, curve.force - 2 * curve.std, curve.force + 2 * curve.std, color=LAW, alpha=0.2, linewidth=0
    )
    ax.plot(curve.x, curve.force, color=LAW, linewidth=2.0, label="force of free form")
    legend(figure, ax)
    return Plot("free_form", figure, CAPTION.format(port=curve.location, against=curve.against))


def _over(m: MissingForce, against: str, period: float) -> Array:
    """The quantity on a curve's horizontal axis along the motion at a port (n,); angles in one period."""
    if against == "velocity":
        return m.velocity
    return np.mod(m.displacement, period) if against == "angle" else m.displacement
