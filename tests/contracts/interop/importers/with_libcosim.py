"""libcosim of the Open Simulation Platform by its Python package libcosimpy."""

from pathlib import Path

from tests.contracts.interop.importer import Case, Importer


class Libcosim(Importer):
    name = "libcosim"
    about = "C++ around the FMI Library"
    reads = frozenset({("CS", 2)})
    packages = ("libcosimpy",)
    remark = "version 0.0.6 of libcosimpy ends the process at any FMI 3.0 file"

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        from libcosimpy.CosimExecution import CosimExecution
        from libcosimpy.CosimObserver import CosimObserver
        from libcosimpy.CosimSlave import CosimLocalSlave

        execution = CosimExecution.from_step_size(round(case.step * 1e9))  # ns
        index = execution.add_local_slave(CosimLocalSlave(case.fmu, "it"))
        references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
        for name, value in case.start.items():
            execution.real_initial_value(index, references[name], value)
        observer = CosimObserver.create_last_value()
        execution.add_observer(observer)
        wanted, rows = [references[n] for n in case.outputs], []
        for _ in range(case.steps):
            execution.step()
            rows.append(list(observer.last_real_values(index, wanted)))
        return rows
