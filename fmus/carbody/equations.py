"""The car body along the chord between its bogies: its motion over each of them, and its equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fmus.bogie.declared import BODY, MOTIONS, port_name
from fmus.bogie.mechanics import Body
from fmus.port import Port
from fmus.variables import Expr

ENDS = ("f", "r")  # front and rear bogie
BODY_AT = "c"


@dataclass(frozen=True)
class UnderBody:
    """What the body feels of the track at both bogies, by end: means of their wheelsets, SI.

    aside: lateral acceleration of the track less that of gravity; kappa, cant: curvature, cant; their rates.
    """

    aside: Mapping[str, Expr]
    kappa: Mapping[str, Expr]
    kappa_dot: Mapping[str, Expr]
    cant: Mapping[str, Expr]
    cant_dot: Mapping[str, Expr]


def over_bogie(symbols: Mapping[str, Expr], track: UnderBody, end: str) -> Body:
    """The body over one bogie, relative to the track there; symbols: of the body's states and of l."""
    half = symbols["l"]
    ahead = half if end == ENDS[0] else -half

    def part(dot: str) -> dict[str, Expr]:
        kappa, cant = (track.kappa, track.cant) if not dot else (track.kappa_dot, track.cant_dot)
        y, psi, phi = (symbols[f"{q}_{BODY_AT}{dot}"] for q in BODY)
        first, last = kappa[ENDS[0]], kappa[ENDS[1]]
        turned = half / 3 * (2 * first + last if end == ENDS[0] else -first - 2 * last)
        twisted = cant[end] - (cant[ENDS[0]] + cant[ENDS[1]]) / 2
        return {"y": y + ahead * psi, "psi": psi - turned, "phi": phi + twisted}

    force, turn, roll = (port_name(f"{q}_{BODY_AT}") for q in BODY)
    gains = {"y": {force: 1.0, turn: ahead}, "psi": {turn: 1.0}, "phi": {roll: 1.0}}
    return Body(part(""), part("_dot"), gains)


def body_ports(symbols: Mapping[str, Expr]) -> dict[str, Port]:
    """The body on each of its coordinates."""
    return {
        f"body_{MOTIONS[q]}": Port(
            symbols[f"{q}_{BODY_AT}"],
            symbols[f"{q}_{BODY_AT}_dot"],
            {port_name(f"{q}_{BODY_AT}"): 1.0},
            "translation" if q == "y" else "rotation",
        )
        for q in BODY
    }


def body_rates(
    symbols: Mapping[str, Expr], track: UnderBody, on_body: Mapping[str, Mapping[str, Expr]]
) -> dict[str, Expr]:
    """Derivatives of the body's states from the forces of both bogies, by end and then y, psi, phi.

    symbols: of the body's states and ports, of V, l, m_c, I_cz, I_cx.
    """
    front, rear = (on_body[end] for end in ENDS)
    force, turn, roll = (symbols[port_name(f"{q}_{BODY_AT}")] for q in BODY)
    half = symbols["l"]
    lateral = front["y"] + rear["y"] + force
    moment = front["psi"] + rear["psi"] + half * (front["y"] - rear["y"]) + turn
    chord = symbols["V"] ** 2 * (track.kappa[ENDS[0]] - track.kappa[ENDS[1]]) / (2 * half)
    aside = (track.aside[ENDS[0]] + track.aside[ENDS[1]]) / 2
    accelerations = (
        lateral / symbols["m_c"] - aside,
        moment / symbols["I_cz"] - chord,
        (front["phi"] + rear["phi"] + roll) / symbols["I_cx"],
    )
    found: dict[str, Expr] = {}
    for q, acceleration in zip(BODY, accelerations, strict=True):
        found |= {f"{q}_{BODY_AT}": symbols[f"{q}_{BODY_AT}_dot"], f"{q}_{BODY_AT}_dot": acceleration}
    return found
