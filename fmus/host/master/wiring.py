"""What each FMU of a coupling sets and reads, and the running members wired up by it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fmus.host.description import FmuDescription
from fmus.host.fmu import Fmu
from fmus.host.master.connections import Address, Link
from fmus.host.master.feedthrough import Feedthrough, passes
from fmus.host.master.march import Crew
from fmus.host.master.member import Layout, Member, Wire
from fmus.host.master.samples import EXTRAPOLATIONS
from fmus.host.master.signals import Signal


@dataclass(frozen=True)
class Scheme:
    """How values pass from FMU to FMU: see Master."""

    order: str
    extrapolation: str
    refresh: bool


class Wiring:
    """Layouts of the members by name; BadInput for an algebraic loop.

    signals: inputs from outside that change in a run. record: variables to be recorded.
    """

    def __init__(
        self,
        descriptions: Mapping[str, FmuDescription],
        links: Sequence[Link],
        signals: Mapping[Address, Signal],
        record: Sequence[Address],
        scheme: Scheme,
    ) -> None:
        self._descriptions, self._links, self._record, self._scheme = descriptions, links, record, scheme
        feedthrough = Feedthrough(descriptions, links, [*(link.target for link in links), *signals])
        self._late = {
            a
            for a in (*(link.source for link in links if not link.delayed), *record)
            if scheme.refresh and feedthrough.rank(a)
        }
        self.layouts = {name: self._layout(name, signals) for name in descriptions}
        self._passes = passes(list(descriptions), feedthrough, *self._wanted()) if scheme.refresh else []

    def _layout(self, name: str, signals: Mapping[Address, Signal]) -> Layout:
        used = [link.source for link in self._links if link.source.fmu == name]
        delayed = [link.source for link in self._links if link.delayed and link.source.fmu == name]
        early = delayed + [a for a in used if a not in self._late]
        recorded = [a for a in self._record if a.fmu == name]
        if not any(a.fmu == name for a in self._late):
            early += recorded
        early = list(dict.fromkeys(early))
        outputs = list(dict.fromkeys([*early, *used, *recorded]))
        given = {a.variable: s for a, s in signals.items() if a.fmu == name}
        connected = [link.target.variable for link in self._links if link.target.fmu == name]
        return Layout(
            inputs=[*connected, *given],
            signals=list(given.values()),
            outputs=[a.variable for a in outputs],
            early=len(early),
            delayed=bool(delayed),
        )

    def _wanted(self) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
        """By FMU: outputs that others take at once; these and what is recorded."""
        now = [link.source for link in self._links if not link.delayed]
        sources = {n: [a.variable for a in now if a.fmu == n] for n in self._descriptions}
        read = {
            n: [*sources[n], *(a.variable for a in self._record if a.fmu == n)] for n in self._descriptions
        }
        return sources, read

    def crew(self, fmus: Mapping[str, Fmu]) -> Crew:
        """The members on running FMUs, wired up."""
        line = EXTRAPOLATIONS[self._scheme.order, self._scheme.extrapolation]
        members = {n: Member(n, fmus[n], self.layouts[n], line) for n in self.layouts}
        for (source, target, delayed), wires in self._wires().items():
            samples = members[source].raw if delayed else members[source].settled
            members[target].wires.append((samples, wires))
        sequential = self._scheme.order == "gauss_seidel"
        ahead = {link.source.fmu for link in self._links if link.source in self._late and not link.delayed}
        return Crew(
            members=list(members.values()),
            passes=[members[n] for n in self._passes],
            leaders=frozenset(members[n] for n in ahead if sequential),
            columns=[(members[a.fmu], self._place(a)) for a in self._record],
            stiff=self._stiff(),
        )

    def _wires(self) -> dict[tuple[str, str, bool], list[Wire]]:
        """Wires by source, target and delay."""
        found: dict[tuple[str, str, bool], list[Wire]] = {}
        for link in self._links:
            i = list(self.layouts[link.target.fmu].inputs).index(link.target.variable)
            wire = (i, self._place(link.source), link.gain, link.offset)
            found.setdefault((link.source.fmu, link.target.fmu, link.delayed), []).append(wire)
        return found

    def _place(self, output: Address) -> int:
        return list(self.layouts[output.fmu].outputs).index(output.variable)

    def _stiff(self) -> str:
        """Why no step can be made again with shorter ones; empty where it can."""
        for name, description in self._descriptions.items():
            if not description.saves_state:
                return (
                    f"it cannot be made again with a shorter one, as '{name}' cannot go back to a saved state"
                )
            if not description.variable_step:
                return (
                    f"it cannot be made again with a shorter one, as '{name}' takes steps of one length only"
                )
        return ""
