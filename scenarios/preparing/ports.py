"""Whether the ports of an experiment are what the laws of effects take them for."""

from collections.abc import Iterator

import numpy as np

from estimator.record import Run
from fmus.host.apart.isolation import Isolation
from fmus.host.fmu import Fmu, FmuError
from scenarios.experiment.declaration import Port
from scenarios.experiment.experiment import Experiment

STEPS = 20  # of the record, in which a force is to move a port


def port_remarks(
    e: Experiment, run: Run, inputs: tuple[str, ...], isolation: Isolation | None
) -> Iterator[str]:
    """A sentence for each port of a foreign FMU whose force does not raise its velocity.

    A law with a positive parameter opposes the velocity by its force. Where a positive force lowers the
    velocity, it would drive the motion instead, and no friction or damping could be found.
    """
    if e.fmu_path is None:
        return
    with Fmu(e.fmu_path, isolation) as fmu:
        for port in e.ports:
            try:
                moved = _moved(fmu, e, run, inputs, port)
            except (
                FmuError
            ):  # it does not bear the force; a run with the smaller forces of an effect may work
                continue
            if moved == 0.0:
                said = f"{port.force} does not move {port.velocity}; name the output that it moves"
                yield f"port '{port.name}': {said}"
            elif moved < 0:
                yield (
                    f"port '{port.name}': a positive {port.force} lowers {port.velocity}, so that friction "
                    "and damping cannot be found there; change the sign of one of them in the FMU"
                )


def _moved(fmu: Fmu, e: Experiment, run: Run, inputs: tuple[str, ...], port: Port) -> float:
    """How far the velocity of a port rises by its force within a few steps, summed over these."""
    some = slice(STEPS + 1)
    t, size = run.t[some], fmu.description.variables[port.force].nominal or 1.0
    given = {name: run.u[some, j] for j, name in enumerate(inputs)}
    at_rest = given.get(port.force, np.zeros(len(t)))
    start = {**e.parameters, **e.initial}
    without, pushed = (
        fmu.simulate(t, {**given, port.force: at_rest + force}, [port.velocity], start)[:, 0]
        for force in (0.0, size)
    )
    return float(np.sum(pushed - without))
