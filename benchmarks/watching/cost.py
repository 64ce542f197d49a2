"""Processor time of the filter for a sample: the rig with two channels, and the vehicle with eighteen.

    python -m benchmarks.watching.cost

The vehicle has 14 states, hence 29 sigma points, and outputs that are read from the FMU. It stands still with
noisy sensors: the time of a sample does not depend on its numbers.
"""

import json
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.machine import described
from estimator.filters.carried import Carried, Rows
from estimator.filters.system import Joint, UnknownState
from estimator.filters.ukf import Ukf
from fmus.export.builders.hypotheses import build_quick
from fmus.models import model_class

DT = 1e-3  # s
WINDOW, WINDOWS = 1000, 5  # samples; the first window is not counted, as code is compiled in it
VEHICLE = (
    "z1_ddot", "phi_y1_ddot", "phi_x1_ddot", "z2_ddot", "phi_x2_ddot", "z3_ddot", "phi_x3_ddot",
    "d_s_fl", "d_s_fr", "d_s_rl", "d_s_rr", "d_p_fl", "d_p_fr", "d_p_rl", "d_p_rr",
    "z1_dot", "z2_dot", "z3_dot",
)  # fmt: skip
CORNERS = ("fl", "fr", "rl", "rr")
RIG = ("omega_w", "omega_r")


def microseconds(model: str, outputs: Sequence[str], inputs: Sequence[str], work: Path) -> float:
    """Processor time of a sample."""
    fmu = build_quick(model_class(model)(), work)
    rng = np.random.default_rng(1)
    with Joint(fmu, outputs, (), inputs=inputs, dt=DT) as probe:
        states = [UnknownState(n, 0.0, 1e-2, 1e-4) for n in probe.others if not n.startswith("theta")]
    with Joint(fmu, outputs, states, inputs=inputs, dt=DT) as joint:
        R = np.eye(len(outputs)) * 1e-4
        carried = Carried(lambda start: Ukf(joint, start, joint.noise, R, DT), DT)
        carried.anew(joint.start())
        spent = []
        for k in range(WINDOWS + 1):
            t = (k * WINDOW + np.arange(WINDOW)) * DT
            y = 1e-2 * rng.normal(size=(WINDOW, len(outputs)))
            begun = time.process_time()
            h, _ = carried.take(Rows(t, np.zeros((WINDOW, len(inputs))), y))
            spent.append(time.process_time() - begun)
            if h.broken:
                raise RuntimeError(h.broken)
    return 1e6 * float(np.median(spent[1:])) / WINDOW


def main() -> int:
    """Print the times and the machine."""
    with tempfile.TemporaryDirectory() as work:
        rails = [f"u_{c}{rate}" for c in CORNERS for rate in ("", "_dot")]
        found = {
            "vehicle, 18 channels": microseconds("vehicle7dof", VEHICLE, rails, Path(work)),
            "rig, 2 channels": microseconds("testrig", RIG, ("T_P", "f_sync"), Path(work)),
        }
    print(json.dumps({"microseconds a sample": found, "machine": described()}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
