"""Computing time of the wheelset for each creep law: an internal step alone, and its PythonFMU simulated.

Run: python -m benchmarks.wheelset. Times are processor times of this process, as medians over rounds, for
communication steps of 1 ms over a wavy track at 40 m/s.
"""

import tempfile
import time
from array import array
from pathlib import Path

import numpy as np

from fmus.contact.forces.laws import LAWS
from fmus.export.builders.pythonfmu import build_python
from fmus.export.runtime.stepping import Stepper
from fmus.host.fmu import Fmu
from fmus.model import equations
from fmus.variables import Input, Parameter, State
from fmus.wheelset.model import Wheelset

DT, STEPS, ROUNDS = 1e-3, 500, 9
OUTPUTS = ["y", "psi", "y_dot", "psi_dot"]


def wavy() -> dict[str, np.ndarray]:
    """Alignment with an amplitude of 2 mm and a wavelength of 12 m at 40 m/s, at each step."""
    t, w = np.arange(STEPS + 1) * DT, 2 * np.pi * 40 / 12
    return {"y_irr": 2e-3 * np.sin(w * t), "y_irr_dot": 2e-3 * w * np.cos(w * t)}


def step_alone(law: float) -> list[float]:
    """Processor time of a compiled step of 1 ms in s, by round."""
    model = Wheelset()
    start = {"y": 2e-3, "psi": 1e-4, "creep_law": law}
    x, u, p = (
        array("d", [start.get(v.name, v.start) for v in model.of(kind)]) for kind in (State, Input, Parameter)
    )
    stepper = Stepper(equations(model).step, *map(memoryview, (x, u, p)), DT)
    found = []
    for _ in range(ROUNDS):
        begun = time.process_time()
        for _ in range(STEPS):
            stepper.advance(DT)
        found.append((time.process_time() - begun) / STEPS)
    return found


def in_loop(fmu: Fmu, law: float) -> list[float]:
    """Processor time of a communication step with two inputs and four outputs in s, by round."""
    t, inputs, found = np.arange(STEPS + 1) * DT, wavy(), []
    for _ in range(ROUNDS):
        begun = time.process_time()
        fmu.simulate(t, inputs, OUTPUTS, {"creep_law": law})
        found.append((time.process_time() - begun) / STEPS)
    return found


def main() -> None:
    """Measure and print."""
    print(f"wheelset, steps of {DT * 1e3:g} ms, medians of {ROUNDS} rounds of {STEPS} steps")
    print(f"{'creep law':16} {'step alone':>12} {'FMU':>12} {'simulated':>16}")
    with tempfile.TemporaryDirectory() as folder, Fmu(build_python(Wheelset(), Path(folder))) as fmu:
        for name, law in LAWS.items():
            alone = float(np.median(step_alone(float(law.code))))
            whole = float(np.median(in_loop(fmu, float(law.code))))
            print(f"{name:16} {alone * 1e6:9.1f} µs {whole * 1e6:9.1f} µs {DT / whole:10.1f} s per s")


if __name__ == "__main__":
    main()
