"""Simulation of an FMU by FMPy's `simulate_fmu`, with an instance that stays open between simulations."""

from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave

from estimator.record import Array


class FmpySimulation:
    """An FMU that is unpacked and instantiated once, as FMPy allows for repeated simulations."""

    def __init__(self, fmu: Path, folder: Path) -> None:
        self.description = read_model_description(str(fmu))
        self.folder = extract(str(fmu), unzipdir=str(folder))
        self.slave = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="peer",
        )
        self.slave.instantiate()

    def simulate(
        self, t: Array, inputs: Mapping[str, Array], outputs: Sequence[str], start: Mapping[str, float]
    ) -> Array:
        """Outputs (N, n_y) at evenly spaced times t (N,), from inputs (N,) that are held over each step."""
        dt = float(t[1] - t[0])
        columns = [("time", float), *((name, float) for name in inputs)]
        signals = np.array([*zip(t, *inputs.values(), strict=True)], dtype=columns) if inputs else None
        self.slave.reset()
        with redirect_stdout(StringIO()):  # it prints a line for every input without a signal
            found = simulate_fmu(
                self.folder, validate=False, start_time=float(t[0]), stop_time=float(t[-1]),
                output_interval=dt, fmi_type="CoSimulation", start_values=dict(start), input=signals,
                output=list(outputs), model_description=self.description, fmu_instance=self.slave,
                record_events=False,
            )  # fmt: skip
        return np.column_stack([found[name] for name in outputs])

    def close(self) -> None:
        """Free the instance."""
        self.slave.freeInstance()
