"""Which outputs follow their inputs at once, in what order to compute them, where they run in a circle."""

from collections.abc import Iterable, Mapping, Sequence

from fmus.errors import BadInput
from fmus.host.description import FmuDescription
from fmus.host.master.connections import Address, Link


def direct_inputs(description: FmuDescription, variable: str) -> tuple[str, ...]:
    """Inputs on which a variable depends without a step in between.

    What the model description states. Where it states nothing: none for a state (`initial="exact"`: its
    start value is free) and for a parameter, all inputs for any other output, which is the safe side.
    """
    v = description.variables[variable]
    if v.causality == "input":
        return (variable,)
    if variable in description.dependencies:
        return description.dependencies[variable]
    free = v.initial == "exact" or v.causality in ("parameter", "calculatedParameter", "independent")
    return () if free else tuple(description.inputs)


class Feedthrough:
    """Direct dependencies in a set of connected FMUs; BadInput where they form an algebraic loop.

    driven: the inputs that change during a run, connected or given from outside.
    """

    def __init__(
        self, descriptions: Mapping[str, FmuDescription], links: Sequence[Link], driven: Iterable[Address]
    ) -> None:
        self._descriptions, self._driven = descriptions, set(driven)
        self._into = {link.target: link.source for link in links if not link.delayed}
        self._ranks: dict[Address, int] = {}
        for source in dict.fromkeys(self._into.values()):
            self.rank(source)

    def rank(self, variable: Address) -> int:
        """0 for a variable that is known from the states alone, 1 above all that it depends on for others."""
        return self._rank(variable, [])

    def _rank(self, variable: Address, path: list[Address]) -> int:
        """path: the inputs and outputs that led here, against the flow."""
        if variable in path:
            self._refuse([*path[path.index(variable) :], variable])
        if variable not in self._ranks:
            inputs = direct_inputs(self._descriptions[variable.fmu], variable.variable)
            found = [Address(variable.fmu, name) for name in inputs]
            above = [1 + self._behind(i, [*path, variable]) for i in found if i in self._driven]
            self._ranks[variable] = max(above, default=0)
        return self._ranks[variable]

    def _behind(self, target: Address, path: list[Address]) -> int:
        source = self._into.get(target)
        return self._rank(source, [*path, target]) if source else 0

    def _refuse(self, path: list[Address]) -> None:
        loop = [str(step) for step in reversed(path)]
        silent = sorted({a.fmu for a in path if not self._descriptions[a.fmu].dependencies})
        assumed = f" ({', '.join(silent)}: assumed, as the FMU states no dependencies)" if silent else ""
        raise BadInput(
            f"algebraic loop {' -> '.join(loop)}{assumed}: each follows the one before at once; give "
            "one of the connections delayed=True, which takes its value from the step before"
        )


def passes(
    members: Sequence[str],
    feedthrough: Feedthrough,
    sources: Mapping[str, Sequence[str]],
    read: Mapping[str, Sequence[str]],
) -> list[str]:
    """In which order to set the inputs of FMUs and read them again at a common time; [] where none needs it.

    sources: variables by FMU on which others depend; read: all that is wanted. An FMU comes more than once
    where others need one of its outputs to compute an input of another of its outputs.
    """
    found: set[tuple[int, int]] = set()
    for place, name in enumerate(members):
        needed = {feedthrough.rank(Address(name, v)) for v in sources[name]}
        last = max((feedthrough.rank(Address(name, v)) for v in (*read[name], *sources[name])), default=0)
        found |= {(rank, place) for rank in needed | {last} if rank}
    return [members[place] for _, place in sorted(found)]
