"""Files from outside, spoiled at random, and what reads each: it answers, or raises BadInput.

Run as a module, `python -m tests.helpers.fuzzing SECONDS [SEED]` reads spoiled files for so long and counts.
"""

import io
import random
import sys
import tempfile
import time
import traceback
import zipfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.io import savemat

from fmus.contact.geometry.points import read_points
from fmus.errors import BadInput
from fmus.export.ssp.reading import read_package
from fmus.host.archive import describe
from fmus.host.master.expression import parsed
from scenarios.campaign.declaration import Declaration as Campaign
from scenarios.campaign.sampling import points_of
from scenarios.experiment.experiment import load_experiment
from scenarios.experiment.readers import read_sheet
from scenarios.experiment.validation import read_file
from scenarios.fleet.declaration import Declaration as Fleet
from scenarios.fleet.records import read_records
from scenarios.reporting.entries import entry
from scenarios.simulating.expression import statement
from scenarios.simulating.reading import load_scenario
from scenarios.watching.declaration import load_watching
from tests.helpers.misbehaving import DESCRIPTION, EXPERIMENT, SCENARIO
from tests.helpers.paths import SHIPPED

WORDS = (
    b"", b"0", b"-1", b"nan", b"inf", b"1e999", b"9" * 400, b"0x1p", b"2024-01-01", b"true", b"Real",
    b"\0", b"\xff\xfe", b"\n", b"=", b"[", b"]", b"{", b"}", b"<", b">", b"/", b"..", b'"', b"'", b",",
    b"(((", b")", b"**", b"&lt;", b"u", b"x", b"a.b", b"x" * 300, b"fmi2", b"__class__",
    "\u00e4\u2028\U0001f600".encode(),
)  # fmt: skip
STRUCTURE = b"""<?xml version="1.0"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="s"><ssd:System name="s">
<ssd:Elements><ssd:Component name="a" source="resources/a.fmu" type="application/x-fmu-sharedlibrary">
<ssd:Connectors><ssd:Connector name="u" kind="input"><ssc:Real unit="m"/></ssd:Connector></ssd:Connectors>
</ssd:Component></ssd:Elements></ssd:System>
<ssd:DefaultExperiment startTime="0" stopTime="1"/></ssd:SystemStructureDescription>"""
STATEMENTS = b"max(abs(run.m.x)) < 2e-3 and rms(run.m.x - 2 * run.m.y) ** 2 <= 1 / (3 + pi)"


@dataclass(frozen=True)
class Target:
    """A kind of file: its name, what a good one holds, and what reads it."""

    name: str
    good: bytes
    read: Callable[[Path], object]


def spoiled(good: bytes, rng: random.Random) -> bytes:
    """A few places of a file replaced, doubled, swapped or cut out."""
    data = bytearray(good)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        at = rng.randrange(len(data) + 1)
        length = rng.choice((0, 1, 1, 2, 5, 20, 200))
        part = bytes(data[at : at + length])
        data[at : at + length] = rng.choice(
            (rng.choice(WORDS), part * 2, part[::-1], rng.randbytes(length), b"", part.swapcase())
        )
    return bytes(data)


@cache
def targets() -> Mapping[str, Target]:
    """Every kind of file by its name."""
    table = "t,u [N],x\n" + "".join(f"{0.01 * i:.2f},{i % 7},{i}\n" for i in range(40))
    points = "".join(f"{i - 60}, {abs(i - 60) ** 3 / 9e3:.4f}\n" for i in range(121))
    mat = io.BytesIO()
    savemat(mat, {"t": np.arange(9.0), "x": np.arange(9.0)})
    found = [
        Target("experiment.toml", EXPERIMENT.encode(), load_experiment),
        Target("scenario.toml", SCENARIO.encode(), load_scenario),
        Target("watch.toml", (SHIPPED / "watch" / "watch.toml").read_bytes(), load_watching),
        Target("campaign.toml", (SHIPPED / "campaign" / "settling.toml").read_bytes(), _sampled),
        Target("fleet.toml", (SHIPPED / "fleet" / "fleet.toml").read_bytes(), _fleet),
        Target("records.csv", (SHIPPED / "fleet" / "records.csv").read_bytes(), _records),
        Target("modelDescription.xml", DESCRIPTION.replace("{fault}", "none").encode(), _described),
        Target("bad.fmu", _fmu(DESCRIPTION.replace("{fault}", "none").encode()), describe),
        Target("SystemStructure.ssd", STRUCTURE, _packaged),
        Target("data.csv", table.encode(), read_sheet),
        Target("data.mat", mat.getvalue(), read_sheet),
        Target("profile.txt", points.encode(), lambda file: read_points(file, "wheel")),
        Target("result.json", b'{"experiment": "a", "verdict": "traced", "effects": [], "error": {}}', entry),
        Target("statement", STATEMENTS, _stated),
        Target("formula", b"where(t < 1, sin(5 * t), 0.2 * exp(-t)) + 3", _formula),
    ]
    return {target.name: target for target in found}


def _fmu(description: bytes) -> bytes:
    import fmpy

    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.writestr(f"binaries/{fmpy.platform}/bad{fmpy.sharedLibraryExtension}", b"no library")
    return packed.getvalue()


def _described(file: Path) -> object:
    file.with_suffix(".fmu").write_bytes(_fmu(file.read_bytes()))
    return describe(file.with_suffix(".fmu"))


def _packaged(file: Path) -> object:
    package = file.with_suffix(".ssp")
    with zipfile.ZipFile(package, "w") as archive:
        archive.writestr("SystemStructure.ssd", file.read_bytes())
        archive.writestr("resources/a.fmu", b"")
    return read_package(package)


def _sampled(file: Path) -> object:
    d = read_file(Campaign, file, "a campaign file")
    return points_of(d.model_copy(update={"n": d.n and min(d.n, 8)}))  # few, for many points take minutes


def _fleet(file: Path) -> object:
    return read_file(Fleet, file, "a fleet file")


def _records(file: Path) -> object:
    setups = {"rig": {"experiment": "setup.toml"}}
    return read_records(Fleet.model_validate({"id": "x", "records": file.name, "setups": setups}), file)


def _stated(file: Path) -> object:
    return statement(file.read_text(encoding="utf-8", errors="replace"), "a statement")


def _formula(file: Path) -> object:
    return parsed(file.read_text(encoding="utf-8", errors="replace"), "a formula")


def wrong(target: Target, data: bytes, folder: Path) -> str:
    """The traceback where a file raises anything but BadInput; empty else."""
    file = folder / target.name
    file.write_bytes(data)
    try:
        target.read(file)
    except BadInput:
        return ""
    except Exception:
        return traceback.format_exc()
    return ""


def main(seconds: float, seed: int = 0) -> None:
    """Count what was tried, and show each new kind of mistake."""
    rng, tried, seen = random.Random(seed), Counter[str](), set[tuple[str, str]]()
    until = time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as folder:
        while time.monotonic() < until:
            target = rng.choice([*targets().values()])
            data = spoiled(target.good, rng)
            tried[target.name] += 1
            told = wrong(target, data, Path(folder))
            kind = f"{target.name}: {' | '.join(told.splitlines()[-3:])[:300]}"
            place = "".join(line for line in told.splitlines() if "File" in line)[-200:]
            if told and (target.name, place) not in seen:
                seen.add((target.name, place))
                print(kind, flush=True)
    print(f"{sum(tried.values())} files, {len(seen)} kinds of mistake:", dict(tried))


if __name__ == "__main__":
    main(float(sys.argv[1]), *map(int, sys.argv[2:]))
