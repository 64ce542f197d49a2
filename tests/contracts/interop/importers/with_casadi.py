"""CasADi, which reads FMUs of model exchange by its DaeBuilder."""

import zipfile
from pathlib import Path

import numpy as np

from tests.contracts.interop.importer import SOLVED, Case, Importer

TIGHT = {"reltol": 1e-10, "abstol": 1e-10}  # of CVodes


class Casadi(Importer):
    name = "CasADi"
    about = "C++; its DaeBuilder gives the equations of an FMU to CVodes"
    reads = frozenset({("ME", 2), ("ME", 3)})
    packages = ("casadi",)
    solver = "cvode"
    tolerance = SOLVED
    remark = "asks for derivatives and outputs by two functions: one function refuses a variable that is both"

    def run(self, case: Case, folder: Path) -> list[list[float]]:
        import casadi as cs

        with zipfile.ZipFile(case.fmu) as packed:
            packed.extractall(folder)
        dae = cs.DaeBuilder("it", str(folder))
        for name, value in case.start.items():
            dae.set_start(name, value)
        derivatives = dae.create("f", ["x", "u"], ["ode"])  # parameters keep their start values
        outputs = dae.create("h", ["x", "u"], ["y"])
        x0, u = (cs.DM([float(np.ravel(dae.start(n))[0]) for n in names]) for names in (dae.x(), dae.u()))
        x = cs.MX.sym("x", len(dae.x()))
        times = [case.step * (k + 1) for k in range(case.steps)]
        integrated = cs.integrator("F", "cvodes", {"x": x, "ode": derivatives(x, u)}, 0, times, TIGHT)
        states = integrated(x0=x0)["xf"].full()
        order = [dae.y().index(n) for n in case.outputs]
        return [outputs(column, u).full().ravel()[order].tolist() for column in states.T]
