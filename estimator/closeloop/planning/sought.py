"""The effects and sensor faults that a planned record could hold, with shapes that its inputs suggest.

The shapes of close-loop's candidates (frequencies, onset times, gaps) come from the force that a record shows
to be missing. Before a record there is none. A force is assumed in its place that has one of each: a step in
the middle of the record, a line over time, and a line over the displacement.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.candidates import fault_candidates, physical_candidates
from estimator.closeloop.screening.missing_force import MissingForce, motion_of
from estimator.record import Array

PERIODS_ASSUMED = 30.0  # periods of the assumed lines in a record: between slow motion and the sampling


@dataclass(frozen=True)
class Sought:
    """An effect at a location, or a fault of a sensor: candidates with different shapes, likeliest first."""

    kind: str
    location: str
    variants: tuple[Candidate, ...]

    @property
    def label(self) -> str:
        """kind@location."""
        return f"{self.kind}@{self.location}"

    @property
    def first(self) -> Candidate:
        """The likeliest variant."""
        return self.variants[0]


def sought(
    problem: Problem, theta: Mapping[str, float], measured: Sequence[str], noise: Array
) -> list[Sought]:
    """All effects that can be built in, and all faults of the measured outputs.

    noise: (n,) standard deviation of each measured output.
    """
    builder, run = problem.builder, problem.record.runs[0]
    names = [name for p in problem.ports for name in p.motion]
    [full] = problem.simulate(theta, names)
    n_y = len(problem.record.outputs)
    found = physical_candidates(problem, builder.offers, list(_assumed(problem, run.t, full[:, n_y:])))
    at = [problem.record.outputs.index(name) for name in measured]
    seen = replace(problem.record, outputs=tuple(measured), runs=(replace(run, y=full[:, at]),))
    found += fault_candidates(seen, noise, problem.policy.candidates)
    every = (list(some) for _, some in groupby(found, lambda c: c.label))
    return [Sought(some[0].kind, some[0].location, _variants(some, run.t)) for some in every]


def _assumed(problem: Problem, t: Array, motion: Array) -> Iterator[MissingForce]:
    """The force that is assumed to be missing at each port; motion: (N, 2 n_ports)."""
    known, since = problem.plant.fmu.description.variables, t - t[0]
    cycle = 2 * np.pi * PERIODS_ASSUMED
    for i, port in enumerate(problem.ports):
        q, v = motion_of(port, i, t, motion)
        span = float(np.ptp(q))
        line = np.sin(max(1.0, cycle / span) * (q - q.min())) if span > 0 else np.zeros_like(q)
        shape = np.sin(cycle * since / since[-1]) + line + (since > since[-1] / 2)
        force = (known[port.force].nominal or 1.0) * shape if port.force in known else shape
        yield MissingForce(port, t, force, np.ones_like(force), q, v)


def _variants(some: Sequence[Candidate], t: Array) -> tuple[Candidate, ...]:
    """The candidates of one effect; of those with an onset only the one nearest to the middle."""
    middle = (t[-1] - t[0]) / 2
    always = [c for c in some if c.onset is None]
    begun = [(abs(c.onset - middle), c) for c in some if c.onset is not None]
    return (*always, *(c for _, c in sorted(begun, key=lambda pair: pair[0])[:1]))
