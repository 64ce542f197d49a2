"""The C sources of a model: CasADi's code for its functions, a header of its tables, the wrapper's files."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as cs
import fmpy
from jinja2 import Environment, FileSystemLoader

from fmus.export.builders.native.dependencies import stacked
from fmus.export.builders.native.lanes import has_vectors, lanes_of, widest
from fmus.export.builders.native.table import Table
from fmus.model import Equations
from fmus.variables import Expr

HERE = Path(__file__).parent
WRAPPER = (
    "fmu.c", "quick.c", "instance.h", "instance.c", "values.c", "stepping.c", "states.c", "derivatives.c",
    "lanes.c", "lanes.h", "lanes_rows.c",
)  # fmt: skip
INTERFACE = {2: ("fmi2.c",), 3: ("fmi3.c", "fmi3_absent.c")}
STANDARD = {  # headers of the standard, under its 2-clause BSD licence, as FMPy brings them
    2: ("fmi2TypesPlatform.h", "fmi2FunctionTypes.h", "fmi2Functions.h"),
    3: ("fmi3PlatformTypes.h", "fmi3FunctionTypes.h", "fmi3Functions.h"),
}


@dataclass(frozen=True)
class Work:
    """Lengths of the work vectors that suit every function."""

    arg: int
    res: int
    iw: int
    w: int


def sources(
    table: Table,
    made: Equations,
    fmi: int,
    token: str,
    working: bool = False,
    in_rows: bool = False,
    joins: bool = False,
    switched_by: Sequence[tuple[int, int]] = (),
    alone: cs.Function | None = None,
) -> dict[str, str]:
    """Text of each source file by name; `fmu.c` includes the others.

    working: for this machine and FMI 2.0 only, without derivatives, whose calls are refused; what the
    equations for several rows call is a unit of its own, `lanes_object.c`. in_rows: whether it is simulated
    in rows, so that the equations of one instance are compiled without optimisation. joins: whether a step
    may go over several samples, see lanes_joined.c. switched_by: see `Model.switched`; for each state the
    numbers of the parameters, from one to before another, that switch its law on. alone: see `step_alone`.
    """
    code, work = _equations(table.name, made, derivatives=not working)
    wrapper = {n: (HERE / "sources" / n).read_text(encoding="utf-8") for n in (*WRAPPER, *INTERFACE[fmi])}
    if working:
        wrapper["derivatives.c"] = (HERE / "sources" / "no_derivatives.c").read_text(encoding="utf-8")
        for name in ("lanes_object.c", "lanes_joined.c"):
            wrapper[name] = (HERE / "sources" / name).read_text(encoding="utf-8")
        wrapper["lanes.h"] = f"#define WIDTH {widest()}\n{wrapper['lanes.h']}"
    headers = Path(fmpy.__file__).parent / "c-code"
    standard = {n: (headers / n).read_text(encoding="utf-8") for n in STANDARD[fmi]}
    lanes = lanes_of([made.f, made.h, made.step, *([alone] if alone else [])])
    rows = {"lanes_equations.c": lanes.functions, "lanes_called.c": lanes.called} if lanes else {}
    header = _header(
        table,
        work,
        fmi,
        token,
        lanes=bool(lanes),
        working=working,
        joins=bool(lanes) and joins,
        in_rows=bool(lanes) and in_rows and has_vectors(),
        switched_by=switched_by,
        own_states=alone.size1_out(0) if alone else len(switched_by),
        runs=lanes.runs if lanes else (),
    )
    return {**wrapper, **standard, **rows, "equations.c": code, "model.h": header}


def _equations(name: str, made: Equations, derivatives: bool = True) -> tuple[str, Work]:
    """C code of f, h, step and, if wanted, derivatives of [x', y] by [x, u, p] along a direction and back."""
    functions = [made.f, made.h, made.step, *(_derivatives(made) if derivatives else ())]
    # the name begins that of every helper, so that two models can be linked together
    generator = cs.CodeGenerator(f"{name}_equations.c", {"casadi_int": "int"})
    for function in functions:
        generator.add(function)
    sizes = ([getattr(f, f"sz_{part}")() for f in functions] for part in ("arg", "res", "iw", "w"))
    return generator.dump(), Work(*(max(size) for size in sizes))


def _derivatives(made: Equations) -> list[cs.Function]:
    """Derivatives of [x', y] by [x, u, p], from a seed of one to a tangent of the other.

    forward(x, u, p, seed of [x, u, p]) -> of [x', y]; reverse(x, u, p, seed of [x', y]) -> of [x, u, p].
    """
    whole = stacked(made)
    kind: type[Expr] = cs.SX if whole.is_a("SXFunction") else cs.MX
    x, u, p = (kind.sym(n, made.f.size1_in(i)) for i, n in enumerate(("x", "u", "p")))
    found = []
    for name, seeds in (("forward", whole.size1_in(0)), ("reverse", whole.size1_out(0))):
        known, seed = kind.sym("known", whole.size1_in(0)), kind.sym("seed", seeds)
        product = cs.jtimes(whole(known), known, seed, name == "reverse")
        result: Expr = cs.Function("along", [known, seed], [product])(cs.vertcat(x, u, p), seed)
        result = cs.cse(result) if kind is cs.SX else result
        found.append(cs.Function(name, [x, u, p, seed], [cs.densify(result)]))
    return found


def _header(table: Table, work: Work, fmi: int, token: str, **about: object) -> str:
    templates = Environment(
        loader=FileSystemLoader(HERE), trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    facts = {
        "settable": table.entries[: sum(table.sizes[:3])],
        "nominals": [e.nominal or 1.0 for e in table.entries[: table.sizes[0]]],
        "c": _c,
        "quoted": quoted,
        "inf": math.inf,
    }
    template = templates.get_template("model.h.j2")
    return template.render(table=table, work=work, fmi=fmi, token=token, **facts, **about)


def _c(value: float | None, missing: float = math.nan) -> str:
    """A number in C, read back to the last bit."""
    number = missing if value is None else value
    return repr(float(number)) if math.isfinite(number) else ("-HUGE_VAL" if number < 0 else "HUGE_VAL")


def quoted(words: str) -> str:
    """A string of C; the name of a foreign variable may hold any character."""
    plain = (chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}" for b in words.encode())
    return f'"{"".join(plain)}"'
