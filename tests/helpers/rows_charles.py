"""Truth of Charles, Dixon, Goodall 2008 (eq. 1 to 5): a linear wheelset but for its conicity."""

from __future__ import annotations

import numpy as np

from scenarios.literature.case import (
    TIME,
    TRUE,
    Case,
    Record,
)
from tests.truth.wheelset_track import random_alignment, shifted_alignment

# Table 1; I_wy and W are not in it and are those of Ward et al. 2010
TABLE_1 = {
    "f11": 7.44e6, "f22": 6.79e6, "f23": 13.7e3, "f33": 0.0, "f_y": 50e3, "I": 700.0, "I_wy": 200.0,
    "l": 0.7452, "m": 1250.0, "m_m": 8000.0, "k_y": 0.23e6, "k_psi": 2.5e6, "W": 12263.0, "r0": 0.45,
}  # fmt: skip
LIMIT = 2.6  # deviations, beyond which the irregularity does not go
PARTS = 4  # steps in a sample
TREAD, ROOT = 0.08, 0.4  # conicity; the source shows a generic one and gives no figures
WIDE = 10e-3  # m


def conicity(y: np.ndarray) -> np.ndarray:
    """At shifts y (n,), m: that of a flat tread, and beyond some 3 mm that of the root of a flange."""
    return TREAD + (ROOT - TREAD) / (1 + np.exp(-(np.abs(y) - 3e-3) / 0.5e-3))


def of_charles(case: Case) -> Record:
    """A run over random irregularity, or over a step of it, by Runge-Kutta of order 4."""
    rng, t = np.random.default_rng(case.seed), case.times
    fine = np.arange(PARTS * (len(t) - 1) + 1) * case.dt / PARTS
    if "alignment_step" in case.true:
        run = shifted_alignment(fine, case.speed, case.true["alignment_step"], case.when)
    else:
        sd = case.true["alignment_sd"]
        run = random_alignment(rng, fine, case.speed, sd, LIMIT * sd)
    true = motion(run.y_irr, case.dt / PARTS, case.speed)
    seen = {n: true[n] + rng.normal(0.0, std, len(t)) for n, std in case.noise.items()}
    given = {"y_irr": run.y_irr[:: 2 * PARTS]}
    true["conicity"] = conicity(true["y"] - given["y_irr"])
    return Record({TIME: t, **given, **seen, **{n + TRUE: true[n] for n in case.judged}})


def motion(irregularity: np.ndarray, h: float, V: float) -> dict[str, np.ndarray]:
    """Motion and accelerations at every PARTS-th step of h [s]; irregularity (2 n - 1,), m, by half steps."""
    p = TABLE_1
    start, table = -WIDE, conicity(np.arange(-WIDE, WIDE, 1e-5)).tolist()

    def rates(x, d):
        y, psi, y_dot, psi_dot, y_m, y_m_dot = x
        place = min(max((y - d - start) / 1e-5, 0.0), len(table) - 1.001)
        i = int(place)
        cone = table[i] + (place - i) * (table[i + 1] - table[i])
        slide = y_dot * (1 + p["r0"] * cone / p["l"]) - V * psi
        spring = p["k_y"] * (y_m - y) + p["f_y"] * (y_m_dot - y_dot)
        F = -2 * p["f22"] / V * slide - 2 * p["f23"] / V * psi_dot - p["W"] * cone / p["l"] * (y - d) + spring
        N = -2 * p["f11"] * (p["l"] * cone / p["r0"] * (y - d) + p["l"] ** 2 / V * psi_dot)
        N += (
            2 * p["f23"] / V * slide
            - 2 * p["f33"] / V * psi_dot
            - p["I_wy"] * V * cone / p["l"] / p["r0"] * y_dot
        )
        N += p["W"] * cone * p["l"] * psi - p["k_psi"] * psi
        return y_dot, psi_dot, F / p["m"], N / p["I"], y_m_dot, -spring / p["m_m"]

    def moved(x, h, k):
        return tuple(a + h * b for a, b in zip(x, k, strict=True))

    d, x, rows = irregularity.tolist(), (0.0,) * 6, []
    last = len(d) // 2
    for i in range(last + 1):
        k1 = rates(x, d[2 * i])
        if i % PARTS == 0:
            rows.append((*x, k1[2], k1[3], k1[5]))
        if i == last:
            break
        k2 = rates(moved(x, h / 2, k1), d[2 * i + 1])
        k3 = rates(moved(x, h / 2, k2), d[2 * i + 1])
        k4 = rates(moved(x, h, k3), d[2 * i + 2])
        x = tuple(a + h / 6 * (b + 2 * (c + e) + f) for a, b, c, e, f in zip(x, k1, k2, k3, k4, strict=True))
    names = ("y", "psi", "y_dot", "psi_dot", "y_m", "y_m_dot", "y_ddot", "psi_ddot", "y_m_ddot")
    return dict(zip(names, np.array(rows).T, strict=True))
