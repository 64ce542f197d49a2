"""Loops in a package that exist only because an FMU does not say on what its outputs depend.

Such an output is taken to follow all inputs at once, and the master refuses a loop of outputs that follow
one another at once. Other tools exchange all values once a step and run such a package; a connection that
takes its value one step late does the same.
"""

from collections.abc import Mapping, Sequence
from graphlib import CycleError, TopologicalSorter

from fmus.export.ssp import Link
from fmus.host.description import FmuDescription
from fmus.host.master.feedthrough import direct_inputs


def late_links(links: Sequence[Link], fmus: Mapping[str, FmuDescription]) -> list[Link]:
    """Connections to take one step late, so that no loop is left that is only assumed.

    Loops of FMUs that all state their dependencies stay: the master refuses them with the loop.
    """
    left, late = list(links), list[Link]()
    while loop := _loop(left, fmus):
        assumed = [link for link in loop if not fmus[link.target[0]].dependencies]
        if not assumed:
            break
        late.append(min(assumed, key=links.index))
        left.remove(late[-1])
    return late


def _loop(links: Sequence[Link], fmus: Mapping[str, FmuDescription]) -> list[Link]:
    """Connections of which each follows another one at once, in a circle; [] where there is none."""
    into = {link.target: k for k, link in enumerate(links)}
    behind = TopologicalSorter[int]()
    for k, link in enumerate(links):
        name, output = link.source
        known = output in fmus[name].variables
        inputs = direct_inputs(fmus[name], output) if known else ()
        behind.add(k, *(into[name, i] for i in inputs if (name, i) in into))
    try:
        behind.prepare()
    except CycleError as error:
        return [links[k] for k in error.args[1][1:]]
    return []
