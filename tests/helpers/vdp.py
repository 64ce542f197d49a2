"""An FMI 3.0 FMU in C of the van der Pol oscillator, and the same in Python."""

import numpy as np
from scipy.integrate import solve_ivp

from tests.helpers.packed_fmu import FOLDER, build_packed

OUTPUTS = ["x0", "x1", "x1_dot"]
ERROR = 1e-9  # of Runge-Kutta steps of 1 ms over some seconds, against the solution
SOURCE = FOLDER / "vdp_fmi3.c"
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="VanDerPol" instantiationToken="{vdp-of-the-tests}">
  <CoSimulation modelIdentifier="vdp" canHandleVariableCommunicationStepSize="true"
    canGetAndSetFMUState="true" canSerializeFMUState="true"/>
  <UnitDefinitions>
    <Unit name="s"><BaseUnit s="1"/></Unit>
    <Unit name="m"><BaseUnit m="1"/></Unit>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions><Float64Type name="Speed" unit="m/s" min="-50" max="50" nominal="3"/></TypeDefinitions>
  <DefaultExperiment startTime="0" stopTime="20" stepSize="0.01"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous" unit="s"/>
    <Float64 name="x0" valueReference="1" causality="output" initial="exact" start="2" unit="m"
      nominal="2" description="displacement">
      <Alias name="position" description="the same"/>
    </Float64>
    <Float64 name="x1" valueReference="2" causality="output" initial="exact" start="0" declaredType="Speed"/>
    <Float64 name="x1_dot" valueReference="3" causality="output"/>
    <Float64 name="mu" valueReference="4" causality="parameter" variability="tunable" start="1.5"
      min="0" max="10"/>
    <Float64 name="u" valueReference="5" causality="input" start="0"/>
    <Float64 name="fault" valueReference="6" causality="parameter" variability="fixed" start="0"/>
    <UInt64 name="n" valueReference="7" causality="structuralParameter" start="3"/>
    <Float64 name="table" valueReference="8" causality="local">
      <Dimension valueReference="7"/>
    </Float64>
    <Float64 name="scale" valueReference="9" causality="structuralParameter" start="1"/>
    <Int32 name="count" valueReference="10" causality="local"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1"/>
    <Output valueReference="2"/>
    <Output valueReference="3"/>
    <InitialUnknown valueReference="3"/>
  </ModelStructure>
</fmiModelDescription>
"""


def build_vdp(compiler, folder, source=SOURCE):
    """Compile and pack it; the path of the FMU."""
    return build_packed(compiler, source, DESCRIPTION, folder / "VanDerPol.fmu")


def stirred(t):
    """An input that moves, (N-1,), for times t (N,)."""
    return np.sin(3 * t[:-1])


def solved(t, u, mu=1.5, x=(2.0, 0.0), damping=0.0, seen=None):
    """x0, x1, x1_dot at times t (N,) with inputs u (N-1,) held over each step, by scipy; (N, 3).

    seen: (N,) input that x1_dot sees; by default that of the step that ends.
    """

    def f(_, x, u):
        return [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0] + u - damping * x[1]]

    rows = [np.array(x)]
    for k, held in enumerate(u):
        end = solve_ivp(f, t[k : k + 2], rows[-1], args=(held,), method="DOP853", rtol=1e-11, atol=1e-12)
        rows.append(end.y[:, -1])
    if seen is None:
        seen = [u[0], *u]
    slopes = [f(0.0, x, now)[1] for x, now in zip(rows, seen, strict=True)]
    return np.column_stack([rows, slopes])
