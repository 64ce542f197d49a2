"""Records for the rows by the truth models, which share no code with the FMUs.

From a shell: python -m tests.helpers.rows friction_ukf OUT, then run the row on OUT. With --contact other,
wheel and rail meet in a contact of another form than the FMU's.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from scenarios.literature import ROWS
from scenarios.literature.case import TIME, Case, Record
from tests.helpers.rows_bogie import of_bogie
from tests.helpers.rows_charles import of_charles
from tests.helpers.rows_mal import of_mal, piece
from tests.helpers.rows_mal_cone import of_cone
from tests.helpers.rows_modes import of_modes
from tests.helpers.rows_rig_fastsim import of_rig_fastsim
from tests.helpers.rows_torsion import of_torsion
from tests.helpers.rows_ward import of_ward
from tests.truth import rig, vehicle, wheelset
from tests.truth.rig_inputs import Inputs, trapezium
from tests.truth.vehicle_effects import Law
from tests.truth.wheelset_motion import OTHER, SAME, Form

WRONG_PATCH = {"a": 3.4e-3, "b": 2.4e-3}  # m; the filter believes in a circle of 2.7 mm
LARGEST_TORQUE = 852.0  # N.m, thesis 4.5
CONTACTS = {"same": SAME, "other": OTHER}
REST = 5.0  # s without torque at the beginning and the end, thesis 4.5


def truth(case: Case, form: Form = SAME) -> Record:
    """The record of a case, by the truth model of its kind; form: of the wheelset's contact."""
    if "gauge_sd" in case.true:
        return of_ward(case)
    if "alignment_sd" in case.true or "alignment_step" in case.true:
        return of_charles(case)
    if "lambda_w" in case.true:
        return of_cone(case)
    if case.model == "testrig" and case.judged:
        return of_rig_fastsim(case)
    if case.model == "bogie":
        return of_bogie(case)
    if case.judged:
        return of_mal(case, form)
    if case.model == "wheelset":
        return of_wheelset(case, form)
    if case.model == "testrig" and "mu0" in case.true:
        return of_modes(case)
    return {"testrig": of_rig, "vehicle7dof": of_vehicle, "traction": of_torsion}[case.model](case)


def noisy(case: Case, true: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    """What the sensors of a case make of true outputs."""
    return {n: case.sensed(n, true[n], rng) for n in case.noise}


def of_wheelset(case: Case, form: Form = SAME) -> Record:
    """A run over random alignment; where parameters jump, the state goes on with the new ones."""
    rng, t = np.random.default_rng(case.seed), case.times
    lead = round(case.lead / case.dt)
    whole = wheelset.random_alignment(rng, np.arange(-lead, len(t)) * case.dt, case.speed)
    true = dict(case.true)
    form = replace(form, penetration=true.pop("patch", 0.0) > 0)
    end = lead + len(t) - 1
    jump = min(lead + round(case.when / case.dt), end) if case.later else end
    parts, start = [], None
    for first, last in pairwise(sorted({0, jump, end})):
        new = case.later if first == jump else {}
        now = replace(wheelset.Wheelset(), **{**true, **new})
        states = wheelset.simulate(piece(whole, first, last), now, form=form, start=start)
        parts.append(states[bool(parts) :])
        start = dict(zip(wheelset.COORDINATES, parts[-1][-1], strict=True))
    states = dict(zip(wheelset.COORDINATES, np.vstack(parts)[lead:].T, strict=True))
    middle = slice(2 * lead, None, 2)
    given = {"y_irr": whole.y_irr[middle], "y_irr_dot": whole.y_irr_dot[middle]}
    return Record({TIME: t, **given, **noisy(case, states, rng)})


def of_rig(case: Case) -> Record:
    """Braking and driving pulses between two rests, at one supply frequency; another patch than declared."""
    rng, t = np.random.default_rng(case.seed), case.times
    length = t[-1] - 2 * REST
    torque = sum(
        share * LARGEST_TORQUE * trapezium(t, REST + i * length / 4, 1.0, length / 4 - 2.5)
        for i, share in enumerate((0.5, -0.5, 1.0, 0.7))
    )
    inputs = Inputs(t, np.asarray(torque), np.full_like(t, case.speed))
    true = dict(case.true)
    acting = replace(inputs, T_P=inputs.T_P - true.pop("T_w_ext", 0.0))  # braking is positive
    omega_w, omega_r = rig.simulate(acting, replace(rig.Rig(), **WRONG_PATCH, **true))
    seen = noisy(case, {"omega_w": omega_w, "omega_r": omega_r}, rng)
    return Record({TIME: t, "T_P": inputs.T_P, "f_sync": inputs.f_sync, **seen})


def of_vehicle(case: Case) -> Record:
    """A run over random rails; later: health of springs, `h_k1_CORNER`, from `when` on, and k1 of all."""
    rng = np.random.default_rng(case.seed)
    laws = {}
    for name, value in case.later.items():
        place = name.replace("h_k1", "secondary") if name.startswith("h_") else "secondary"
        factor = value if name.startswith("h_") else value / case.true[name]
        laws[place] = Law(spring=factor, change_time=case.when)
    parameters = replace(vehicle.Vehicle(), **{n: v for n, v in case.true.items() if not n.startswith("h_")})
    track, motion = vehicle.true_run(
        rng, duration=case.duration, dt=case.dt, V=case.speed, profile=vehicle.rough_rails,
        parameters=parameters, effects=vehicle.Effects(laws=laws),
    )  # fmt: skip
    given = {}
    for i, corner in enumerate(vehicle.CORNERS):
        given |= {f"u_{corner}": track.u[:, i], f"u_{corner}_dot": track.u_dot[:, i]}
    seen = noisy(case, {name: motion.output(name) for name in case.noise}, rng)
    return Record({TIME: track.t, **given, **seen})


def main() -> None:
    """Write the records of a row."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("row", choices=[*ROWS])
    parser.add_argument("out", type=Path, help="folder in which CASE.csv are made")
    parser.add_argument(
        "--contact", choices=[*CONTACTS], default="same", help="form of the wheelset's contact"
    )
    parser.add_argument("--case", action="append", help="one of the cases, by default all")
    arguments = parser.parse_args()
    for case in ROWS[arguments.row].cases:
        if not arguments.case or case.name in arguments.case:
            made = truth(case, CONTACTS[arguments.contact])
            print(made.write(arguments.out / f"{case.name}.csv"), flush=True)


if __name__ == "__main__":
    main()
