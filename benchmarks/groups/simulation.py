"""A free simulation by Fmu.simulate, beside FMPy's `simulate_fmu` and ecos."""

from collections.abc import Iterator

import numpy as np

from benchmarks.group import Group, Row, Work, agreed
from benchmarks.peers.ecos import EcosProcess, installed
from benchmarks.peers.fmpy_simulation import FmpySimulation
from benchmarks.timing import Times, in_turns, seconds
from estimator.record import Array
from fmus.host.fmu import Fmu

DT = 1e-3  # s
SAME = 1e-9  # of the largest value of an output: the clocks of the tools round differently
FMPY, ECOS = "FMPy simulate_fmu", "ecos (C++, ecospy)"
SAID = {"native": "native FMU", "PythonFMU": "PythonFMU build"}
OUTPUTS = {
    "testrig": ["omega_w", "omega_r"],
    "vehicle7dof": ["z1", "phi_y1", "phi_x1"],
    "wheelset": ["y", "psi", "y_dot", "psi_dot"],
}
STARTS = {  # where ecos begins, which is given no inputs
    "testrig": {"omega_w": 12.16, "omega_r": 9.36, "T_P": 300.0, "f_sync": 7.5},
    "vehicle7dof": {"z1": 0.01},
    "wheelset": {"y": 2e-3, "psi": 1e-4},
}


def driven(model: str, t: Array) -> dict[str, Array]:
    """Inputs (N,): a wavy torque of the rig, or track with a wavelength of 12 m at 40 m/s."""
    w = 2 * np.pi * 40 / 12
    wave = {"": 2e-3 * np.sin(w * t), "_dot": 2e-3 * w * np.cos(w * t)}
    if model == "testrig":
        return {"T_P": 300.0 + 50.0 * np.sin(w * t), "f_sync": np.full(len(t), 7.5)}
    name = "y_irr" if model == "wheelset" else "u_fl"
    return {name + ending: values for ending, values in wave.items()}


class SimulationGroup(Group):
    """Communication steps of 1 ms; the FMU stays open, so that unpacking and loading are not timed."""

    name = "simulation"

    def measure(self, work: Work) -> Iterator[Row]:
        """See Group."""
        t = np.arange(work.of(4000, 200) + 1) * DT
        for model in OUTPUTS:
            for build in ("native", "PythonFMU"):
                yield beside_fmpy(work, model, build, t)
            yield beside_ecos(work, model, t)


def beside_fmpy(work: Work, model: str, build: str, t: Array) -> Row:
    """The same inputs, held over each step, and the same outputs."""
    path, inputs, outputs = work.fmu(model, build), driven(model, t), OUTPUTS[model]
    start = {n: v for n, v in STARTS[model].items() if n not in inputs}
    held = {n: u[:-1] for n, u in inputs.items()}
    peer = FmpySimulation(path, work.folder / f"fmpy_{model}_{build}")
    with Fmu(path) as fmu:
        found, other = (s.simulate(t, u, outputs, start) for s, u in ((fmu, held), (peer, inputs)))
        agreed(found, other, SAME, f"{model}, {build}, {FMPY}")
        times = in_turns(
            {
                "ours": lambda: fmu.simulate(t, held, outputs, start),
                FMPY: lambda: peer.simulate(t, inputs, outputs, start),
            },
            work.of(9, 3),
        )
    peer.close()
    how = f"{SAID[build]}, {len(inputs)} sampled inputs, {len(outputs)} outputs, steps of 1 ms; per step"
    return times.row(
        f"{model}: simulation, {SAID[build]}", "ours", FMPY, "µs", how, factor=1e6 / (len(t) - 1)
    )


def beside_ecos(work: Work, model: str, t: Array) -> Row:
    """Without inputs; the outputs are read after every step."""
    path, outputs, start, steps = work.fmu(model), OUTPUTS[model], STARTS[model], len(t) - 1
    how = f"native FMU, no sampled inputs, {len(outputs)} outputs, steps of 1 ms; per step"
    with Fmu(path) as fmu:

        def ours() -> Array:
            return fmu.simulate(t, {}, outputs, start)

        if not installed():
            alone = in_turns({"ours": ours}, work.of(9, 3)).by_label["ours"]
            cost = float(np.median(alone)) / steps * 1e6
            missing = f"{how}; ecospy and tbb are not installed, pip install '.[interop]' brings them"
            return Row(f"{model}: simulation, native FMU", cost, ECOS, None, None, "µs", missing)
        peer = EcosProcess(path, DT, steps, start, outputs)
        durations: dict[str, list[float]] = {"ours": [], ECOS: []}
        agreed(ours()[-1], peer.simulate()[1], SAME, f"{model}, {ECOS}")
        for _ in range(work.of(9, 3)):
            durations["ours"].append(seconds(ours))
            durations[ECOS].append(peer.simulate()[0])
        peer.close()
    times = Times({label: np.array(values) for label, values in durations.items()})
    return times.row(f"{model}: simulation, native FMU", "ours", ECOS, "µs", how, factor=1e6 / steps)
