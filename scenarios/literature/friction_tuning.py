"""What the friction paper names next: noise that adapts, and a moving average over the estimate."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from estimator.filters.estimator import Adaptation
from estimator.record import Array
from fmus.contact.forces.friction import CRITICAL
from scenarios.literature import friction_ukf as printed
from scenarios.literature.case import Case, Record
from scenarios.literature.following import (
    BAND,
    Followed,
    covered,
    first_below,
    moving_mean,
    rmse,
)
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.parameter_figure import Line, Panel, parameter_figure
from scenarios.literature.row import Measured, Row, Tell
from scenarios.literature.wheelset import DT, NOISE

DURATION = 40.0  # s
BOTH = Adaptation(measurement=True, process=True)
SENSORS = Adaptation(measurement=True, process=False)
TOO_SURE = 0.1  # of their noise, that a filter is told of the sensors
WINDOWS = (1.0, 10.0)  # s, of the moving average; the source gives none
PRINTED, PRINTED_ADAPTIVE = "as printed", "as printed, adaptive"
RIGHT, RIGHT_ADAPTIVE = "track known", "track known, adaptive"
WRONG, WRONG_ADAPTIVE = "a tenth of the noise", "a tenth, adaptive"
WAYS = (PRINTED, PRINTED_ADAPTIVE, RIGHT, RIGHT_ADAPTIVE, WRONG, WRONG_ADAPTIVE)
SHOWN = (WRONG_ADAPTIVE, WRONG, PRINTED, PRINTED_ADAPTIVE)
AIM = 1.2  # of the RMSE with the right R: what a wrong R may cost where it adapts

RUN = ("dry", "wet", "wet-very_low")  # of the cases of the friction row
CASES = tuple(replace(c, duration=DURATION) for c in printed.CASES if c.name in RUN)


def followed(way: str, case: Case, record: Record, fmu: Path) -> Followed:
    """Estimates by one of WAYS."""
    if way in (PRINTED, PRINTED_ADAPTIVE):
        adapt = BOTH if way == PRINTED_ADAPTIVE else None
        return printed.as_published(case, record, fmu, per=1.0, adapt=adapt)
    task = printed.task(case, fmu)
    if way in (WRONG, WRONG_ADAPTIVE):
        task = replace(task, noise={name: TOO_SURE * std for name, std in NOISE.items()})
    if way in (RIGHT_ADAPTIVE, WRONG_ADAPTIVE):
        task = replace(task, adapt=SENSORS)
    return task.known(record)


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    panels: list[Panel] = []
    for case, record in measured:
        found: dict[str, Followed] = {}
        for way in WAYS:
            tell(f"{case.name}: {way}")
            found[way] = followed(way, case, record, fmu)
        findings += judged(case, found)
        shown = {way: Line.of(found[way], "mu0") for way in SHOWN}
        title = case.name.replace("_", " ").replace("-", " to ")
        panels.append(Panel(title, [case.truth("mu0", record.t)], shown, "mu0", (0.0, 0.6)))
    return Outcome(ROW.name, findings, [parameter_figure(ROW.name, panels)], NOTES)


def judged(case: Case, found: Mapping[str, Followed]) -> list[Finding]:
    """Errors of all ways, and of the moving averages over the estimate of the filter as printed."""
    made: list[Finding] = []
    before = {way: _error(case, f.t, f.value["mu0"]) for way, f in found.items()}
    for way, one in found.items():
        aim = AIM * before[RIGHT] if way == WRONG_ADAPTIVE else None
        made += _of(case, way, one.t, one.value["mu0"], aim, one.reason)
        made.append(Finding(case.name, f"{way}: mean NIS of {len(NOISE)}", "1", one.nis))
        if not case.later:
            held = covered(one, "mu0", case.truth("mu0", one.t), printed.START_UP)
            made.append(Finding(case.name, f"{way}: {BAND}", "1", held))
    one = found[PRINTED]
    counted = (one.t > printed.START_UP) & (one.t < case.when)
    middle = float(np.mean(one.value["mu0"][counted]))
    made.append(Finding(case.name, f"{PRINTED}: mean of mu0, which is {case.true['mu0']:g}", "1", middle))
    for window in WINDOWS:
        mean = moving_mean(one.value["mu0"], round(window / DT))
        made += _of(case, f"{PRINTED}, mean of {window:g} s", one.t, mean)
    return made


def _of(
    case: Case, what: str, t: Array, mu0: Array, aim: float | None = None, reason: str = ""
) -> list[Finding]:
    """Error of an estimate (N,), and at a drop of friction, when it shows and how often it did before."""
    error = Finding(case.name, f"{what}: RMSE of mu0", "1", _error(case, t, mu0), target=aim, note=reason)
    if not case.later:
        return [error]
    waiting = (t > printed.START_UP) & (t < case.when)
    return [
        error,
        Finding(
            case.name, f"{what}: below {CRITICAL} after the step", "s",
            first_below(t, mu0, CRITICAL, case.when),
        ),
        Finding(
            case.name, f"{what}: share below {CRITICAL} before it", "1",
            float(np.mean(mu0[waiting] < CRITICAL)),
        ),
    ]  # fmt: skip


def _error(case: Case, t: Array, mu0: Array) -> float:
    """RMSE of mu0 after the start-up and before the step, after which other parameters are wrong too."""
    counted = (t > printed.START_UP) & (t < case.when)
    return rmse(mu0[counted], case.truth("mu0", t)[counted])


NOTES = (
    "The source names both and prints neither: no window, no rule by which noise adapts, no result.",
    "The adaptation is that of estimate: innovations that scatter more than predicted raise the noise.",
    "As printed, with Q per second. At the step all Polach parameters change, which no filter knows.",
)

ROW = Row(
    "friction_tuning",
    "Friction with noise that adapts, and with a moving average over the estimate",
    "Onat, Voltr, Lata, sections 5 and 6; thesis 4.6.1",
    "wheelset",
    CASES,
    rebuilt,
)
