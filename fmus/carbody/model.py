"""Car body: lateral motion, yaw and roll over two bogies that are other FMUs.

Equations, symbols and range of validity: README.md beside this file.
"""

from __future__ import annotations

from functools import cached_property

from fmus.bogie.chord import sideways
from fmus.bogie.declared import BODY, PORT
from fmus.bogie.running_gear import BENCHMARK
from fmus.carbody.declared import car_body
from fmus.carbody.equations import ENDS, UnderBody, body_ports, body_rates, over_bogie
from fmus.model import Model
from fmus.port import Port
from fmus.variables import Expr, Input, OnTrack, Output, Parameter

NAMES = {"f": "front", "r": "rear"}
TRACK = {
    "kappa": ("1/m", "curvature, positive to the left,", 1e-3),
    "kappa_dot": ("1/(m.s)", "rate of the curvature", 1e-3),
    "cant": ("rad", "cant, positive where the right rail is higher,", 0.02),
    "cant_dot": ("rad/s", "rate of the cant", 0.02),
}


def at_bogie(name: str, end: str) -> str:
    """Name of what is felt at a bogie: the rate's mark stays last."""
    stem, dot, _ = name.partition("_dot")
    return f"{stem}_{end}{dot}"


class Carbody(Model):
    """Car body on two bogies: lateral motion, yaw and roll in curves; the bogies are FMUs of their own."""

    name = "Carbody"
    step_size = 1e-3  # s, in which effects with memory of their own are stable too

    V = Input("m/s", 40.0, min=0.0, doc="speed of travel", nominal=1.0, on_track=OnTrack("speed"))
    m_c = Parameter("kg", 32000.0, min=1.0, doc="mass of the car body", source=BENCHMARK)
    # vars() of a class body is its namespace: what both bogies have is written once
    vars().update(car_body())
    vars().update(
        {
            f"{name}_{end}": Input(unit, doc=f"{what} on the body by the {at} bogie", nominal=1e3)
            for end, at in NAMES.items()
            for name, unit, what in PORT.values()
        }
    )
    vars().update(
        {
            at_bogie(name, end): Input(unit, doc=f"{what} under the {at} bogie, mean", nominal=size)
            for end, at in NAMES.items()
            for name, (unit, what, size) in TRACK.items()
        }
    )
    vars().update(
        {
            f"{q}_c{end}{dot}": Output(f"{unit}{per}", doc=f"{what}{meaning} of the body over the {at} bogie")
            for end, at in NAMES.items()
            for q, (unit, meaning, *_) in BODY.items()
            for dot, per, what in (("", "", ""), ("_dot", "/s", "rate of "))
        }
    )

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        forces = {end: {q: m.symbols[f"{PORT[q][0]}_{end}"] for q in BODY} for end in ENDS}
        return body_rates(m.symbols, m._track, forces)

    def outputs(m) -> dict[str, Expr]:
        """See Model.outputs."""
        found: dict[str, Expr] = {}
        for end in ENDS:
            body = over_bogie(m.symbols, m._track, end)
            for q in BODY:
                found |= {f"{q}_c{end}": body.q[q], f"{q}_c{end}_dot": body.rate[q]}
        return found

    def ports(m) -> dict[str, Port]:
        """The body on its coordinates."""
        return body_ports(m.symbols)

    @cached_property
    def _track(m) -> UnderBody:
        aside = {end: sideways(m.V, m.symbols[f"kappa_{end}"], m.symbols[f"cant_{end}"]) for end in ENDS}
        felt = {name: {end: m.symbols[at_bogie(name, end)] for end in ENDS} for name in TRACK}
        return UnderBody(aside, **felt)
