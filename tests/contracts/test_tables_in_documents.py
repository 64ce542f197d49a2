"""TOML in the documents: the code knows every table and every key, also those that stand behind a '#'."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest
from pydantic import ValidationError

from fmus.errors import BadInput
from scenarios.campaign.declaration import Declaration as Campaign
from scenarios.experiment.declaration import Declaration as Experiment
from scenarios.experiment.table import Table
from scenarios.fleet.declaration import Declaration as Fleet
from scenarios.simulating.declaration import Declaration as Scenario
from scenarios.track.reading import read_source
from scenarios.watching.declaration import Watching
from tests.contracts.test_documents import DOCUMENTS, ids
from tests.helpers.paths import ROOT

BLOCK = re.compile(r"^[ ]*```toml\n(.*?)^[ ]*```", re.S | re.M)
HIDDEN = re.compile(r"^# ?(?=[\w.\"']+ = )", re.M)  # a key that may be given
TABLE = re.compile(r"^# \[.*\n(?:^# .*\n?)*", re.M)  # a table that may be given, with its keys
MEASURED = "docs/experiment.md"  # its first block is a whole file, which others add to
FILES: dict[str, type[Table]] = {
    "docs/experiment.md": Experiment, "docs/estimate.md": Experiment, "docs/plan.md": Experiment,
    "docs/watch.md": Watching, "docs/fleet.md": Fleet, "docs/campaign.md": Campaign,
    "docs/scenarios.md": Scenario,
}  # fmt: skip
TRACKS = "docs/track.md"


def blocks(page: Path) -> list[str]:
    """The blocks of TOML on a page, also those in lists."""
    return [dedent(text) for text in BLOCK.findall(page.read_text(encoding="utf-8"))]


PAGES = [page for page in DOCUMENTS if blocks(page)]


def base_of(name: str) -> dict[str, Any]:
    """The file to which the blocks of a page belong."""
    home = MEASURED if FILES.get(name) is Experiment else name
    return tomllib.loads(blocks(ROOT / home)[0])


def faults(name: str, table: Mapping[str, Any]) -> dict[str, str]:
    """What is wrong with a file: kinds of faults, with what is said of them."""
    try:
        if name == TRACKS:
            read_source(as_track(table["track"]))
        else:
            FILES[name].model_validate(table)
    except ValidationError as error:
        return {e["type"]: str(e["loc"]) for e in error.errors()}
    except BadInput as error:
        return {"bad input": str(error)}
    return {}


def as_track(table: Mapping[str, Any]) -> dict[str, Any]:
    """A table [track] with what every track needs; densities of its own take the place of a spectrum."""
    whole = {"kind": "spectrum", "seed": 1, "wavelengths": [3.0, 25.0], "length": 1e3} | table
    if "own" in whole:
        for key in ("spectrum", "statistics"):
            whole.pop(key, None)
    if whole["kind"] == "file":
        whole = dict(table)
    return whole


def optional(text: str) -> Iterator[str]:
    """A block with each of the tables and keys behind a '#' in turn."""
    for found in TABLE.finditer(text):
        yield text[: found.start()] + re.sub(r"^# ", "", found[0], flags=re.M) + text[found.end() :]
    for found in HIDDEN.finditer(TABLE.sub("", text)):
        yield TABLE.sub("", text)[: found.start()] + TABLE.sub("", text)[found.end() :]


def shown(name: str, text: str) -> Iterator[dict[str, Any]]:
    """A block as a whole file, and with each of its optional parts, where that is TOML."""
    yield base_of(name) | tomllib.loads(text)
    for more in optional(text):
        try:
            yield base_of(name) | tomllib.loads(more)
        except tomllib.TOMLDecodeError:  # it stands in place of what is there
            continue


def test_every_page_with_toml_has_its_class():
    assert {*map(ids, PAGES)} == {*FILES, TRACKS}
    seen = [len(list(shown(ids(page), text))) - 1 for page in PAGES for text in blocks(page)]
    assert sum(seen) >= 15  # optional parts that are TOML


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_the_tables_of_a_page_are_accepted(page: Path) -> None:
    for text in blocks(page):
        whole, *_ = shown(ids(page), text)
        assert faults(ids(page), whole) == {}, text


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_the_keys_that_may_be_given_are_known(page: Path) -> None:
    """Some stand in place of another one, so that both together are a fault, but none that is not known."""
    for text in blocks(page):
        _, *others = shown(ids(page), text)
        for table in others:
            found = faults(ids(page), table)
            assert "extra_forbidden" not in found, (text, found)
            assert "unknown key" not in found.get("bad input", ""), (text, found)


def test_a_key_that_is_not_there_is_noticed() -> None:
    assert faults(MEASURED, base_of(MEASURED) | {"splits": {}}) == {"extra_forbidden": "('splits',)"}
