"""What every model on bogies is declared with: parameters of running gear and contact, and the track.

Equations, symbols and sources: README.md beside this file.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType

from fmus.contact.forces.conditions import CONDITIONS, PARAMETERS
from fmus.contact.forces.friction import CRITICAL
from fmus.contact.forces.laws import LAWS, law_codes
from fmus.contact.forces.laws.polach import Polach
from fmus.effects.effect import Effect
from fmus.errors import BadInput
from fmus.model import Model
from fmus.option import BuildOption, Choice
from fmus.variables import Expr, Parameter
from fmus.wheelset.curves import NU, G
from fmus.wheelset.track import OPTIONS, Track

BENCHMARK = "Iwnicki 1998, vehicle 1"
ASSUMED = "this model: assumption"
SURFACE = "thesis Table 4.1, dry"
DRY = CONDITIONS["dry"]
CHOICE = "this model"
FORM = "this model: what methods for the patch differ in"
GRAVITY = 9.81  # m/s2
HOLLOW = "S1002_Hollow"
WORN = BuildOption(
    "worn", Path, "", "profile of the wheels where they are worn, by name or point file", HOLLOW
)
CONTACTS = BuildOption(
    "contacts", int, "", "contacts of a wheel, 1, or 2 where its tread and its flange may both carry", 1
)


class RunningGear(Model):
    """Parameters of bogies and of the contact, and the track that is built in; models add the speed V."""

    V: Expr  # m/s, speed of travel, an input of every model

    step_size = 1e-3
    tolerance = 1e-3  # of a state's nominal; creep forces turn within a step far from a usual motion
    method = "rk4_within_stability"
    form = MappingProxyType({"k_a": (0.5, 1.6), "k_b": (0.6, 2.6), "k_spin": (0.2, 1.2)})
    form_choices = MappingProxyType({"patch": (0.0, 1.0)})
    form_alike = ("G", "nu")
    form_error = 0.02
    build_options = (*OPTIONS, WORN, CONTACTS)

    m_w = Parameter("kg", 1813.0, min=1.0, doc="mass of a wheelset", source=BENCHMARK)
    I_wy = Parameter("kg.m2", 112.0, min=1.0, doc="rolling inertia of a wheelset", source=BENCHMARK)
    I_wz = Parameter("kg.m2", 1120.0, min=1.0, doc="yaw inertia of a wheelset", source=BENCHMARK)
    m_b = Parameter("kg", 2615.0, min=1.0, doc="mass of a bogie frame", source=BENCHMARK)
    I_bx = Parameter("kg.m2", 1722.0, min=1.0, doc="roll inertia of a bogie frame", source=BENCHMARK)
    I_bz = Parameter("kg.m2", 3067.0, min=1.0, doc="yaw inertia of a bogie frame", source=BENCHMARK)
    m_c = Parameter(
        "kg", 32000.0, min=1.0, doc="mass of the car body, half of it on a bogie", source=BENCHMARK
    )
    a = Parameter("m", 1.28, min=0.1, doc="half the wheelbase of a bogie", source=BENCHMARK)
    r0 = Parameter("m", 0.46, min=0.05, doc="nominal rolling radius", source=BENCHMARK)
    s = Parameter("m", 0.75, min=0.05, doc="half the distance of the tape circles", source=BENCHMARK)
    c_p = Parameter("m", 1.0, min=0.0, doc="primary suspension from the centre line", source=BENCHMARK)
    c_s = Parameter("m", 1.0, min=0.0, doc="secondary suspension from the centre line", source=BENCHMARK)
    c_d = Parameter("m", 1.4, min=0.0, doc="yaw dampers from the centre line", source=ASSUMED, fixed=True)
    h_p = Parameter("m", 0.14, doc="frame's centre of mass above the primary suspension", source=BENCHMARK)
    h_s = Parameter(
        "m", 0.2275, doc="secondary suspension above the frame's centre of mass", source=BENCHMARK
    )
    h_c = Parameter("m", 0.9725, doc="body's centre of mass above the secondary suspension", source=BENCHMARK)
    k_px = Parameter("N/m", 31.391e6, min=0.0, doc="longitudinal stiffness of an axle box", source=BENCHMARK)
    k_py = Parameter("N/m", 3.884e6, min=0.0, doc="lateral stiffness of an axle box", source=BENCHMARK)
    k_pz = Parameter("N/m", 1.22e6, min=0.0, doc="vertical stiffness of an axle box", source=BENCHMARK)
    b_px = Parameter("N.s/m", 15e3, min=0.0, doc="longitudinal damping of an axle box", source=BENCHMARK)
    b_py = Parameter("N.s/m", 2e3, min=0.0, doc="lateral damping of an axle box", source=BENCHMARK)
    b_pz = Parameter("N.s/m", 4e3, min=0.0, doc="vertical damping of an axle box", source=BENCHMARK)
    k_sx = Parameter("N/m", 160e3, min=0.0, doc="longitudinal stiffness, secondary, a side", source=BENCHMARK)
    k_sy = Parameter("N/m", 160e3, min=0.0, doc="lateral stiffness, secondary, a side", source=BENCHMARK)
    k_sz = Parameter("N/m", 430e3, min=0.0, doc="vertical stiffness, secondary, a side", source=BENCHMARK)
    b_sy = Parameter("N.s/m", 32e3, min=0.0, doc="lateral damping, secondary, a side", source=BENCHMARK)
    b_sz = Parameter("N.s/m", 20e3, min=0.0, doc="vertical damping, secondary, a side", source=BENCHMARK)
    k_r = Parameter("N.m/rad", 940e3, min=0.0, doc="anti-roll bar of a bogie", source=BENCHMARK)
    b_d = Parameter("N.s/m", 200e3, min=0.0, doc="yaw damper, a side", source=ASSUMED)
    G = Parameter("Pa", G, min=1e6, doc="shear modulus of wheel and rail", source=SURFACE)
    nu = Parameter("1", NU, min=0.0, max=0.5, doc="Poisson's ratio of wheel and rail", source="Kalker 1990")
    mu0 = Parameter(
        "1", DRY["mu0"], min=1e-4, max=2.0, doc="friction coefficient at no slip", source=SURFACE,
        alarm_below=CRITICAL,
    )  # fmt: skip
    A = Parameter("1", DRY["A"], min=0.0, max=1.0, doc="limit over maximum friction", source=SURFACE)
    B = Parameter("s/m", DRY["B"], min=0.0, doc="decrease of friction with slip velocity", source=SURFACE)
    k_A = Parameter("1", DRY["k_A"], min=0.0, doc="Polach factor in the area of adhesion", source=SURFACE)
    k_S = Parameter("1", DRY["k_S"], min=0.0, doc="Polach factor in the area of slip", source=SURFACE)
    k_a = Parameter("1", 1.0, min=0.1, max=10.0, doc="contacts' semi-axes a over the table's", source=FORM)
    k_b = Parameter("1", 1.0, min=0.1, max=10.0, doc="contacts' semi-axes b over the table's", source=FORM)
    k_spin = Parameter("1", 1.0, min=0.0, max=10.0, doc="spin coefficients over Kalker's", source=FORM)
    wear = Parameter(
        "1", 0.0, min=0.0, max=1.5, nominal=1.0, source=CHOICE,
        doc="how far the wheels are worn: 0 as the profile, 1 as the worn profile",
    )  # fmt: skip
    creep_law = Parameter(
        "1", float(Polach.code), min=0.0, max=len(LAWS) - 1.0, doc=law_codes(), source=CHOICE, fixed=True
    )
    contact_search = Parameter(
        "1", 1.0, min=0.0, max=1.0, doc="0 rigid, 1 quasi-elastic", source=CHOICE, fixed=True
    )
    patch = Parameter(
        "1", 0.0, min=0.0, max=1.0, doc="0 Hertz, 1 virtual penetration", source=CHOICE, fixed=True
    )

    def __init__(
        self,
        effects: Iterable[tuple[type[Effect], str]] = (),
        probes: bool = False,
        track: Track = Track(),  # noqa: B008  frozen
        **options: Choice,
    ) -> None:
        """effects, probes: see Model; track: the profiles and how they stand, or by options."""
        worn = WORN.read(options.pop(WORN.name, WORN.default))
        self.contacts = int(CONTACTS.read(options.pop(CONTACTS.name, CONTACTS.default)))
        if self.contacts not in (1, 2):
            raise BadInput(f"contacts = {self.contacts}: a wheel has 1 contact, or 2, of tread and flange")
        if options:
            track = Track.parse(**{**asdict(track), **options})
        self.track = track
        self.worn = Track.parse(**{**asdict(track), "wheel": worn, "wheel_right": ""})
        super().__init__(effects, probes, **asdict(track), worn=worn, contacts=self.contacts)
        for name, start in (("r0", track.nominal_radius), ("s", track.half_distance)):
            self.variables[name] = replace(self.variables[name], start=start)
        search = self.variables["contact_search"]
        self.variables["contact_search"] = replace(search, doc=f"{search.doc}; {self._built_in}")

    @property
    def about(self) -> str:
        """What is built in, in one line."""
        return f"{super().about} Built in: {self._built_in}."

    @property
    def _built_in(self) -> str:
        apart = "" if self.contacts == 1 else "; two contacts of a wheel, of tread and flange"
        return f"{self.track}; worn wheel {Path(self.worn.wheel).stem}{apart}"

    def notes(self) -> list[str]:
        """See Model.notes."""
        return self.track.notes + [note for note in self.worn.notes if note not in self.track.notes]

    def groups(self) -> dict[str, tuple[str, ...]]:
        """What a change of the rail's surface changes together, as for the wheelset."""
        return {"friction_condition": (*PARAMETERS, *self.form)}

    @property
    def weight(m) -> Expr:
        """Mass that one wheelset carries on its rails, kg, its own included."""
        return m.m_c / 4 + m.m_b / 2 + m.m_w

    @property
    def F_n(m) -> Expr:
        """Static wheel load, N."""
        return m.weight * GRAVITY / 2
