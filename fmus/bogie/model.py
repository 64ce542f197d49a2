"""Bogie: two wheelsets in a frame under a car body that is given or stands still over the track.

Equations, symbols and range of validity: README.md beside this file.
"""

from __future__ import annotations

from functools import cached_property

import casadi as cs

from fmus.bogie.chord import Chord
from fmus.bogie.declared import BODY, PORT, body_variables, wheelset_variables
from fmus.bogie.mechanics import Body
from fmus.bogie.mechanics import Bogie as Mechanics
from fmus.bogie.running_gear import RunningGear
from fmus.component import Component
from fmus.port import Port
from fmus.variables import Expr, Input, OnTrack, Output

WHEELSETS, FRAME = ("1", "2"), "b"


class Bogie(RunningGear):
    """Bogie: two wheelsets and a frame, lateral, yaw and roll, in curves, under a car body that is given."""

    name = "Bogie"

    V = Input("m/s", 40.0, min=0.0, doc="speed of travel", nominal=1.0, on_track=OnTrack("speed"))
    # vars() of a class body is its namespace: what both wheelsets have is written once
    vars().update(wheelset_variables("1", "the leading wheelset", ()))
    vars().update(wheelset_variables("2", "the trailing wheelset", ("a", "a")))
    vars().update(body_variables(BODY, FRAME, "the frame"))
    vars().update(
        {
            f"{q}_c{end}": Input(
                f"{unit}{per}", doc=f"{what}{meaning} of the body over the bogie", nominal=size
            )
            for q, (unit, meaning, nominal, fast) in BODY.items()
            for end, per, what, size in (("", "", "", nominal), ("_dot", "/s", "rate of ", fast))
        }
    )
    vars().update(
        {
            f"{name}_c": Output(
                unit, doc=f"{what} on the body at the height of its centre of mass", nominal=1e3
            )
            for name, unit, what in PORT.values()
        }
    )
    flange_contact = Output(
        "1", doc="1 where a flange touches; with one contact of a wheel, not valid beyond it"
    )

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        return m._bogie.derivatives()

    def outputs(m) -> dict[str, Expr]:
        """See Model.outputs."""
        from fmus.contact.geometry.search import FLANGE_ANGLE  # loads SciPy, which other models do without

        found = m._bogie.outputs() | {f"{PORT[q][0]}_c": force for q, force in m._bogie.on_body.items()}
        steepest = cs.mmax(cs.vertcat(*(c.steepest for c in m._bogie.contacts)))
        return found | {"flange_contact": steepest > FLANGE_ANGLE}

    def ports(m) -> dict[str, Port]:
        """Wheelsets and frame on their coordinates, primary and secondary suspension."""
        return {name.removesuffix(f"_{FRAME}"): port for name, port in m._bogie.ports().items()}

    def components(m) -> dict[str, Component]:
        """Springs and dampers of both suspensions."""
        return COMPONENTS

    @cached_property
    def _bogie(m) -> Mechanics:
        q, rate = ({k: m.symbols[f"{k}_c{end}"] for k in BODY} for end in ("", "_dot"))
        return Mechanics(Chord(m, WHEELSETS), FRAME, Body(q, rate, {}))


COMPONENTS = {
    "primary_lateral": Component(("k_py",), ("b_py",)),
    "primary_yaw": Component(("k_px",), ("b_px",)),
    "secondary_lateral": Component(("k_sy",), ("b_sy",)),
    "secondary_yaw": Component(("k_sx",), ("b_d",)),
}
