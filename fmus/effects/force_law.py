"""A force law: a generalised force at a port, from displacement and velocity there."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, ClassVar

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from fmus.effects.effect import Effect
from fmus.errors import BadInput
from fmus.integrators.rk4 import runge_kutta
from fmus.port import UNITS, Port
from fmus.sampled import Sampled
from fmus.stepped import Stepped
from fmus.variables import Expr

if TYPE_CHECKING:
    from fmus.effects.site import Site

Array = NDArray[np.float64]
RANKED = 1000  # samples that rank shapes
HANDFUL = 3  # shapes that are worth a simulation each


class ForceLaw(Effect):
    """A force law at a port.

    Every law is a resistance: a positive parameter opposes motion in the positive direction.
    Units of parameters are templates in {F} (force or torque) and {q} (way or angle).
    The force along a motion that starts at rest is in proportion to the amplitudes.
    """

    acts_on = "port"
    places: ClassVar[tuple[str, ...]] = ("rests", "turns", "slips")  # where the law makes sense
    # shape parameters within which a turn of the force is rounded, by what they are part of: "velocity" or
    # "displacement"; the force may be as stiff as they are small
    rounded: ClassVar[Mapping[str, str]] = {}

    @abstractmethod
    def force(self, q: Expr, v: Expr) -> Expr:
        """Generalised force in the positive direction of q, from displacement q and velocity v."""

    def rates(self, q: Expr, v: Expr) -> dict[str, Expr]:
        """Derivative of each state, by name."""
        return {}

    @classmethod
    def shapes(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """Start values of shape parameters that a motion suggests; see `guesses`."""
        return [{}]

    @classmethod
    def guesses(cls, t: Array, q: Array, v: Array, force: Array) -> list[dict[str, float]]:
        """Start values of shape parameters to try, a handful, likeliest first; {} where there are none.

        t: (N,) s, increasing; q, v: (N,) motion at the port; force: (N,) what is missing there.
        Of many shapes those stay with which the law explains most of the force.
        """
        shapes = cls.shapes(t, q, v, force)
        if len(shapes) <= HANDFUL:
            return shapes
        # without a memory a part of the samples ranks them as well
        thin = 1 if cls.states("translation") else max(1, len(t) // RANKED)
        part = [x[::thin] for x in (t, q, v, force)]
        left = [_left(cls, shape, *part) for shape in shapes]
        return [shapes[i] for i in np.argsort(left, kind="stable")[:HANDFUL]]

    @classmethod
    def true_to_name(cls, values: Mapping[str, float], q: Array, v: Array) -> bool:
        """Whether a law with these values, in a motion q, v (N,), is what its name says.

        values: parameters by name. At the limits of its shape a law turns into another one.
        """
        return True

    @classmethod
    def along(cls, values: Mapping[str, float], t: Array, q: Array, v: Array) -> Array:
        """Force (N,) along a motion (N,) at times t, s, with a memory at rest at t[0].

        values: parameters by name, those not given at their start. States by Runge-Kutta steps between
        the samples, the motion linear between them.
        """
        law = _compiled(cls)
        here = {p.name: p.start for p in cls.parameters("translation")} | dict(values)
        values_here = [here[n] for n in law.parameters]
        x: list[Array] = []
        if law.states:
            given = np.vstack([t, q, v, np.tile(np.array(values_here)[:, None], len(t))])
            x0 = np.array([s.start for s in cls.states("translation")])
            x = [*law.steps(x0, given, np.diff(t))]
        force: Array = law.force([t, q, v, *values_here, *x], len(t))[0]
        return force

    @classmethod
    def units(cls, of: str) -> Mapping[str, str]:
        """See Effect.units: force and displacement of a kind of motion."""
        return UNITS[of]

    @classmethod
    def locations(cls, site: Site) -> dict[str, Port]:
        """See Effect.locations."""
        return site.ports()

    @classmethod
    def fits(cls, place: Port) -> bool:
        """See Effect.fits."""
        return place.place in cls.places

    @classmethod
    def offered(cls, site: Site, location: str) -> bool:
        """See Effect.offered: a law over the displacement needs one."""
        return not cls.needs_displacement() or site.ports()[location].has_displacement

    @classmethod
    def needs_displacement(cls) -> bool:
        """Whether the force or its memory depends on the displacement."""
        return _compiled(cls).of_displacement

    @classmethod
    def build(cls, site: Site, location: str, place: Port) -> None:
        """See Effect.build: where several ports act alike, each has its own motion and memory.

        BadInput for a law over the displacement at a port that has none.
        """
        if not place.has_displacement and cls.needs_displacement():
            raise BadInput(
                f"{cls.kind} at '{location}' depends on the displacement, which the port does not name; "
                "add displacement = ..., an output of the FMU, to the port"
            )
        shared = {
            p.name: site.add(replace(p, name=cls.name_at(location, p.name)))
            for p in cls.parameters(place.motion)
            if site.has_way or p.name not in cls.of_way
        }
        shared |= {quantity: site.known(quantity) for quantity in cls.asks}
        if cls.of_way and site.has_way:
            shared["way"] = site.known("way")
        for i, port in enumerate(place.acting, 1):
            number = f"_{i}" if len(place.acting) > 1 else ""
            names = {s.name: cls.name_at(location, s.name + number) for s in cls.states(port.motion)}
            memory = {s.name: site.add(replace(s, name=names[s.name])) for s in cls.states(port.motion)}
            given = site.force_at(port), port.displacement, port.velocity
            force, *rates = site.by_law(cls, {**shared, **memory}, _added, given, through=True)
            site.rates.update(zip(names.values(), rates, strict=True))
            site.press(port, force)


def _added(law: ForceLaw, others: Expr, q: Expr, v: Expr) -> list[Expr]:
    """The force with that of others, and the derivatives of the law's states in the order of declaration."""
    rates = law.rates(q, v)
    return [others + law.force(q, v), *(rates[s.name] for s in law.states("translation"))]


class _Compiled:
    """A law as functions: force(w, x) and its steps through samples; w is (t, q, v, parameters)."""

    def __init__(self, law: type[ForceLaw]) -> None:
        self.states = [s.name for s in law.states("translation")]
        self.parameters = [p.name for p in law.parameters("translation")]
        n = 3 + len(self.parameters)
        w, x = cs.SX.sym("w", n), cs.SX.sym("x", len(self.states))
        memory = {name: x[i] for i, name in enumerate(self.states)}
        values = {name: w[3 + i] for i, name in enumerate(self.parameters)}
        made = law({**values, **memory, "clock": w[0]})
        arguments = [*cs.vertsplit(w), *cs.vertsplit(x)]
        force, rates = cs.SX(made.force(w[1], w[2])), made.rates(w[1], w[2])
        self.force = Sampled(cs.Function("force", arguments, [force]))
        slopes = cs.vertcat(*(rates[name] for name in self.states))
        self.of_displacement = bool(cs.depends_on(cs.vertcat(force, slopes), w[1]))
        f = cs.Function("f", [w, x], [slopes])
        a, b, dt = cs.SX.sym("a", n), cs.SX.sym("b", n), cs.SX.sym("dt")
        after = runge_kutta(f, x, dt, (a, (a + b) / 2, b))
        self.steps = Stepped(cs.Function("step", [x, a, b, dt], [after]))


@cache
def _compiled(law: type[ForceLaw]) -> _Compiled:
    return _Compiled(law)


def _left(law: type[ForceLaw], shape: dict[str, float], t: Array, q: Array, v: Array, force: Array) -> float:
    """Sum of squares of a force that a law with a shape and a constant leave unexplained."""
    return unexplained(force, [law.along({**shape, a: 1.0}, t, q, v) for a in law.amplitudes])


def unexplained(force: Array, columns: Sequence[Array]) -> float:
    """Sum of squares of a force (n,) that regression on a constant and other forces (n,) leaves."""
    basis = np.column_stack([np.ones_like(force), *columns])
    size = np.linalg.norm(basis, axis=0) + 1e-300
    rest = force - (basis / size) @ np.linalg.lstsq(basis / size, force, rcond=1e-9)[0]
    return float(rest @ rest)
