"""`railfmi init`: draft an experiment from an FMU and a record."""

import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from fmus.errors import BadInput
from fmus.host.apart.isolation import ISOLATED, Isolation
from fmus.host.archive import describe
from scenarios.drawing.typography import aligned
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.record import load_record
from scenarios.output import unwritten, writable
from scenarios.preparing.clocks import with_clocks
from scenarios.preparing.draft import Draft, Signal, doubtful, draft, sure, with_column
from scenarios.preparing.survey import Raster, lines_left_out, survey
from scenarios.preparing.text import toml_of
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NONE = "-"  # the answer that leaves a variable without a column
# question, answers, default -> answer
Ask = Callable[[str, Sequence[str], str], str]
During = Callable[[str], AbstractContextManager[object]]


@dataclass(frozen=True, repr=False)
class Initialised(Shown):
    """What was drafted, the file that holds it, and the files that it was drafted from."""

    file: Path
    draft: Draft
    records: tuple[Path, ...] = ()

    def lines(self) -> list[str]:
        """The mapping as a table, and what was found beside it."""
        d = self.draft
        lines = [r.span + _by_name(r) for r in (d.raster, *d.others)]
        lines += [said for r in (d.raster, *d.others) for said in r.left_out]
        rows = [("FMU variable", "", "column", "unit", "unit in the FMU", "how sure")]
        rows += [
            (s.variable.name, str(s.variable.causality), d.column_of(s), _stated(s),
             s.variable.unit or f"{s.model_unit or 'not stated'} (guess)",
             f"{sure(s.likeness)}, {s.likeness:.0%}")
            for s in d.signals
        ]  # fmt: skip
        lines += aligned(rows)
        for r in d.others:
            clock = d.clock(r)
            said = (
                f"offset = {clock.offset!r} s, {clock.found}"
                if clock.found
                else "offset not found; write it into the file"
            )
            lines.append(
                f"clock of {d.name(r)} ({1 / r.step:.4g} Hz; record {1 / d.raster.step:.4g} Hz): {said}"
            )
        for port in d.ports:
            far = f", displacement {port.displacement}" if port.displacement else ", no displacement"
            lines.append(f"port '{port.name}': force {port.force}, velocity {port.velocity}{far}")
        for name, s in d.rates.items():
            lines.append(
                f"input '{name}' is the rate of {s.variable.name}: the derivative of '{s.channel.name}'"
            )
        for v in d.free_inputs:
            lines.append(f"input '{v.name}' has no column; it is constant at {v.start or 0.0:g}")
        used = {s.raster.file for s in d.signals}
        for file in (f for f in self.records if f not in used):
            lines.append(f"{file.name} is not used: none of its columns looks like a further variable")
        if d.unused:
            lines.append(f"columns that are not used: {', '.join(d.unused)}")
        return lines

    def to_frame(self) -> pd.DataFrame:
        """A row for each variable of the FMU that has a column; likeness is between 0 and 1."""
        d = self.draft
        rows = {
            s.variable.name: {
                "causality": s.variable.causality, "column": d.column_of(s), "unit": s.unit,
                "model_unit": s.variable.unit or s.model_unit, "likeness": s.likeness,
            }
            for s in d.signals
        }  # fmt: skip
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("variable")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """How much each column looks like the variable that it was taken for."""
        drawn, d = axes_or_new(ax), self.draft
        names = [f"{s.variable.name}: {d.column_of(s)}" for s in d.signals]
        drawn.barh(names, [s.likeness for s in d.signals])
        drawn.set(xlim=(0, 1), xlabel="how sure the match is")
        return drawn


def _by_name(r: Raster) -> str:
    """What was guessed of how a file is to be read."""
    return "; ".join([f", in {r.time_unit} by its name" if r.time_unit else "", *lines_left_out(r.options)])


def _stated(s: Signal) -> str:
    """The unit of a column as its file states it, and whether it is known."""
    stated = s.channel.unit
    if s.unit:
        return f"{s.unit} (guess)" if s.by_name else s.unit
    return f"{stated} (not known)" if stated else "not stated"


def init(
    fmu: str | Path,
    data: str | Path | Sequence[str | Path],
    out: str | Path = ".",
    time: str | None = None,
    ask: Ask | None = None,
    force: bool = False,
    isolation: Isolation | None = ISOLATED,
    during: During = nullcontext,
) -> Initialised:
    """Write a commented experiment.toml that `close-loop` accepts.

    data: the file of the record, or those of several loggers with clocks of their own; how far these are
    apart is found by their dates or by a simulation, and written as a guess. out: folder of the file.
    time: the time column of the first file, by default it is looked for. ask: asks a user about what is not
    sure; None takes the likeliest. force: whether an existing experiment.toml may be replaced. isolation:
    limits of the process in which a foreign FMU is simulated. during: makes a context in which work is done
    that may take seconds, of a text that says what it is.
    Raises BadInput if nothing in the record looks like an output of the FMU.
    """
    model, folder = Path(fmu), Path(out).absolute()
    records = [Path(data)] if isinstance(data, str | Path) else [Path(d) for d in data]
    file = folder / "experiment.toml"
    if file.exists() and not force:
        raise BadInput(f"{file}: exists already; give another --out, or --force to replace it")
    description = describe(model)
    with during("reading the record"):
        rasters = [r for i, record in enumerate(records) for r in survey(record, None if i else time)]
    made = draft(model, description, rasters)
    if ask is not None:
        made = _asked(made, ask)
    if not made.outputs:
        raise BadInput(
            f"{', '.join(map(str, records))}: no column looks like an output of {model.name} "
            f"({', '.join(description.outputs)}); {_columns(made)}; rename one, or "
            "run the command on a terminal, where it asks"
        )
    with during("finding how far the clocks of the files are apart"):
        made = with_clocks(made, isolation)
    text = toml_of(made, writable(folder))
    part = file.with_name(f".{file.name}.{os.getpid()}")
    try:
        part.write_text(text, encoding="utf-8")
        load_record(load_experiment(part), description)  # what is written must be accepted by close-loop
        part.replace(file)
    except BadInput as error:
        part.replace(file)
        said = str(error).replace(str(part), str(file))
        raise BadInput(f"{file} was written, but has to be completed by hand: {said}") from error
    except OSError as error:
        raise unwritten(error, folder) from error
    finally:
        part.unlink(missing_ok=True)
    return Initialised(file, made, tuple(records))


def _columns(made: Draft) -> str:
    if made.columns:
        return f"the columns are {', '.join(made.columns)}"
    return "no column beside the time holds numbers in enough rows"


def _asked(made: Draft, ask: Ask) -> Draft:
    """The draft after questions about each signal that is not sure, and each output without a column."""
    for s in doubtful(made):
        answers = [*made.columns]
        question = f"column of {s.variable.causality} '{s.variable.name}' ({NONE} for none)"
        answer = ask(question, [*answers, NONE], made.column_of(s))
        made = with_column(made, s.variable.name, None if answer == NONE else answer)
    taken = {s.variable.name for s in made.signals}
    for name in made.description.outputs:
        if name not in taken and made.unused:
            answer = ask(f"column of output '{name}' ({NONE} for none)", [*made.unused, NONE], NONE)
            made = with_column(made, name, None if answer == NONE else answer)
    return made
