"""What a car body on bogies is declared with, alone or in a vehicle."""

from fmus.bogie.declared import BODY, body_variables
from fmus.bogie.running_gear import BENCHMARK
from fmus.carbody.equations import BODY_AT
from fmus.variables import Parameter, Variable

PARAMETERS: dict[str, Variable] = {
    "I_cx": Parameter("kg.m2", 56800.0, min=1.0, doc="roll inertia of the car body", source=BENCHMARK),
    "I_cz": Parameter("kg.m2", 1.97e6, min=1.0, doc="yaw inertia of the car body", source=BENCHMARK),
    "l": Parameter("m", 9.5, min=0.1, doc="half the distance of the bogies", source=BENCHMARK),
}


def car_body() -> dict[str, Variable]:
    """States, accelerations, ports and parameters of the body."""
    sizes = {"y": (3e-3, 0.03), "psi": (5e-4, 5e-3), "phi": (5e-3, 0.02)}
    coordinates = {q: (unit, meaning, *sizes[q]) for q, (unit, meaning, *_) in BODY.items()}
    return body_variables(coordinates, BODY_AT, "the car body") | PARAMETERS
