"""How long the fits of a search will take, from the cost of one simulation."""

from collections.abc import Sequence
from math import ceil
from time import monotonic

from estimator.closeloop.fitting.fitter import BRIEF, LONG, Fitter
from estimator.closeloop.hypotheses.promise import Promise

WORTH_SAYING = 120.0  # s


def duration_said(fitter: Fitter, promises: Sequence[Promise]) -> str:
    """The end of a progress line: how long the fits of promises may take; empty where that is short."""
    expected = simulations(fitter, promises) * _one_simulation(fitter) / fitter.jobs
    if expected < WORTH_SAYING:
        return ""
    return f"; the fits take up to about {expected / 60:.0f} min if one effect explains the record"


def simulations(fitter: Fitter, promises: Sequence[Promise]) -> int:
    """Largest number of simulations of the brief fits of promises and of the full fits of the best ones.

    An evaluation simulates once for the residual and once for the slope by each unknown, as many at once as
    the FMU can; a brief fit takes the slopes by the calibrated unknowns as they were.
    """
    at_once = fitter.baseline.problem.at_once
    own = [sum(len(c.unknowns) for c in p.candidates) for p in promises]
    calibrated = len(fitter.baseline.hypothesis.fit.unknowns)
    brief = sum(BRIEF * ceil((1 + n) / at_once) for n in own)
    full = sorted((LONG * ceil((1 + n + calibrated) / at_once) for n in own), reverse=True)
    return brief + sum(full[: fitter.baseline.policy.search.finalists])


def _one_simulation(fitter: Fitter) -> float:
    """Wall time of a simulation of the record by the calibrated FMU, s."""
    fitter.baseline.problem.forget()
    begun = monotonic()
    fitter.baseline.problem.simulate(fitter.baseline.hypothesis.fit.theta)
    return monotonic() - begun
