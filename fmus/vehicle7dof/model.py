"""Vertical vehicle: a coach on two bogies over the left and the right rail (thesis 3.5.2).

Equations, symbols and range of validity: README.md beside this file. Springs and dampers act at the
same ports as effects do, so that every lever arm is written once.
"""

from __future__ import annotations

from dataclasses import replace

from fmus.component import Component
from fmus.model import Model
from fmus.port import Port, alike
from fmus.variables import (
    Expr,
    Input,
    OnTrack,
    Output,
    Parameter,
    State,
    rate,
)

TABLE = "thesis Table 3.5"
CORNERS = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}
RAILS = {"l": "z_left", "r": "z_right"}  # that the side of a corner runs on
BOGIES = {"f": (), "r": ("a1", "a2")}  # what its bogie is behind the front one by
ELEMENTS = {
    "k1": "secondary spring",
    "b1": "secondary damper",
    "k2": "primary springs",
    "b2": "primary dampers",
}
FORCES = {  # that act along the coordinates
    "z1": "F_z1_ext",
    "phi_y1": "M_y1_ext",
    "phi_x1": "M_x1_ext",
    "z2": "F_z2_ext",
    "phi_x2": "M_x2_ext",
    "z3": "F_z3_ext",
    "phi_x3": "M_x3_ext",
}


class Vehicle7dof(Model):
    """Vertical vehicle on two bogies: bounce, pitch and roll of the coach, bounce and roll of the bogies."""

    name = "Vehicle7dof"
    step_size = 1e-3

    z1 = State("m", doc="height of the coach", nominal=5e-3)
    phi_y1 = State("rad", doc="pitch of the coach", nominal=5e-4)
    phi_x1 = State("rad", doc="roll of the coach", nominal=2e-3)
    z2 = State("m", doc="height of the front bogie", nominal=5e-3)
    phi_x2 = State("rad", doc="roll of the front bogie", nominal=2e-3)
    z3 = State("m", doc="height of the rear bogie", nominal=5e-3)
    phi_x3 = State("rad", doc="roll of the rear bogie", nominal=2e-3)
    z1_dot = State("m/s", doc="vertical velocity of the coach", nominal=0.03)
    phi_y1_dot = State("rad/s", doc="pitch rate of the coach", nominal=0.003)
    phi_x1_dot = State("rad/s", doc="roll rate of the coach", nominal=0.01)
    z2_dot = State("m/s", doc="vertical velocity of the front bogie", nominal=0.03)
    phi_x2_dot = State("rad/s", doc="roll rate of the front bogie", nominal=0.01)
    z3_dot = State("m/s", doc="vertical velocity of the rear bogie", nominal=0.03)
    phi_x3_dot = State("rad/s", doc="roll rate of the rear bogie", nominal=0.01)

    # vars() of a class body is its namespace: what every corner has is written once
    vars().update(
        {
            f"u_{c}{end}": Input(
                unit,
                doc=f"{what} under the {at} bogie side, mean of axles",
                nominal=nominal,
                on_track=OnTrack(RAILS[c[1]], bool(end), BOGIES[c[0]], spacing="axle_spacing"),
            )
            for end, unit, what, nominal in (
                ("", "m", "rail height", 5e-3),
                ("_dot", "m/s", "rate of the rail height", 0.03),
            )
            for c, at in CORNERS.items()
        }
    )
    F_z1_ext = Input("N", doc="port: vertical force on the coach", nominal=1e3)
    M_y1_ext = Input("N.m", doc="port: pitch moment on the coach", nominal=1e4)
    M_x1_ext = Input("N.m", doc="port: roll moment on the coach", nominal=1e3)
    F_z2_ext = Input("N", doc="port: vertical force on the front bogie", nominal=1e3)
    M_x2_ext = Input("N.m", doc="port: roll moment on the front bogie", nominal=1e3)
    F_z3_ext = Input("N", doc="port: vertical force on the rear bogie", nominal=1e3)
    M_x3_ext = Input("N.m", doc="port: roll moment on the rear bogie", nominal=1e3)

    m1 = Parameter("kg", 32000.0, min=1.0, doc="mass of the coach", source=TABLE)
    m2 = Parameter("kg", 2615.0, min=1.0, doc="mass of a bogie", source=TABLE)
    k1 = Parameter("N/m", 430e3, min=0.0, doc="stiffness of a secondary spring", source=TABLE)
    k2 = Parameter("N/m", 1220e3, min=0.0, doc="stiffness of a primary spring", source=TABLE)
    b1 = Parameter("N.s/m", 20e3, min=0.0, doc="damping of a secondary damper", source=TABLE)
    b2 = Parameter("N.s/m", 4e3, min=0.0, doc="damping of a primary damper", source=TABLE)
    J_y1 = Parameter("kg.m2", 1970e3, min=1.0, doc="pitch inertia of the coach", source=TABLE)
    J_x1 = Parameter("kg.m2", 56800.0, min=1.0, doc="roll inertia of the coach", source=TABLE)
    J_x2 = Parameter("kg.m2", 1722.0, min=1.0, doc="roll inertia of a bogie", source=TABLE)
    c1 = Parameter("m", 1.0, min=0.0, doc="secondary suspension from the centre line", source=TABLE)
    c2 = Parameter("m", 1.0, min=0.0, doc="primary suspension from the centre line", source=TABLE)
    a1 = Parameter("m", 9.5, min=0.0, doc="front bogie's centre from the coach's", source=TABLE)
    a2 = Parameter("m", 9.5, min=0.0, doc="rear bogie's centre from the coach's", source=TABLE)
    n_primary = Parameter(
        "1", 2.0, min=1.0, doc="primary springs and dampers per bogie side", source="ERRI B176", fixed=True
    )
    vars().update(
        {
            f"h_{e}_{c}": Parameter(
                "1", 1.0, min=0.0, max=10.0, doc=f"health of the {at} {what}, 1 = sound", source="relative"
            )
            for e, what in ELEMENTS.items()
            for c, at in CORNERS.items()
        }
    )

    z1_ddot = rate(z1_dot, "m/s2", "vertical acceleration of the coach")
    phi_y1_ddot = rate(phi_y1_dot, "rad/s2", "pitch acceleration of the coach")
    phi_x1_ddot = rate(phi_x1_dot, "rad/s2", "roll acceleration of the coach")
    z2_ddot = rate(z2_dot, "m/s2", "vertical acceleration of the front bogie")
    phi_x2_ddot = rate(phi_x2_dot, "rad/s2", "roll acceleration of the front bogie")
    z3_ddot = rate(z3_dot, "m/s2", "vertical acceleration of the rear bogie")
    phi_x3_ddot = rate(phi_x3_dot, "rad/s2", "roll acceleration of the rear bogie")
    vars().update(
        {
            f"d_{level}_{c}{end}": Output(unit, doc=f"{what} of the {at} {suspension}, upper minus lower end")
            for level, suspension in (("s", "secondary suspension"), ("p", "primary suspension"))
            for end, unit, what in (("", "m", "deflection"), ("_dot", "m/s", "rate of deflection"))
            for c, at in CORNERS.items()
        }
    )

    def derivatives(m) -> dict[str, Expr]:
        """See Model.derivatives."""
        Q = {name: m.symbols[name] for name in FORCES.values()}
        for c in CORNERS:
            k1, b1, k2, b2 = (m.symbols[e] * m.symbols[f"h_{e}_{c}"] for e in ELEMENTS)
            s, p = m._secondary(c), m._primary(c)
            s.act(Q, -k1 * s.displacement - b1 * s.velocity)
            p.act(Q, -m.n_primary * (k2 * p.displacement + b2 * p.velocity))
        inertia = dict(zip(FORCES, (m.m1, m.J_y1, m.J_x1, m.m2, m.J_x2, m.m2, m.J_x2), strict=True))
        dot = {q: m.symbols[f"{q}_dot"] for q in FORCES}
        return dot | {f"{q}_dot": Q[force] / inertia[q] for q, force in FORCES.items()}

    def outputs(m) -> dict[str, Expr]:
        """See Model.outputs."""
        found: dict[str, Expr] = {}
        for c in CORNERS:
            for level, port in (("s", m._secondary(c)), ("p", m._primary(c))):
                found |= {f"d_{level}_{c}": port.displacement, f"d_{level}_{c}_dot": port.velocity}
        return found

    def ports(m) -> dict[str, Port]:
        """Coach and bogies in bounce, and each suspension, alone or all four corners alike."""
        bodies = {"body": "z1", "bogie_front": "z2", "bogie_rear": "z3"}
        found = {location: m._port({q: 1.0}) for location, q in bodies.items()}
        for suspension, at in (("secondary", m._secondary), ("primary", m._primary)):
            corners = {f"{suspension}_{c}": at(c) for c in CORNERS}
            found |= {suspension: alike([*corners.values()]), **corners}
        return found

    def components(m) -> dict[str, Component]:
        """Springs and dampers of each suspension, alone or all four corners alike."""
        found: dict[str, Component] = {}
        for suspension, k, b in (("secondary", "k1", "b1"), ("primary", "k2", "b2")):
            every = {e: tuple(f"h_{e}_{c}" for c in CORNERS) for e in (k, b)}
            found[suspension] = Component(every[k], every[b])
            found |= {f"{suspension}_{c}": Component((f"h_{k}_{c}",), (f"h_{b}_{c}",)) for c in CORNERS}
        return found

    def _secondary(m, c: str) -> Port:
        """From the bogie up to the coach: height of the coach's point less that of the bogie's."""
        x, y, i = m._place(c, m.c1)
        return m._port({"z1": 1.0, "phi_y1": -x, "phi_x1": y, f"z{i}": -1.0, f"phi_x{i}": -y})

    def _primary(m, c: str) -> Port:
        """From the rail up to the bogie."""
        _, y, i = m._place(c, m.c2)
        bogie = m._port({f"z{i}": 1.0, f"phi_x{i}": y})
        u, u_dot = m.symbols[f"u_{c}"], m.symbols[f"u_{c}_dot"]
        return replace(bogie, displacement=bogie.displacement - u, velocity=bogie.velocity - u_dot)

    def _place(m, c: str, half_width: Expr) -> tuple[Expr, Expr, int]:
        """x and y of a corner, m, and the number of its bogie's coordinates."""
        x, i = (m.a1, 2) if c[0] == "f" else (-m.a2, 3)
        return x, half_width if c[1] == "l" else -half_width, i

    def _port(m, gains: dict[str, Expr]) -> Port:
        """The port whose displacement is a sum of gains times coordinates; a force there does its work."""
        q = sum(gain * m.symbols[name] for name, gain in gains.items())
        v = sum(gain * m.symbols[f"{name}_dot"] for name, gain in gains.items())
        return Port(q, v, {FORCES[name]: gain for name, gain in gains.items()})
