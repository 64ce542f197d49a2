"""The report of the norm's test: both steps as JSON, CSV and a page."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd

from scenarios.conicity.norm.measuring import Instrument
from scenarios.conicity.norm.steps import ExactRow, MeasuredRow
from scenarios.drawing.pages import rendered
from scenarios.drawing.typography import NOTHING
from scenarios.output import written

HOME = Path(__file__).parents[1]  # of the templates

MICRO = 1e6


@dataclass(frozen=True)
class NormReport:
    """Rows of both steps, and with what errors the points were measured and by what they were read."""

    exact: Sequence[ExactRow]
    measured: Sequence[MeasuredRow]
    instrument: Instrument
    reader: str

    @property
    def ok(self) -> bool:
        """Whether all that could be judged is inside its window."""
        return all(row.passed for row in self.exact) and all(row.passed for row in self.measured)

    @property
    def steps(self) -> dict[str, list[dict[str, Any]]]:
        """The rows of both steps by the names of their files."""
        return {
            "step1": [{**asdict(row), "passed": row.passed} for row in self.exact],
            "step2": [{**asdict(row), "passed": row.passed} for row in self.measured],
        }

    def result(self) -> dict[str, Any]:
        """The contents of norm.json."""
        settings = {name: getattr(self.instrument, name) for name in ("random", "grid", "spacing", "seed")}
        return {"ok": self.ok, "reader": self.reader, **settings, **self.steps}

    def write(self, folder: Path, command: str) -> None:
        """Write norm.json, step1.csv, step2.csv and norm.html into a folder."""
        text = json.dumps(self.result(), indent=1, ensure_ascii=False, allow_nan=False)
        written(folder / "norm.json", f"{text}\n")
        for name, rows in self.steps.items():
            if rows:
                written(folder / f"{name}.csv", pd.DataFrame(rows).to_csv(index=False, float_format="%.6g"))
        page = rendered(
            HOME,
            "norm/norm.html.j2",
            version=version("railfmi"),
            headline=self.headline,
            ok=self.ok,
            exact=[_exact(row) for row in self.exact],
            measured=[_measured(row) for row in self.measured],
            instrument=self.instrument,
            micro=MICRO,
            reader=self.reader,
            draws=max((row.draws for row in self.measured), default=0),
            command=command,
        )
        written(folder / "norm.html", page)

    @property
    def headline(self) -> str:
        """The verdict in one sentence."""
        judged = [row for row in self.exact if row.inside is not None]
        passed = sum(row.passed for row in judged)
        first = f"Step 1: {passed} of {len(judged)} pairs with a table are inside its tolerance"
        if not self.measured:
            return first
        return f"{first}; step 2: {sum(row.passed for row in self.measured)} of {len(self.measured)} inside"

    def lines(self) -> Iterator[str]:
        """Lines to print."""
        yield self.headline
        for row in self.exact:
            told = _exact(row)
            if row.inside is None:
                yield f"  step 1, {row.pair}: no table"
            else:
                yield f"  step 1, {row.pair}: {told['inside']} inside, largest deviation {told['largest']}"
        for measured in self.measured:
            told = _measured(measured)
            what = f"{measured.pair}, {measured.error}, {measured.place}"
            yield f"  step 2, {what}: {told['draws']} draws inside, largest deviation {told['largest']}"


def _exact(row: ExactRow) -> dict[str, object]:
    """A row of step 1 in words."""
    none = row.inside is None
    return {
        "pair": row.pair,
        "passed": row.passed,
        "inside": "no table" if none else f"{row.inside} of {row.amplitudes}",
        "largest": NOTHING if row.largest is None else f"{row.largest:.4f} at {row.at:g} mm",
        "at_3": NOTHING if row.at_3 is None else f"{row.at_3:.3f}",
        "close": NOTHING if row.dr_close is None else f"{row.dr_close} of {row.dr_points}",
        "dr": NOTHING if row.dr_largest is None else f"{row.dr_largest:.4f} at {row.dr_at:g} mm",
    }


def _measured(row: MeasuredRow) -> dict[str, object]:
    """A row of step 2 in words."""
    return {
        "pair": row.pair,
        "error": row.error,
        "place": row.place,
        "passed": row.passed,
        "draws": f"{row.draws_inside} of {row.draws}",
        "inside": f"{100 * row.inside / row.values:.1f}",
        "extended": f"{100 * row.extended / row.values:.1f}",
        "largest": f"{row.largest:.3f} at {row.at:g} mm",
        "mean": f"{row.mean:.3f}",
        "std": f"{row.std:.3f}",
    }
