"""fmuloader, bindings to all functions of an FMU; steps and Euler's method are written here."""

from pathlib import Path
from types import MappingProxyType
from typing import Any

from tests.contracts.interop.importer import Case, Importer

NEEDS = "needs the functions of model exchange, which an FMU of co-simulation alone has not"


class Fmuloader(Importer):
    name = "fmuloader"
    about = "Python; bindings alone, model exchange by Euler's method"
    reads = frozenset({("CS", 2), ("CS", 3), ("ME", 2), ("ME", 3)})
    packages = ("fmuloader", "fmpy")
    solver = "euler"
    fails = MappingProxyType({("python", "CS", 2): NEEDS})

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        from fmpy import read_model_description

        about = read_model_description(case.fmu)
        references = {v.name: v.valueReference for v in about.modelVariables}
        fmu = (_started2 if case.fmi == 2 else _started3)(case, about, references)
        read = fmu.get_real if case.fmi == 2 else fmu.get_float64
        wanted, rows = [references[n] for n in case.outputs], []
        for k in range(case.steps):
            if case.kind == "CS":
                fmu.do_step(k * case.step, case.step)
            else:
                _euler(fmu, case, k, about.numberOfContinuousStates)
            rows.append(read(wanted))
        fmu.terminate()
        fmu.free_instance()
        return rows


def _euler(fmu: Any, case: Case, k: int, n: int) -> None:
    derivatives = fmu.get_derivatives if case.fmi == 2 else fmu.get_continuous_state_derivatives
    x = [a + case.step * b for a, b in zip(fmu.get_continuous_states(n), derivatives(n), strict=True)]
    fmu.set_time((k + 1) * case.step)
    fmu.set_continuous_states(x)
    fmu.completed_integrator_step()


def _started2(case: Case, about: Any, references: dict[str, int]) -> Any:
    from fmuloader.fmi2 import Fmi2Slave, Fmi2Type

    mode = about.coSimulation if case.kind == "CS" else about.modelExchange
    fmu = Fmi2Slave(case.fmu, model_identifier=mode.modelIdentifier)
    kind = Fmi2Type.CO_SIMULATION if case.kind == "CS" else Fmi2Type.MODEL_EXCHANGE
    fmu.instantiate("it", kind, guid=about.guid)
    fmu.set_real([references[n] for n in case.start], list(case.start.values()))
    fmu.setup_experiment(0.0, case.stop)
    fmu.enter_initialization_mode()
    fmu.exit_initialization_mode()
    if case.kind == "ME":
        fmu.new_discrete_states()
        fmu.enter_continuous_time_mode()
    return fmu


def _started3(case: Case, about: Any, references: dict[str, int]) -> Any:
    from fmuloader.fmi3 import Fmi3Slave

    mode = about.coSimulation if case.kind == "CS" else about.modelExchange
    fmu = Fmi3Slave(case.fmu, model_identifier=mode.modelIdentifier)
    start = fmu.instantiate_co_simulation if case.kind == "CS" else fmu.instantiate_model_exchange
    start("it", instantiation_token=about.guid)
    fmu.set_float64([references[n] for n in case.start], list(case.start.values()))
    fmu.enter_initialization_mode(start_time=0.0, stop_time=case.stop)
    fmu.exit_initialization_mode()
    if case.kind == "ME":
        fmu.update_discrete_states()
        fmu.enter_continuous_time_mode()
    return fmu
