"""The wheelset FMU with constant creep coefficients and the masses of Ward et al. 2010, Table A.1.

Its contact is that of the profiles, and roll follows from both contacts. So it makes records for filters
whose equations are written down apart from it.
"""

from pathlib import Path
from types import MappingProxyType

import numpy as np

from estimator.record import Array
from fmus.host.fmu import Fmu
from scenarios.literature.case import TIME, TRUE, Case, Record, Source
from scenarios.literature.twin import alignment

NONE = 1e-9  # N.m2: a creep coefficient of 0 would mean Kalker's
LIMIT = 2.2  # deviations, beyond which no irregularity goes, else the flange comes into it
TINY = 1e-12  # m, of an irregularity that is none
CENTRED = 1e-4  # m, a shift within which its conicity is that at this shift
# two springs of each kind, the yaw's on a lever of 1 m; one wheel carries half of W
TABLE_A1 = MappingProxyType({
    "creep_law": 0.0, "f11": 7.44e6, "f22": 6.79e6, "f23": 13.7e3, "f33": NONE,
    "r0": 0.45, "s": 0.7452, "F_n": 12263.0 / 2, "d": 1.0,
    "m_w": 1250.0, "m_m": 8000.0, "I_wy": 200.0, "I_wz": 700.0,
    "k_y": 0.23e6 / 2, "b_y": 50e3 / 2, "k_x": 2.5e6 / 2, "b_x": 0.0,
})  # fmt: skip
ALWAYS = ("y", "psi", "y_dot", "psi_dot", "xi_y_left", "r_left", "r_right")


def by_fmu(fmu: Path) -> Source:
    """Makes the record of a case by the wheelset FMU, over random alignment, and gauge if there is some."""

    def make(case: Case) -> Record:
        rng, t, V = np.random.default_rng(case.seed), case.times, case.speed
        d, d_dot = _limited(*alignment(V, t, rng, case.true["alignment_sd"]))
        gauge, _ = _limited(*alignment(V, t, rng, case.true.get("gauge_sd", 0.0)))
        given = {"y_irr": d, "y_irr_dot": d_dot, "gauge_irr": gauge}
        wanted = [*dict.fromkeys([*(n for n in case.noise if n != "phi_dot"), *ALWAYS])]
        with Fmu(fmu) as plant:
            y = plant.simulate(t, given, wanted, {**TABLE_A1, "V": V})
        true = dict(zip(wanted, y.T, strict=True))
        # as the model has it, which leaves out what a change of gauge does to the roll
        true["phi_dot"] = (V * true["xi_y_left"] - true["y_dot"] + V * true["psi"]) / true["r_left"]
        true["conicity"] = _conicity(true["y"] - d, true["r_left"] - true["r_right"])
        seen = {n: true[n] + rng.normal(0.0, std, len(t)) for n, std in case.noise.items()}
        inputs = {n: given[n] for n in case.inputs}
        return Record({TIME: t, **inputs, **seen, **{n + TRUE: true[n] for n in case.judged}})

    return make


def _limited(z: Array, rate: Array) -> tuple[Array, Array]:
    """An irregularity and its rate (N,), made smaller where it goes beyond LIMIT."""
    share = LIMIT * float(z.std()) / max(float(np.abs(z).max()), TINY)
    return min(share, 1.0) * z, min(share, 1.0) * rate


def _conicity(shift: Array, difference: Array) -> Array:
    """Half the difference of the radii over the shift (n,), m; at the centre that of samples beside it."""
    beside = np.abs(shift) > CENTRED
    order = np.argsort(shift[beside])
    at, value = shift[beside][order], (difference[beside] / (2 * shift[beside]))[order]
    return np.where(beside, difference / (2 * np.where(beside, shift, 1.0)), np.interp(shift, at, value))
