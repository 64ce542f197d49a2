"""The page on the sources: every item has a status, a proof that runs or a reason, and is counted."""

import re
from collections import Counter

import pytest

from scenarios.literature import ROWS
from tests.helpers.paths import ROOT

PAGE = (ROOT / "docs" / "sources.md").read_text(encoding="utf-8")
ROWS_OF_TABLES = [
    [c.strip() for c in line[1:-1].split("|")] for line in PAGE.splitlines() if line[:2] == "| "
]
ITEMS = [row for row in ROWS_OF_TABLES if len(row) == 5 and row[0] != "item"]


@pytest.mark.parametrize("item", ITEMS, ids=lambda item: item[0])
def test_an_item_has_a_proof_or_a_reason(item):
    _, where, status, proof, missing = item
    assert where
    assert status in ("full", "partly", "absent")
    assert bool(proof) == (status != "absent")
    assert bool(missing) == (status != "full")
    rows = set(re.findall(r"`railfmi row (\w+)`", proof))
    assert rows <= set(ROWS)
    files = re.findall(r"`([\w/]+\.\w+)`", proof)
    assert all((ROOT / file).is_file() for file in files)
    if status == "full":
        run = [f for f in files if re.fullmatch(r"tests/(\w+/)*test_\w+\.py|scenarios/shipped/\w+\.toml", f)]
        assert rows or run


def test_the_count_is_that_of_the_tables():
    n = Counter(item[2] for item in ITEMS)
    found = re.search(r"\*\*Count\*\*: (\d+) items, (\d+) full \((\d+) %\), (\d+) partly, (\d+) absent", PAGE)
    assert found
    whole = len(ITEMS)
    expected = [whole, n["full"], round(100 * n["full"] / whole), n["partly"], n["absent"]]
    assert [int(x) for x in found.groups()] == expected
