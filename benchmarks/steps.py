"""Computing time of a step of the test rig: CasADi alone, its FMU by variable names, and Fmu.simulate.

Run: make bench. Figures are medians over rounds in which the variants alternate, so that changes of the
machine's speed affect all of them. The ratios are meaningful, the absolute times depend on the machine.
"""

import tempfile
import time
from array import array
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fmus.export.builders.pythonfmu import build_python
from fmus.export.runtime.stepping import Stepper
from fmus.host.fmu import Fmu
from fmus.model import equations
from fmus.testrig.model import Testrig
from fmus.variables import Parameter

STEPS, ROUNDS, DT = 4000, 7, 5e-3
START = {"omega_w": 12.16, "omega_r": 9.36}


def plain() -> Callable[[], None]:
    """The compiled step function alone, on preallocated memory."""
    model = Testrig()
    x = array("d", [*START.values(), 0.0, 0.0])
    u, p = array("d", [300.0, 7.5, 0.0, 0.0]), array("d", [v.start for v in model.of(Parameter)])
    stepper = Stepper(equations(model).step, *map(memoryview, (x, u, p)), Testrig.step_size)

    def run() -> None:
        for _ in range(STEPS):
            stepper.advance(DT)

    return run


def by_name(rig: Fmu) -> Callable[[], None]:
    """Fmu.step and Fmu.read, as a script would use them."""

    def run() -> None:
        rig.restart(**START)
        for _ in range(STEPS):
            rig.step(DT, T_P=300.0, f_sync=7.5)
            rig.read(["omega_w", "omega_r"])

    return run


def in_loop(rig: Fmu) -> Callable[[], None]:
    """Fmu.simulate, as close-loop uses it."""
    t = np.arange(STEPS + 1) * DT
    inputs = {"T_P": np.full(STEPS, 300.0), "f_sync": np.full(STEPS, 7.5)}

    def run() -> None:
        rig.simulate(t, inputs, ["omega_w", "omega_r"], START)

    return run


def restarts(rig: Fmu) -> Callable[[], None]:
    """A restart and one step, as a filter needs for each sigma point."""

    def run() -> None:
        for _ in range(STEPS):
            rig.restart(**START)
            rig.step(DT)

    return run


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder, Fmu(build_python(Testrig(), Path(folder))) as rig:
        ways = {
            "CasADi step alone": plain(),
            "FMU, host's loop": in_loop(rig),
            "FMU, by names": by_name(rig),
            "FMU, restart + step": restarts(rig),
        }
        times: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(ROUNDS):
            for name, run in ways.items():
                begun = time.perf_counter()
                run()
                times[name].append((time.perf_counter() - begun) / STEPS * 1e6)
    base = np.array(times["CasADi step alone"])
    print(f"test rig, communication step {DT * 1e3:g} ms, medians of {ROUNDS} rounds of {STEPS} steps")
    for name, us in times.items():
        ratio = np.median(np.array(us) / base)
        print(f"{name:22} {np.median(us):7.1f} µs per step  {ratio:5.1f} times CasADi alone")


if __name__ == "__main__":
    main()
