"""One bogie: two wheelsets in a frame under a car body, with every spring and damper at a port.

Springs and dampers act at the same ports as effects do, so that every lever arm is written once.
Equations: README.md beside this file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import casadi as cs

from fmus.bogie.axle import Contact, Motion, Touching, contact, touching
from fmus.bogie.chord import Chord
from fmus.bogie.declared import MOTIONS, SIDES, port_name
from fmus.port import Port
from fmus.variables import Expr

Gains = Mapping[str, Expr]


@dataclass(frozen=True)
class Body:
    """The car body over a bogie, in the track's coordinates there: displacements, rates, SI.

    gains: what a force on y, psi, phi puts on the body's own inputs; empty where the body is another model.
    """

    q: Mapping[str, Expr]
    rate: Mapping[str, Expr]
    gains: Mapping[str, Gains]


@dataclass(frozen=True)
class Suspension:
    """A spring and a damper between two bodies, about one direction: forces act along its port."""

    port: Port
    k: Expr
    b: Expr

    @property
    def force(self) -> Expr:
        """Force that pushes the upper end, N or N.m."""
        return -self.k * self.port.displacement - self.b * self.port.velocity


class Bogie:
    """Equations of a bogie of a model: of its wheelsets by their numbers, of its frame by its letter."""

    def __init__(self, chord: Chord, frame: str, body: Body, health: Expr = 1.0) -> None:
        """health: of its yaw dampers, 1 is sound."""
        self.m, self.wheelsets = chord.m, chord.wheelsets
        self.chord, self.frame, self.body, self.health = chord, frame, body, health

    @property
    def coordinates(self) -> list[str]:
        """Names of the coordinates but for the rolling of the wheelsets."""
        return [f"{q}_{i}" for i in self.wheelsets for q in ("y", "psi")] + [
            f"{q}_{self.frame}" for q in ("y", "psi", "phi")
        ]

    @cached_property
    def suspensions(self) -> dict[str, Suspension]:
        """Primary suspension of each wheelset and secondary suspension, by location."""
        m, found = self.m, {}
        for i in self.wheelsets:
            found[f"primary_lateral_{i}"] = Suspension(self._lateral(i), 2 * m.k_py, 2 * m.b_py)
            levers = 2 * m.c_p**2
            found[f"primary_yaw_{i}"] = Suspension(self._yaw(i), levers * m.k_px, levers * m.b_px)
            found[f"primary_roll_{i}"] = Suspension(self._roll(i), levers * m.k_pz, levers * m.b_pz)
        levers, at = 2 * m.c_s**2, self.frame
        damper = 2 * m.c_d**2 * m.b_d * self.health
        found[f"secondary_lateral_{at}"] = Suspension(self._over("y", m.h_c, m.h_s), 2 * m.k_sy, 2 * m.b_sy)
        found[f"secondary_yaw_{at}"] = Suspension(self._over("psi"), levers * m.k_sx, damper)
        found[f"secondary_roll_{at}"] = Suspension(
            self._over("phi"), levers * m.k_sz + m.k_r, levers * m.b_sz
        )
        return found

    def ports(self) -> dict[str, Port]:
        """Every coordinate and both suspensions, but for the primary one in roll, which loads the wheels."""
        m, found = self.m, {}
        for name in self.coordinates:
            q, _, where = name.partition("_")
            body = f"frame_{MOTIONS[q]}" if where == self.frame else f"wheelset_{where}_{MOTIONS[q]}"
            place = f"{body}_{where}" if where == self.frame else body
            turned = "translation" if q == "y" else "rotation"
            found[place] = Port(
                m.symbols[name],
                m.symbols[f"{name}_dot"],
                {port_name(name): 1.0},
                turned,  # type: ignore[arg-type]
            )
        offered = {n: s.port for n, s in self.suspensions.items() if not n.startswith("primary_roll")}
        return found | offered

    def derivatives(self) -> dict[str, Expr]:
        """Of all states of wheelsets and frame."""
        m, found = self.m, {}
        for i, contact_ in zip(self.wheelsets, self.contacts, strict=True):
            Omega = m.V / m.r0 + m.symbols[f"omega_{i}"]
            gyroscopic = -m.I_wy * Omega * self._touching[i].phi_dot
            forces = {"y": contact_.F_y, "psi": contact_.M_z + gyroscopic}
            inertia = {"y": m.m_w, "psi": m.I_wz}
            track = {"y": self.chord.aside_at(i), "psi": m.V * m.symbols[f"kappa_{i}_dot"]}
            for q, force in forces.items():
                name = f"{q}_{i}"
                found[name] = m.symbols[f"{name}_dot"]
                found[f"{name}_dot"] = (force + self.applied[port_name(name)]) / inertia[q] - track[q]
            found[f"omega_{i}"] = contact_.M_y / m.I_wy
        inertia = {"y": m.m_b, "psi": m.I_bz, "phi": m.I_bx}
        track = {"y": self.chord.aside, "psi": self.chord.turning, "phi": 0.0}
        for q in inertia:
            name = f"{q}_{self.frame}"
            found[name] = m.symbols[f"{name}_dot"]
            found[f"{name}_dot"] = self.applied[port_name(name)] / inertia[q] - track[q]
        return found

    def outputs(self) -> dict[str, Expr]:
        """Guiding forces, wheel loads, their ratio, contact angles and dissipation of all wheels."""
        found: dict[str, Expr] = {}
        for i, contact_ in zip(self.wheelsets, self.contacts, strict=True):
            for side, name in enumerate(SIDES):
                Y, Q = contact_.Y[side], contact_.Q[side]
                found |= {f"Y_{i}_{name}": Y, f"Q_{i}_{name}": Q, f"YQ_{i}_{name}": Y / Q}
                found[f"delta_{i}_{name}"] = contact_.delta[side]
                found[f"T_gamma_{i}_{name}"] = contact_.T_gamma[side]
                found[f"T_gamma_flange_{i}_{name}"] = contact_.T_gamma_flange[side]
        return found

    @property
    def on_body(self) -> dict[str, Expr]:
        """Force, N, and moments, N.m, on the body at its centre of mass over the bogie, by y, psi and phi."""
        m, forces = self.m, self._secondary
        load = self._load
        lateral = forces["lateral"] - load * self._lean
        tilt = load * (m.h_c * self.body.q["phi"] - self._aside_of_body / 2)
        return {"y": lateral, "psi": forces["yaw"], "phi": forces["roll"] + m.h_c * lateral + tilt}

    @cached_property
    def contacts(self) -> list[Contact]:
        """Contacts of both wheelsets under the loads that their wheels carry."""
        return [
            contact(self.m, self._motion(i), self._touching[i], self._wheel_loads(i)) for i in self.wheelsets
        ]

    @cached_property
    def _touching(self) -> dict[str, Touching]:
        return {i: touching(self.m, self._motion(i)) for i in self.wheelsets}

    def _motion(self, i: str) -> Motion:
        names = ("y", "psi", "y_dot", "psi_dot", "omega", "y_irr", "y_irr_dot", "kappa")
        return Motion(*(self.chord.felt(i, name) for name in names))

    def _port(self, gains: Gains, shift: Expr = 0.0, rate: Expr = 0.0, turns: bool = False) -> Port:
        """Port of a sum of gains times own coordinates, with a part from elsewhere."""
        q = sum(gain * self.m.symbols[name] for name, gain in gains.items()) + shift
        v = sum(gain * self.m.symbols[f"{name}_dot"] for name, gain in gains.items()) + rate
        forces = {port_name(name): gain for name, gain in gains.items()}
        return Port(q, v, forces, "rotation" if turns else "translation")

    def _lateral(self, i: str) -> Port:
        at = self.frame
        return self._port(
            {f"y_{at}": 1.0, f"psi_{at}": self.chord.ahead(i), f"phi_{at}": self.m.h_p, f"y_{i}": -1.0}
        )

    def _yaw(self, i: str) -> Port:
        gains = {f"psi_{self.frame}": 1.0, f"psi_{i}": -1.0}
        return self._port(gains, -self.chord.turned(i), -self.chord.turned(i, "_dot"), turns=True)

    def _roll(self, i: str) -> Port:
        """Of the frame over a wheelset, whose roll follows from its contacts."""
        phi, phi_dot = self._touching[i].phi, self._touching[i].phi_dot
        return self._port(
            {f"phi_{self.frame}": 1.0},
            self.chord.twisted(i) - phi,
            self.chord.twisted(i, "_dot") - phi_dot,
            turns=True,
        )

    def _over(self, q: str, above: Expr = 0.0, below: Expr = 0.0) -> Port:
        """Of the body over the frame; above, below: heights of their centres of mass from the plane."""
        own = {f"{q}_{self.frame}": -1.0}
        if q == "y":
            own[f"phi_{self.frame}"] = below
        b = self.body
        shift, rate = b.q[q], b.rate[q]
        gains = dict(b.gains.get(q, {}))
        if q == "y":
            shift, rate = shift + above * b.q["phi"], rate + above * b.rate["phi"]
            for name, gain in b.gains.get("phi", {}).items():
                gains[name] = gains.get(name, 0.0) + above * gain
        port = self._port(own, shift, rate, turns=q != "y")
        return Port(port.displacement, port.velocity, {**port.forces, **gains}, port.motion)

    @property
    def _load(self) -> Expr:
        """Weight of the body on this bogie, N."""
        return self.m.m_c / 2 * self.chord.down

    @property
    def _lean(self) -> Expr:
        """Mean roll of body and frame, along which the weight between them acts, rad."""
        return (self.body.q["phi"] + self.m.symbols[f"phi_{self.frame}"]) / 2

    @property
    def _aside_of_body(self) -> Expr:
        return self.suspensions[f"secondary_lateral_{self.frame}"].port.displacement

    @property
    def _secondary(self) -> dict[str, Expr]:
        return {q: self.suspensions[f"secondary_{q}_{self.frame}"].force for q in ("lateral", "yaw", "roll")}

    @cached_property
    def applied(self) -> dict[str, Expr]:
        """Forces on all coordinates but those of contacts, by port input: suspensions, weight, effects."""
        m, frame = self.m, f"phi_{self.frame}"
        Q = {port_name(name): m.symbols[port_name(name)] for name in self.coordinates}
        for suspension in self.suspensions.values():
            suspension.port.act(Q, suspension.force)
        phi, roll = m.symbols[frame], port_name(frame)
        lateral = self.suspensions[f"secondary_lateral_{self.frame}"].port
        lateral.act(Q, -self._load * self._lean)
        Q[roll] += self._load * (m.h_s * phi - lateral.displacement / 2)
        load = self._primary_load
        for i in self.wheelsets:
            lateral = self.suspensions[f"primary_lateral_{i}"].port
            lateral.act(Q, -load * (phi + self._touching[i].phi) / 2)
            Q[roll] += load * (m.h_p * phi - lateral.displacement / 2)
        return Q

    @property
    def _primary_load(self) -> Expr:
        """Weight on the primary suspension of one wheelset, N."""
        return (self.m.weight - self.m.m_w) * self.chord.down

    def _wheel_loads(self, i: str) -> Expr:
        """Loads of both wheels, N, by the balance of roll; the acceleration along the track is left out."""
        m = self.m
        # of both contacts together
        lateral = m.m_w * self.chord.aside_at(i) - self.applied[port_name(f"y_{i}")]
        roll = -self.suspensions[f"primary_roll_{i}"].force
        tilt = -self._primary_load * self.suspensions[f"primary_lateral_{i}"].port.displacement / 2
        Omega = m.V / m.r0 + m.symbols[f"omega_{i}"]
        spun = m.I_wy * Omega * (m.symbols[f"psi_{i}_dot"] + m.V * self.chord.felt(i, "kappa"))
        share = (m.r0 * lateral + roll + tilt + spun) / (2 * m.s)
        mean = m.weight * self.chord.down / 2
        return cs.vertcat(mean - share, mean + share)
