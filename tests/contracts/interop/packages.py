"""SSP packages of others, imported and run: `python -m tests.contracts.interop.packages FOLDER [NAME ...]`.

FOLDER holds the packages as NAME.ssp; names after it take those alone. What became of each is kept in
packages.json and shown in docs/exchange.md.
"""

import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from fmus.errors import BadInput
from fmus.host.apart.isolation import FmuEnded
from fmus.host.fmu import FmuError
from scenarios.exchange import import_ssp
from scenarios.simulating import run
from tests.helpers.paths import ROOT

RESULTS = Path(__file__).with_name("packages.json")
PAGE = ROOT / "docs" / "exchange.md"
BEGIN, END = "<!-- packages: begin -->\n", "<!-- packages: end -->\n"
RAN = "imported and run"
WHY = {  # a refusal on the page: words of the message
    "refused: there is no FMU in the package, or not all of them": (
        "which is not in the package",
        "holds no FMU",
    ),
    "refused: it breaks the schema of SSP, or is no XML": ("breaks the schema of SSP", "is no XML"),
    "refused: an FMU has no binary for Linux": ("has no binary for this platform",),
    "refused: a connection starts at an input": ("is no output but of causality 'input'",),
    "refused: what railfmi does not have, FMI 1.0": ("is FMI 1.0",),
}
OURS = "refused: what railfmi does not have, FMI 1.0"  # the others are the package's fault


@dataclass(frozen=True)
class Package:
    """What became of one package."""

    name: str
    said: str  # why it was refused; empty where it was imported and run

    @property
    def outcome(self) -> str:
        """As the page has it; ValueError for a refusal that nobody has looked at."""
        found = [title for title, words in WHY.items() if any(w in self.said for w in words)]
        if self.said and len(found) != 1:
            raise ValueError(f"{self.name}: no outcome on the page for '{self.said}'")
        return found[0] if self.said else RAN


def tried(package: Path) -> Package:
    """Import a package and run it: all expectations must hold, which are that all outputs stay finite."""
    with tempfile.TemporaryDirectory() as work:
        try:
            result = run(import_ssp(package, Path(work) / "in"), Path(work) / "out")
            said = "" if result.ok else "its outputs do not stay finite"
        except (BadInput, FmuError, FmuEnded) as error:
            said = str(error).replace(f"{work}/in/", "").replace(f"{package.parent}/", "")
    return Package(package.stem, said)


def stored(file: Path = RESULTS) -> list[Package]:
    """What was recorded."""
    return [Package(**row) for row in json.loads(file.read_text())]


def table(packages: Sequence[Package]) -> str:
    """The rows of the page: the packages by what became of them."""
    lines = [f"{len(packages)} packages:", "", "| outcome | packages |", "|---|---|"]
    for title in (RAN, *WHY):
        names = [f"`{p.name}`" for p in packages if p.outcome == title]
        if names:
            lines.append(f"| {title} | {len(names)}: {', '.join(names)} |")
    return "\n".join(lines) + "\n"


def main(folder: Path, only: Sequence[str] = ()) -> None:
    """Record the packages of a folder, all or those of some names, and put the table into the page."""
    kept = {p.name: p for p in (stored() if only else [])}
    for file in sorted(folder.glob("*.ssp")):
        if not only or file.stem in only:
            kept[file.stem] = tried(file)
            print(kept[file.stem], flush=True)
    found = sorted(kept.values(), key=lambda p: p.name.lower())
    RESULTS.write_text("[\n" + ",\n".join(json.dumps(asdict(p)) for p in found) + "\n]\n")
    before, rest = PAGE.read_text().split(BEGIN)
    PAGE.write_text(before + BEGIN + "\n" + table(found) + "\n" + END + rest.split(END)[1])


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), sys.argv[2:])
