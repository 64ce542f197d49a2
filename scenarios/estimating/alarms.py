"""Alarms of estimate: the intervals in which a quantity is beyond its limit with the required probability."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from estimator.filters.history import History
from estimator.filters.system import Joint
from estimator.record import Array
from scenarios.estimating.policy import POLICY
from scenarios.experiment.estimated import Alarm, Options


@dataclass(frozen=True)
class Raised:
    """An interval of time in s in which a quantity was beyond its limit with the required probability."""

    name: str
    limit: str
    begin: float
    end: float | None  # None if it lasts to the end of the record
    probability: float  # the highest in the interval


def alarms(joint: Joint, h: History, options: Options) -> list[Raised]:
    """The intervals in which a quantity with a limit was beyond it."""
    found = []
    for name, alarm in options.alarms.items():
        if name in h.names:
            i = h.names.index(name)
            for side, limit in (("below", alarm.below), ("above", alarm.above)):
                if limit is not None:
                    p = probability(joint, h, i, limit, side == "below")
                    found += stretches(name, f"{side} {limit:g}", h.t, p, alarm)
    return found


def probability(joint: Joint, h: History, i: int, limit: float, below: bool) -> Array:
    """Probability that quantity number i is beyond its limit, (N,).

    A parameter is taken to be normally distributed in the coordinate in which the filter estimates it.
    """
    at = i - len(joint.states)
    if 0 <= at < len(joint.parameters):
        transform = joint.parameters[at].transform
        if not transform.low < limit < transform.high:
            limit = -np.inf if limit <= transform.low else np.inf
        else:
            limit = transform.z(limit)
    p: Array = np.asarray(norm.cdf((limit - h.x[:, i]) / h.std[:, i]), dtype=np.float64)
    return p if below else 1 - p


def stretches(name: str, limit: str, t: Array, p: Array, alarm: Alarm) -> list[Raised]:
    """Begin and end of each alarm.

    It begins when the probability reaches its limit and stays there, and ends as the policy says.
    """
    likely = p >= alarm.probability
    edges = np.flatnonzero(np.diff(np.concatenate([[False], likely, [False]])))
    found: list[Raised] = []
    for begin, after in edges.reshape(-1, 2):
        known = not found or (found[-1].end is not None and t[begin] >= found[-1].end)
        if known and t[after - 1] - t[begin] >= alarm.hold:
            below = after + np.flatnonzero(~(p[after:] >= POLICY.alarm_ends))
            last = below[0] if len(below) else len(t)
            end = float(t[last]) if last < len(t) else None
            found.append(Raised(name, limit, float(t[begin]), end, float(p[begin:last].max())))
    return found
