"""Records simulated by the FMU itself: for a first try of a row only, as model and truth are the same."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np

from estimator.record import Array
from fmus.errors import BadInput
from fmus.host.archive import Archive
from fmus.host.fmu import Fmu
from scenarios.literature.case import (
    TIME,
    TRUE,
    Case,
    Record,
    Source,
)
from scenarios.track.spectra import SPECTRA, Spectrum
from scenarios.track.statistics import CHOCEN_DOBRIKOV

BAND = (2 * np.pi / 60.0, 2 * np.pi / 3.0)  # rad/m, wavelengths of 3 to 60 m
RUN_IN = 40.0  # m, over which irregularities grow from nothing
LINES = 160
AXLES = 19.0  # m between the bogie centres
WHEELBASE = 2.56  # m of a bogie
TORQUE = 852.0  # N.m, thesis 4.5
REST = 5.0  # s without torque at the beginning and the end, there
WHEEL, GEAR = 0.5, 5.0  # m, 1: rolling radius and gearbox of the driven wheelset
POLE_PAIRS = 5  # of the rig's motor
R_WHEEL, R_ROLLER = 0.3482, 0.45215  # m, of the rig: thesis 4.6.4, 4.1
BRAKE = 1.1 * 8000.0 * R_WHEEL  # N.m over mu0, a little above the adhesion of the rig's wheel
PULL = 1.1 * 2 * 79.7e3 * WHEEL / GEAR  # N.m over mu0, a little above the adhesion of both wheels


def twin(fmu: Path) -> Source:
    """Makes the record of a case by a free simulation of the FMU, with noise."""

    def make(case: Case) -> Record:
        _check(case, fmu)
        rng, t = np.random.default_rng(case.seed), case.times
        inputs = INPUTS[case.model](case, t, rng)
        edges = [0, *(round(when / case.dt) for when, _ in case.jumps), len(t) - 1]
        begun = STARTS.get(case.model)
        start = {**(begun(case.speed) if begun else {}), **case.true}
        found = []
        with Fmu(fmu) as plant:
            states = list(plant.description.states)
            wanted = [*case.noise, *case.judged, *states]
            for i, (first, last) in enumerate(pairwise(edges)):
                start = {**start, **(case.jumps[i - 1][1] if i else {})}
                part = slice(first, last + 1)
                y = plant.simulate(t[part], {n: u[part] for n, u in inputs.items()}, wanted, start)
                found.append(y[min(i, 1) :])
                start |= dict(zip(states, y[-1, -len(states) :].tolist(), strict=True))
        y = np.vstack(found)
        seen = {n: case.sensed(n, y[:, i], rng) for i, n in enumerate(case.noise)}
        at = len(case.noise)
        true = {n + TRUE: y[:, at + i] for i, n in enumerate(case.judged)}
        return Record({TIME: t, **inputs, **seen, **true})

    return make


def _check(case: Case, fmu: Path) -> None:
    """BadInput where the FMU is not what a case was measured on."""
    with Archive(fmu) as archive:
        known = archive.description.variables
    for name in (*case.inputs, *case.noise, *case.judged, *case.true):
        if name not in known:
            raise BadInput(f"case '{case.name}': the FMU has no '{name}' to make a record with; give records")


def _waves(spectrum: Spectrum, s: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Height and slope at distances s (N,) m: waves of a spectrum with random phases, from rest at s = 0."""
    edges = np.geomspace(*BAND, LINES + 1)
    size = np.sqrt(2 * spectrum.variance(edges[:-1], edges[1:]))
    wave = (edges[1:] + edges[:-1]) / 2
    phase = rng.uniform(0, 2 * np.pi, LINES)
    z, slope = np.zeros_like(s), np.zeros_like(s)
    for a, w, p in zip(size, wave, phase, strict=True):
        z += a * np.cos(w * s + p)
        slope -= a * w * np.sin(w * s + p)
    part = np.clip(s / RUN_IN, 0.0, 1.0)
    grown, growing = part**3 * (10 - 15 * part + 6 * part**2), 30 * part**2 * (1 - part) ** 2 / RUN_IN
    return grown * z, grown * slope + growing * z


def alignment(speed: float, t: Array, rng: np.random.Generator, deviation: float) -> tuple[Array, Array]:
    """Random alignment (N,), m, of that deviation at times t (N,), s, and its rate, m/s; speed: m/s."""
    z, slope = _waves(SPECTRA["erri_low"]["alignment"], speed * t, rng)
    scale = deviation / z.std()
    return scale * z, scale * speed * slope


def _alignment(case: Case, t: Array, rng: np.random.Generator) -> dict[str, Array]:
    y, y_dot = alignment(case.speed, t, rng, CHOCEN_DOBRIKOV["alignment"].sd)
    return {"y_irr": y, "y_irr_dot": y_dot}


def _under_bogie(case: Case, t: Array, rng: np.random.Generator) -> dict[str, Array]:
    first = _alignment(case, t, rng)
    later = t - WHEELBASE / case.speed  # before its begin, what was there
    second = {name: np.interp(later, t, samples) for name, samples in first.items()}
    return {
        name.replace("y_irr", f"y_irr_{i}"): samples
        for i, felt in ((1, first), (2, second))
        for name, samples in felt.items()
    }


def _rails(case: Case, t: Array, rng: np.random.Generator) -> dict[str, Array]:
    s = case.speed * t
    both = np.concatenate([s, s - AXLES])
    level, tilt = (_waves(SPECTRA["erri_high"][q], both, rng) for q in ("level", "cross_level"))
    found = {}
    for side, sign in (("l", 0.5), ("r", -0.5)):
        z, slope = (a + sign * b for a, b in zip(level, tilt, strict=True))
        for bogie, part in (("f", slice(None, len(s))), ("r", slice(len(s), None))):
            found[f"u_{bogie}{side}"] = z[part]
            found[f"u_{bogie}{side}_dot"] = case.speed * slope[part]
    return {name: found[name] for name in case.inputs}


def _torque(case: Case, t: Array, rng: np.random.Generator) -> dict[str, Array]:
    if "mu0" in case.true:
        limit = BRAKE * case.truth("mu0", t) * np.clip(1.5 * np.sin(2 * np.pi * t), 0.1, 1.0)
        return {"T_P": np.minimum(limit, TORQUE), "f_sync": np.full_like(t, case.speed)}
    quarter = (t[-1] - 2 * REST) / 4
    knots, values = [0.0], [0.0]
    for i, share in enumerate((0.5, -0.5, 1.0, 0.7)):
        begin = REST + i * quarter
        knots += [begin, begin + 1.0, begin + quarter - 1.5, begin + quarter - 0.5]
        values += [0.0, share * TORQUE, share * TORQUE, 0.0]
    return {"T_P": np.interp(t, knots, values), "f_sync": np.full_like(t, case.speed)}


def _pulls(case: Case, t: Array, rng: np.random.Generator) -> dict[str, Array]:
    return {"T_m": PULL * case.true["mu0"] * np.clip(1.5 * np.sin(2 * np.pi * t), 0.1, 1.0)}


def _rolling(speed: float) -> dict[str, float]:
    return {"V": speed, "omega_left": speed / WHEEL}


def _synchronous(supply: float) -> dict[str, float]:
    omega_r = 2 * np.pi * supply / POLE_PAIRS
    return {"omega_r": omega_r, "omega_w": omega_r * R_ROLLER / R_WHEEL}


INPUTS: dict[str, Callable[[Case, Array, np.random.Generator], dict[str, Array]]] = {
    "wheelset": _alignment,
    "bogie": _under_bogie,
    "vehicle7dof": _rails,
    "testrig": _torque,
    "traction": _pulls,
}
STARTS: dict[str, Callable[[float], dict[str, float]]] = {
    "wheelset": lambda speed: {"V": speed},
    "bogie": lambda speed: {"V": speed},
    "traction": _rolling,
    "testrig": _synchronous,
}
