"""Simulation of an FMU by ecos (C++, FMI 1 to 3), in a process of its own that is told when to begin."""

import ctypes
import json
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, files, version
from pathlib import Path

import numpy as np

from estimator.record import Array

MARK = "measured "


def installed() -> bool:
    """Whether ecos can be used here."""
    try:
        return bool(version("ecospy") and version("tbb"))
    except PackageNotFoundError:
        return False


class EcosProcess:
    """A process that simulates an FMU each time it is asked; an error of ecos cannot end ours."""

    def __init__(
        self, fmu: Path, dt: float, steps: int, start: Mapping[str, float], outputs: Sequence[str]
    ) -> None:
        given = [str(fmu), repr(dt), str(steps), json.dumps(dict(start)), *outputs]
        self.process = subprocess.Popen(
            [sys.executable, "-m", __spec__.name, *given],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def simulate(self) -> tuple[float, Array]:
        """Processor time of the steps with their outputs, s, and the last outputs."""
        if self.process.stdin is None or self.process.stdout is None:
            raise RuntimeError("ecos was started without pipes")
        self.process.stdin.write("go\n")
        self.process.stdin.flush()
        for line in self.process.stdout:
            if line.startswith(MARK):
                took, *last = map(float, line.removeprefix(MARK).split())
                return took, np.array(last)
        raise RuntimeError(f"ecos ended with exit code {self.process.wait()}")

    def close(self) -> None:
        """End the process."""
        self.process.communicate()


def serve(path: str, dt: float, steps: int, start: Mapping[str, float], outputs: Sequence[str]) -> None:
    """Simulate once for each line of the standard input."""
    # ecospy's library is linked to TBB but does not bring it; the package tbb does
    tbb = next(f.locate() for f in files("tbb") or [] if f.name == "libtbb.so.12")
    ctypes.CDLL(str(tbb), mode=ctypes.RTLD_GLOBAL)
    from ecospy.EcosSimulation import EcosSimulation  # type: ignore[import-not-found]
    from ecospy.EcosSimulationStructure import EcosSimulationStructure  # type: ignore[import-not-found]

    for _ in sys.stdin:
        with EcosSimulationStructure() as structure:
            structure.add_model("it", path)
            structure.add_parameter_set("start", {f"it::{n}": v for n, v in start.items()})
            with EcosSimulation(structure=structure, step_size=dt) as simulation:
                simulation.init(parameter_set="start")
                begun = time.process_time()
                for _ in range(steps):
                    simulation.step()
                    row = [simulation.get_real(f"it::{n}") for n in outputs]
                took = time.process_time() - begun
        print(MARK + " ".join(map(repr, [took, *row])), flush=True)


if __name__ == "__main__":
    where, step, count, values, *names = sys.argv[1:]
    serve(where, float(step), int(count), json.loads(values), names)
