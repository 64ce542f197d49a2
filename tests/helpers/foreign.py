"""FMUs of another hand, made with PythonFMU alone: good ones and each kind of bad one."""

import re
import sys
import textwrap

from pythonfmu.builder import FmuBuilder

from tests.helpers.packed import with_description

SLAVE = '''
"""An FMU of another hand: x' = -k x + u."""
import math, os, signal, sys, time, types
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from pythonfmu.enums import Fmi2Initial

SHARED = sys.modules.setdefault("shared_by_{name}", types.SimpleNamespace(x=1.0, made=0))


class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.x, self.u, self.k, self.h = 1.0, 0.0, 2.0, 0.0
        self.register_variable(Real("x", causality=Fmi2Causality.output, initial=Fmi2Initial.{initial}))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        tunable = dict(causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
        self.register_variable(Real("k", **tunable))
        SHARED.made += 1

    def do_step(self, t, dt):
{step}
        return True

{more}
'''
GOOD = "self.x += dt * (self.u - self.k * self.x)"
HIDDEN = "self.h += dt * self.x\nself.x += dt * (self.u - self.k * self.x - self.h)"
AT_START = "def enter_initialization_mode(self):\n    {}"


def foreign_builder(folder):
    """A function that builds an FMU in a folder from the body of its step and what else its class has."""
    number = iter(range(1000))

    def build(step=GOOD, more="", initial="exact", **options):
        name = f"Foreign{next(number)}"
        source = folder / f"{name.lower()}.py"
        body = {"step": textwrap.indent(step, " " * 8), "more": textwrap.indent(more, " " * 4)}
        source.write_text(SLAVE.format(name=name, initial=initial, **body))
        path = sys.path.copy()
        built = FmuBuilder.build_FMU(source, folder / f"{name}.fmu", **options)
        sys.path[:] = path
        del sys.modules[source.stem]
        if initial == "calculated":
            kept = b'<ModelStructure>\\1<InitialUnknowns><Unknown index="1"/></InitialUnknowns>'
            target = folder / f"{name}_calculated.fmu"
            built = with_description(built, target, rb"<ModelStructure>(.*?</Outputs>)", kept, re.DOTALL)
        return built

    return build
