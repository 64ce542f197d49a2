"""FMPy."""

from pathlib import Path

from tests.contracts.interop.importer import SOLVED, Case, Importer

TIGHT = 1e-10  # relative tolerance of CVode


class Fmpy(Importer):
    name = "FMPy"
    about = "Python; model exchange by CVode"
    reads = frozenset({("CS", 2), ("CS", 3), ("ME", 2), ("ME", 3)})
    packages = ("fmpy",)
    solver = "cvode"
    tolerance = SOLVED

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        from fmpy import simulate_fmu

        found = simulate_fmu(
            case.fmu,
            stop_time=case.stop,
            output_interval=case.step,
            step_size=case.step,
            start_values=dict(case.start),
            output=case.outputs,
            fmi_type={"CS": "CoSimulation", "ME": "ModelExchange"}[case.kind],
            solver="CVode",
            relative_tolerance=TIGHT,
        )
        return [list(row)[1:] for row in found][1:]
