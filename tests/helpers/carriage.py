"""Records of a carriage with forces that the model Drive lacks, by an integration of its own."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from estimator.closeloop.decision.model_form import form_of
from estimator.closeloop.decision.verdict import judge
from estimator.closeloop.detection.detect import Detection
from estimator.closeloop.fitting.calibrate import calibrate
from estimator.closeloop.fitting.fitter import Fitter
from estimator.closeloop.fitting.likelihood_profile import profiled
from estimator.closeloop.hypotheses.baseline import Baseline
from estimator.closeloop.hypotheses.candidate import Candidate
from estimator.closeloop.hypotheses.promise import Promise
from estimator.closeloop.outcome import Outcome
from estimator.closeloop.question.problem import Problem
from estimator.closeloop.screening.candidates import physical_candidates
from estimator.closeloop.screening.missing_force import missing_forces
from estimator.closeloop.several.transfer import Traced
from estimator.record import Record, Run
from fmus.export.builders.hypotheses import ModelBuilder
from tests.helpers.verdicts import DETECTED, judged

DT, SAMPLES, FINE = 0.01, 1500, 10
NOISE = np.array([1e-3, 1e-2])  # m, m/s
T = np.arange(SAMPLES) * DT
Force = Callable[[float, float, float], float]  # of t, q, v

TOML = """
id = "{name}"
model = "drive"
data = "data.csv"
time = "t"
[split]
identify = [0.0, 9.99]
test = [10.0, 15.0]
[parameters]
M = 95.0
F_v = 200.0
[calibrate]
M = [80.0, 110.0]
[initial]
q = 0.0
q_dot = {speed}
[inputs]
F = "F"
[outputs.q]
column = "q"
unit = "m"
noise_std = 1e-3
[outputs.q_dot]
column = "q_dot"
unit = "m/s"
noise_std = 1e-2
"""


def one_way() -> np.ndarray:
    """A motor force that keeps the carriage going one way at nearly one speed, 0.3 m/s."""
    return 80 + 3 * np.sin(2 * np.pi * T / 3)


def to_and_fro(size: float = 1.0) -> np.ndarray:
    """A motor force that turns the carriage round and round."""
    return size * (90 * np.sin(2 * np.pi * T / 4) + 30 * np.sin(2 * np.pi * T / 0.7))


def motion(F: np.ndarray, resistance: Force, speed: float, M: float = 95.0) -> np.ndarray:
    """Position and velocity (N, 2) of M q'' = F - 200 q' - resistance, by Runge-Kutta steps of 1 ms."""
    q, v, h, found = 0.0, speed, DT / FINE, []

    def rate(s: float, q: float, v: float, f: float) -> float:
        return (f - 200.0 * v - resistance(s, q, v)) / M

    for k, s in enumerate(T):
        found.append((q, v))
        f, slope = F[k], (F[min(k + 1, SAMPLES - 1)] - F[k]) / DT
        for i in range(FINE):
            here, mid, end = (f + slope * h * (i + j) for j in (0.0, 0.5, 1.0))
            at = s + i * h
            a1 = rate(at, q, v, here)
            a2 = rate(at + h / 2, q + h / 2 * v, v + h / 2 * a1, mid)
            a3 = rate(at + h / 2, q + h / 2 * (v + h / 2 * a1), v + h / 2 * a2, mid)
            a4 = rate(at + h, q + h * (v + h / 2 * a2), v + h * a3, end)
            q += h * (v + h / 6 * (a1 + a2 + a3))
            v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return np.array(found)


def coulomb(size: float) -> Force:
    return lambda t, q, v: size * float(np.tanh(v / 1e-3))


def viscous(size: float) -> Force:
    return lambda t, q, v: size * v


def record(F: np.ndarray, resistance: Force, seed: int, speed: float = 0.0, M: float = 95.0) -> Record:
    y = motion(F, resistance, speed, M) + NOISE * np.random.default_rng(seed).standard_normal((SAMPLES, 2))
    return Record((Run(T, F[:, None], y, T < 10, T >= 10, T >= 10),), ("F",), ("q", "q_dot"), NOISE)


def problem(builder: ModelBuilder, made: Record, speed: float = 0.0) -> Problem:
    declared = {"M": 95.0, "F_v": 200.0, "q": 0.0, "q_dot": speed}
    return Problem(builder, made, declared, {"M": (80.0, 110.0)}, (), builder.ports)


def looked_at(name: str, asked: Problem, kinds: Sequence[str], quiet: bool = False) -> Traced:
    """What the chain finds where it tries these kinds of effects alone; quiet: where it need not try."""
    declared, base, noise = calibrate(asked)
    baseline = Baseline(asked, base, noise)
    forces = missing_forces(asked, base.fit.theta, noise.std)
    offered = [(k, "carriage") for k in kinds]
    candidates = physical_candidates(asked, offered, forces)
    promises = [_promise(c, base.fit.theta) for c in candidates]
    singles = form_of(baseline).ranked(Fitter(baseline).finished(promises))
    none = judged("no_discrepancy", (), "nothing")
    said = none if quiet else judge(baseline, singles, (), len(promises)).after(DETECTED)
    errors = {m.key: profiled(Fitter(baseline), m) for m in said.members}
    singles, said = [errors.get(h.key, h) for h in singles], said.of(list(errors.values()))
    detection = Detection(0.01, 0.0, {}, 1.0)
    found = (declared, baseline, detection, tuple(forces), tuple(promises), tuple(singles), ())
    return Traced(name, asked, Outcome(*found, said))


def _promise(c: Candidate, calibrated: dict[str, float]) -> Promise:
    start = {u.name: u.scale / len(c.amplitudes) for u in c.amplitudes}
    return Promise((c,), 0.0, {**calibrated, **start, **{u.name: u.start for u in c.shape}})


def write(folder: Path, name: str, made: Record, speed: float = 0.0) -> Path:
    """The folder of an experiment with a record."""
    here = folder / name
    here.mkdir(parents=True)
    [run] = made.runs
    rows = np.column_stack([run.t, run.u, run.y])
    np.savetxt(here / "data.csv", rows, "%.9g", ",", header="t,F,q,q_dot", comments="")
    (here / "experiment.toml").write_text(TOML.format(name=name, speed=speed))
    return here
