"""`railfmi report` as a function: the results of a folder as a list, a table and a page."""

import os
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from fmus.errors import BadInput
from scenarios.drawing.pages import rendered
from scenarios.drawing.typography import number
from scenarios.output import writable, written_at_once
from scenarios.reporting.entries import Entry, entries
from scenarios.shown import Shown, axes_or_new

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

HERE = Path(__file__).parent
COLOURS = {"good": "#123f6b", "doubtful": "#8a5010", "bad": "#a3122a"}  # those of the page
PAGE, TABLE = "summary.html", "summary.csv"


@dataclass(frozen=True, repr=False)
class Summary(Shown):
    """All results of a folder, in the order of their paths."""

    folder: Path
    entries: tuple[Entry, ...]

    @property
    def headline(self) -> str:
        """How many results of each command there are, and how many of them need a look."""
        counts = Counter(e.command for e in self.entries)
        said = ", ".join(f"{n} of {command}" for command, n in sorted(counts.items()))
        doubtful = sum(e.standing != "good" for e in self.entries)
        results = "1 result" if len(self.entries) == 1 else f"{len(self.entries)} results"
        return f"{results}: {said}; {doubtful or 'none'} to look at more closely"

    def lines(self) -> list[str]:
        """What the command prints: the headline, then each result that needs a look."""
        looked_at = (e for e in self.entries if e.standing != "good")
        return [self.headline, *(f"  {e.command} {e.name}: {e.answer}" for e in looked_at)]

    def to_frame(self) -> "pd.DataFrame":
        """A row for each result; columns are the fields of Entry."""
        import pandas as pd

        return pd.DataFrame([asdict(e) for e in self.entries], columns=list(Entry.__dataclass_fields__))

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """How many results of each command are good, doubtful and bad."""
        import pandas as pd

        table = self.to_frame()
        counts = pd.crosstab(table["command"], table["standing"]).reindex(columns=[*COLOURS], fill_value=0)
        drawn: Axes = counts.plot.barh(ax=axes_or_new(ax), stacked=True, color=[*COLOURS.values()])
        drawn.set(xlabel="results", ylabel="")
        return drawn

    def write(self, out: Path) -> None:
        """Write summary.html and summary.csv into a folder; the page has links relative to it."""
        commands = sorted({e.command for e in self.entries})
        text = rendered(
            HERE,
            "summary.html.j2",
            headline=self.headline,
            folder=str(self.folder),
            groups=[(c, [self._row(e, out) for e in self.entries if e.command == c]) for c in commands],
        )
        with written_at_once(out) as part:
            (part / PAGE).write_text(text, encoding="utf-8")
            (part / TABLE).write_text(self.to_frame().to_csv(index=False), encoding="utf-8")

    def _row(self, e: Entry, out: Path) -> dict[str, Any]:
        shown = e.file.parent / e.page if e.page else e.file
        return {
            "name": e.name,
            "answer": e.answer,
            "standing": e.standing,
            "link": quote(Path(os.path.relpath(shown, out)).as_posix()),
            "where": str(e.file.parent.relative_to(self.folder)),
            "error": "" if e.error_over_noise is None else number(e.error_over_noise, 3),
            "written": f"{e.written:%Y-%m-%d %H:%M}",
            "seconds": "" if e.seconds is None else number(e.seconds, 2),
        }


def report(folder: str | Path, out: str | Path | None = None) -> Summary:
    """The results of all commands in a folder and its subfolders; with `out` also as page and table.

    folder: holds result.json, results.json, plan.json or norm.json at any depth; a file that cannot be read
    is listed with the reason. out: folder for summary.html and summary.csv. BadInput if the folder does not
    exist or holds no result.
    """
    folder = Path(folder).absolute()
    if not folder.is_dir():
        raise BadInput(f"{folder}: no folder; name one that holds results of railfmi")
    found = Summary(folder, tuple(entries(folder)))
    if not found.entries:
        raise BadInput(f"{folder}: holds no results of railfmi; name the folder that was given as --out")
    if out is not None:
        found.write(writable(Path(out)))
    return found
