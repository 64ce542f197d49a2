"""What a record alone says of parameters whose estimates contain what was believed of them before it.

An estimate is the mean of both, weighted by one over their covariances. Many estimates contain the same
belief, which would count as often as there are records. It is taken out of all parameters of a record at
once: an estimate that is correlated with another one contains the belief of the other one, too.
"""

from math import sqrt

import numpy as np

from estimator.record import Array
from scenarios.fleet.policy import POLICY

LEAST = 1e-9  # of the information of the beliefs: what a record says less than that along a direction


def alone(value: Array, std: Array, correlation: Array, start: Array, believed: Array) -> tuple[Array, Array]:
    """Values (p,) and standard errors (p,) of the record alone.

    value, std: (p,) estimates and their errors; correlation: (p, p) of these errors; start, believed: (p,)
    mean and standard deviation of each before the record, independent of one another.
    """
    relative = std / believed
    information = np.linalg.pinv(correlation * np.outer(relative, relative), hermitian=True)
    says, along = np.linalg.eigh(information - np.eye(len(value)))
    covariance = along @ np.diag(1 / np.maximum(says, LEAST)) @ along.T
    found: Array = covariance @ information @ ((value - start) / believed)
    return start + believed * found, believed * np.sqrt(np.diag(covariance))


def says_nothing(own: float, believed: float) -> bool:
    """Whether a record says next to nothing on a parameter, by its error and the deviation before it."""
    return own >= believed * POLICY.informed / sqrt(1 - POLICY.informed**2)
