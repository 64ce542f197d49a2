"""Truth model of Ward, Goodall, Dixon 2010 (eq. 1 to 5): constant creep coefficients, true geometry."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from scenarios.literature.case import (
    TIME,
    TRUE,
    Case,
    Record,
)
from tests.truth.wheelset_contact import contacts
from tests.truth.wheelset_track import random_alignment

TABLE_A1 = {
    "f11": 7.44e6, "f22": 6.79e6, "f23": 13.7e3, "f33": 0.0, "f_y": 50e3, "I": 700.0, "I_wy": 200.0,
    "l": 0.7452, "m": 1250.0, "m_m": 8000.0, "k_y": 0.23e6, "k_psi": 2.5e6, "W": 12263.0, "r0": 0.45,
}  # fmt: skip
LONGEST_GAUGE = 6.0  # m, shortest wavelength of the gauge
LIMIT = 2.2  # deviations, beyond which neither irregularity goes


class Geometry:
    """Radii, angles and roll over the shift, fine tables read linearly."""

    def __init__(self, r0):
        c = contacts()
        self.y = np.arange(c.y[0], c.y[-1], 1e-5)
        self.r = r0 + PchipInterpolator(c.y, c.growth)(self.y)
        self.delta = PchipInterpolator(c.y, c.delta)(self.y)
        self.phi = PchipInterpolator(c.y, c.phi)(self.y)
        self.slope = PchipInterpolator(c.y, c.phi).derivative()(self.y)

    def at(self, column, y):
        place = min(max((y - self.y[0]) / 1e-5, 0.0), len(self.y) - 1.001)
        i = int(place)
        return column[i] + (place - i) * (column[i + 1] - column[i])


def rates(p, g, V, x, d, d_dot, gauge):
    """Rates (6,) of y, psi, y_dot, psi_dot, y_m, y_m_dot, and roll and its rate."""
    y, psi, y_dot, psi_dot, y_m, y_m_dot = x
    shift = y - d
    left, right = shift - gauge / 2, -shift - gauge / 2
    r_L, r_R, d_L, d_R = g.at(g.r, left), g.at(g.r, right), g.at(g.delta, left), g.at(g.delta, right)
    phi, phi_dot = g.at(g.phi, shift), g.at(g.slope, shift) * (y_dot - d_dot)
    mean = (r_L + r_R) / 2
    slide = y_dot + mean * phi_dot - V * psi
    F_s = p["k_y"] * (y_m - y) + p["f_y"] * (y_m_dot - y_dot)
    F = F_s - 2 * p["f22"] / V * slide - 2 * p["f11"] * (1 - mean / p["r0"]) * psi
    F -= 2 * p["f23"] * (psi_dot / V - (d_L - d_R) / (2 * p["r0"])) + p["W"] * ((d_L - d_R) / 2 + phi)
    M = -p["k_psi"] * psi - p["I_wy"] * V / p["r0"] * phi_dot - p["l"] * p["f11"] / p["r0"] * (r_L - r_R)
    M += 2 * p["f23"] / V * slide - 2 * p["l"] ** 2 * p["f11"] * psi_dot / V
    M += p["f33"] * ((d_L - d_R) / p["r0"] - 2 * psi_dot / V) + p["l"] * p["W"] * (d_L + d_R) / 2 * psi
    dot = np.array([y_dot, psi_dot, F / p["m"], M / p["I"], y_m_dot, -F_s / p["m_m"]])
    return dot, phi, phi_dot


def of_ward(case: Case) -> Record:
    """A run over random alignment, and gauge where there is some, by Runge-Kutta in quarters of a sample."""
    rng, t = np.random.default_rng(case.seed), case.times
    fine = np.arange(4 * (len(t) - 1) + 1) * case.dt / 4
    sizes = case.true["alignment_sd"], case.true["gauge_sd"]
    runs = [
        random_alignment(rng, fine, case.speed, sd, LIMIT * sd, shortest)
        for sd, shortest in zip(sizes, (3.0, LONGEST_GAUGE), strict=True)
    ]  # fmt: skip
    d, d_dot, gauge = runs[0].y_irr, runs[0].y_irr_dot, runs[1].y_irr
    g, p, h, V = Geometry(TABLE_A1["r0"]), TABLE_A1, case.dt / 4, case.speed
    x, rows = np.zeros(6), []
    for i in range(len(fine)):

        def dot(x, j):
            return rates(p, g, V, x, d[j], d_dot[j], gauge[j])

        k1, phi, phi_dot = dot(x, 2 * i)
        if i % 4 == 0:
            rows.append([*x, phi, phi_dot, k1[2], k1[3]])
        if i == len(fine) - 1:
            break
        k2 = dot(x + h / 2 * k1, 2 * i + 1)[0]
        k3 = dot(x + h / 2 * k2, 2 * i + 1)[0]
        k4 = dot(x + h * k3, 2 * i + 2)[0]
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    names = ("y", "psi", "y_dot", "psi_dot", "y_m", "y_m_dot", "phi", "phi_dot", "y_ddot", "psi_ddot")
    true = dict(zip(names, np.array(rows).T, strict=True))
    seen = {n: true[n] + rng.normal(0.0, std, len(t)) for n, std in case.noise.items()}
    given = {"y_irr": d[::8], "y_irr_dot": d_dot[::8], "gauge_irr": gauge[::8]}
    true["conicity"] = conicity(g, true["y"] - d[::8])
    return Record({TIME: t, **given, **seen, **{n + TRUE: true[n] for n in case.judged}})


def conicity(g, y):
    """Half the difference of the rolling radii over the shift y (n,), m, at nominal gauge."""
    y = np.where(np.abs(y) < 1e-4, 1e-4, y)
    return (np.interp(y, g.y, g.r) - np.interp(-y, g.y, g.r)) / (2 * y)
