"""Outputs that are measured late, brought to the times of what they show.

An estimate of a whole record may use a measurement where it belongs, however late it arrived. This is the
exact correction. A filter that keeps past outputs as states (Simon, Optimal State Estimation, 2006, 10.5)
knows no more at the end, and has more states by the number of samples of every delay.
"""

from dataclasses import replace

import numpy as np

from estimator.filters.history import Indices
from estimator.record import Array, Record, Run
from fmus.errors import BadInput, did_you_mean
from scenarios.experiment.experiment import Experiment

SAME = 1e-6  # of a time step: times that differ less are the same


def undelayed(e: Experiment, record: Record, any_step: bool) -> Record:
    """The record with each delayed output at the times that it shows; raises BadInput for wrong delays.

    any_step: whether the FMU takes steps of any length. Where a delay is no whole number of samples, the
    record gets rows between its own, in which that output alone is measured. What an output shows from before
    the record is left out.
    """
    wanted = e.estimate.delay if e.estimate else {}
    for name in wanted:
        if name not in record.outputs:
            known = did_you_mean(name, record.outputs)
            raise BadInput(f"{e.file}: [estimate.delay] '{name}' is none of [outputs]; {known}")
    if not wanted:
        return record
    run = record.runs[0]
    shown = run.t[:, None] - np.array([wanted.get(name, 0.0) for name in record.outputs])
    for name, times in zip(record.outputs, shown.T, strict=True):
        if times[-1] < run.t[0]:
            raise BadInput(
                f"{e.file}: [estimate.delay] {name} = {wanted[name]:g} s is longer than the record of "
                f"{run.t[-1] - run.t[0]:g} s; it is in seconds"
            )
    t = _with_rows_between(run.t, shown, SAME * run.sample)
    if len(t) > len(run.t) and (not any_step or (e.estimate and e.estimate.rate)):
        needs = "[estimate] rate needs" if any_step else "an FMU that takes steps of one length alone needs"
        raise BadInput(
            f"{e.file}: {needs} delays of whole samples, which are {run.sample:g} s apart; round the delays, "
            "or use another rate"
        )
    u = np.array([np.interp(t, run.t, column) for column in run.u.T]).T.reshape(len(t), -1)
    y = np.full((len(t), len(record.outputs)), np.nan)
    for j, times in enumerate(shown.T):
        inside = times >= t[0] - SAME * run.sample
        y[_nearest(t, times[inside]), j] = run.y[inside, j]
    whole = np.ones(len(t), np.bool_)
    return replace(record, runs=(Run(t, u, y, whole, ~whole, ~whole), *record.runs[1:]))


def _with_rows_between(t: Array, shown: Array, tolerance: float) -> Array:
    """Times t (N,) and those times of shown (N, m) that lie within them and are none of them, (n,)."""
    more = np.sort(shown[shown > t[0]])
    more = more[np.abs(t[_nearest(t, more)] - more) > tolerance]
    more = more[np.diff(more, prepend=-np.inf) > tolerance]
    return np.sort(np.concatenate([t, more]))


def _nearest(t: Array, times: Array) -> Indices:
    """Indices (n,) of the elements of t (N,) that are nearest to times (n,)."""
    return np.searchsorted((t[1:] + t[:-1]) / 2, times)
