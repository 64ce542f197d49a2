"""Lateral vehicle: two bogies and a car body, in curves with cant, on one clock as one model.

Equations, symbols and range of validity: README.md beside this file.
"""

from __future__ import annotations

from functools import cached_property

import casadi as cs

from fmus.bogie.chord import Chord
from fmus.bogie.declared import BODY, body_variables, wheelset_variables
from fmus.bogie.mechanics import Bogie as Mechanics
from fmus.bogie.running_gear import RunningGear
from fmus.carbody.declared import car_body
from fmus.carbody.equations import UnderBody, body_ports, body_rates, over_bogie
from fmus.component import Component
from fmus.port import Port, alike
from fmus.variables import Expr, Input, OnTrack, Output, Parameter

BOGIES = {"f": (("1", "2"), "front"), "r": (("3", "4"), "rear")}
WHEELSETS = {  # number: what it is, parameters by whose sum it runs behind the first
    "1": ("the first wheelset", ()),
    "2": ("the second wheelset", ("a", "a")),
    "3": ("the third wheelset", ("l", "l")),
    "4": ("the fourth wheelset", ("l", "l", "a", "a")),
}
ALIKE = ("primary_lateral", "primary_yaw", "secondary_lateral", "secondary_yaw")


class VehicleLateral(RunningGear):
    """Lateral vehicle: four wheelsets, two frames and a car body, lateral, yaw and roll, in curves."""

    name = "VehicleLateral"

    V = Input("m/s", 40.0, min=0.0, doc="speed of travel", nominal=1.0, on_track=OnTrack("speed"))
    # vars() of a class body is its namespace: what all wheelsets, all frames have is written once
    vars().update(
        {
            name: variable
            for i, (what, behind) in WHEELSETS.items()
            for name, variable in wheelset_variables(i, what, behind).items()
        }
    )
    vars().update(
        {
            name: variable
            for end, (_, at) in BOGIES.items()
            for name, variable in body_variables(BODY, end, f"the {at} frame").items()
        }
    )
    vars().update(car_body())
    vars().update(
        {
            f"h_d_{end}": Parameter(
                "1",
                1.0,
                min=0.0,
                max=10.0,
                doc=f"health of the {at} yaw dampers, 1 = sound",
                source="relative",
            )
            for end, (_, at) in BOGIES.items()
        }
    )
    flange_contact = Output(
        "1", doc="1 where a flange touches; with one contact of a wheel, not valid beyond it"
    )

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        found = {k: v for bogie in m._bogies.values() for k, v in bogie.derivatives().items()}
        on_body = {end: bogie.on_body for end, bogie in m._bogies.items()}
        return found | body_rates(m.symbols, m._track, on_body)

    def outputs(m) -> dict[str, Expr]:
        """See Model.outputs."""
        from fmus.contact.geometry.search import FLANGE_ANGLE  # loads SciPy, which other models do without

        found = {k: v for bogie in m._bogies.values() for k, v in bogie.outputs().items()}
        angles = [contact.steepest for bogie in m._bogies.values() for contact in bogie.contacts]
        return found | {"flange_contact": cs.mmax(cs.vertcat(*angles)) > FLANGE_ANGLE}

    def ports(m) -> dict[str, Port]:
        """All bodies on their coordinates, each suspension, and those of one kind alike."""
        found = {location: port for bogie in m._bogies.values() for location, port in bogie.ports().items()}
        found |= body_ports(m.symbols)
        return found | {
            kind: alike([p for n, p in found.items() if n.startswith(f"{kind}_")]) for kind in ALIKE
        }

    def components(m) -> dict[str, Component]:
        """Springs and dampers of one kind alike, and the yaw dampers of each bogie."""
        yaw_dampers = {f"secondary_yaw_{end}": Component((), (f"h_d_{end}",)) for end in BOGIES}
        return COMPONENTS | yaw_dampers

    @cached_property
    def _chords(m) -> dict[str, Chord]:
        return {end: Chord(m, wheelsets) for end, (wheelsets, _) in BOGIES.items()}

    @cached_property
    def _track(m) -> UnderBody:
        names = ("kappa", "kappa_dot", "cant", "cant_dot")
        felt = {name: {end: chord.over(name) for end, chord in m._chords.items()} for name in names}
        return UnderBody({end: chord.aside for end, chord in m._chords.items()}, **felt)

    @cached_property
    def _bogies(m) -> dict[str, Mechanics]:
        return {
            end: Mechanics(chord, end, over_bogie(m.symbols, m._track, end), m.symbols[f"h_d_{end}"])
            for end, chord in m._chords.items()
        }


COMPONENTS = {
    "primary_lateral": Component(("k_py",), ("b_py",)),
    "primary_yaw": Component(("k_px",), ("b_px",)),
    "secondary_lateral": Component(("k_sy",), ("b_sy",)),
    "secondary_yaw": Component(("k_sx",), ("b_d",)),
}
