"""EMPS: a linear drive with a motor and a carriage; the model (fmus.drive) has viscous friction only."""

from pathlib import Path

import scenarios
from benchmarks.measured.benchmark import Benchmark, as_they_are
from fmus.drive.model import Drive

BENCHMARK = Benchmark(
    name="emps",
    title="EMPS",
    model=Drive,
    declaration=Path(scenarios.__path__[0]) / "shipped" / "emps" / "experiment.toml",
    files=dict.fromkeys(("emps_train.csv", "emps_test.csv"), as_they_are),
    missing="Coulomb friction and a constant force",
    known=frozenset({("coulomb_friction", "carriage"), ("constant_force", "carriage")}),
    source="A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, Workshop on Nonlinear "
    "System Identification Benchmarks, Eindhoven 2019",
    target={"q_dot": 6.5e-3},
    rank=2,
)
