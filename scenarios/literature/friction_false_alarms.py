"""One hour each on dry and wet rails, from outputs only: does the friction estimate give a false alarm?"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import norm

from estimator.record import Array
from fmus.contact.forces.friction import CRITICAL
from scenarios.estimating.alarms import stretches
from scenarios.experiment.estimated import Alarm
from scenarios.literature.following import Followed
from scenarios.literature.friction_ukf import CASES as CONDITIONS
from scenarios.literature.friction_ukf import task
from scenarios.literature.outcome import Finding, Outcome
from scenarios.literature.parameter_figure import Line, Panel, parameter_figure
from scenarios.literature.row import Measured, Row, Tell

ALARM = Alarm(below=CRITICAL)  # the alarm of railfmi estimate
RAILS = ("dry", "wet")
PARTS, LENGTH = 6, 600.0  # runs that make the hour, and their duration, s
LEAD = 5.0  # s; the hour contains no starts from rest
THIN = 50  # samples of the figure

CASES = tuple(
    replace(case, name=f"{case.name}-{seed}", duration=LENGTH, lead=LEAD, seed=seed)
    for case in CONDITIONS
    if case.name in RAILS
    for seed in range(11, 11 + PARTS)
)


def probability(found: Followed) -> Array:
    """Probability that mu0 is below the critical value (N,), from the filter's deviation; 1 if diverged."""
    below: Array = norm.cdf((CRITICAL - found.value["mu0"]) / found.std["mu0"])
    return np.nan_to_num(below, nan=1.0)


def rebuilt(measured: Measured, fmu: Path, tell: Tell) -> Outcome:
    """See Row."""
    findings: list[Finding] = []
    panels: list[Panel] = []
    for case, record in measured:
        tell(f"{case.name}: {case.duration:g} s")
        ours = task(case, fmu)
        shape = ours.shaped(record)
        found = ours.along(record, shape)
        raised = stretches("mu0", f"below {CRITICAL:g}", found.t, probability(found), ALARM)
        lowest = float(np.min(found.value["mu0"]))
        findings += [
            Finding(case.name, "alarms", "1", float(len(raised)), target=0.0, note=found.reason),
            Finding(case.name, "lowest mu0", "1", lowest),
        ]
        thin = slice(None, None, THIN)
        line = Line(found.t[thin], found.value["mu0"][thin], found.std["mu0"][thin])
        panels.append(Panel(case.name, [case.truth("mu0", line.t)], {"estimated": line}, "mu0", (0.0, 0.6)))
    sheets = {on: [p for p in panels if p.title.startswith(on)] for on in RAILS}
    plots = [parameter_figure(f"{ROW.name}_{on}", shown) for on, shown in sheets.items() if shown]
    return Outcome(ROW.name, findings, plots, NOTES)


NOTES = (
    "The hour is six runs of ten minutes over different tracks, each recorded in the middle of a run.",
    f"An alarm: mu0 below {CRITICAL:g} with {ALARM.probability:.0%}, for {ALARM.hold:g} s on end.",
)

ROW = Row(
    "friction_false_alarms",
    "False alarms of the friction estimate in an hour on dry and on wet rails",
    "thesis 4.6.1 (critical value)",
    "wheelset",
    CASES,
    rebuilt,
)
