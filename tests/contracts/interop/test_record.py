"""What docs/compatibility.md says of importers is what was recorded, and it was recorded of every FMU."""

from dataclasses import replace

import pytest

from tests.contracts.interop.cases import BUILDS, runs
from tests.contracts.interop.importer import importers
from tests.contracts.interop.record import BEGIN, END, PAGE, Row, keep, shown, stored, table, write_page

TOOLS = importers()
RAN = [tool for tool in TOOLS if any(row.tool == tool.name for row in stored())]


def test_at_least_eight_importers_were_run_and_each_kind_of_build():
    assert len({row.tool for row in stored() if row.difference is not None}) >= 8
    ran = {(row.model, row.build, row.fmi) for row in stored() if row.difference is not None}
    assert ran == {(b.model, b.build, b.fmi) for b in BUILDS}


@pytest.mark.parametrize("tool", RAN, ids=lambda tool: tool.name)
def test_every_fmu_that_a_tool_reads_was_run_in_it(tool):
    recorded = {(r.model, r.build, r.fmi, r.kind) for r in stored() if r.tool == tool.name}
    assert recorded == {(b.model, b.build, b.fmi, kind) for b, kind in runs(tool)}


@pytest.mark.parametrize("tool", RAN, ids=lambda tool: tool.name)
def test_a_recorded_difference_is_within_the_tools_tolerance_or_a_known_failure(tool):
    for row in stored():
        if row.tool == tool.name and (row.build, row.kind, row.fmi) in tool.fails:
            assert row.difference is None, f"{row} runs now; take it out of fails"
        elif row.tool == tool.name:
            assert row.difference is not None, row
            assert 0 <= row.difference <= tool.tolerance[row.kind], row


def test_the_page_shows_the_recorded_rows():
    inside = PAGE.read_text().split(BEGIN)[1].split(END)[0]
    assert inside.strip() == table(TOOLS, stored()).strip()
    for tool in RAN:
        assert f"| {tool.name} |" in inside
        assert not tool.remark or tool.remark in " ".join(PAGE.read_text().split())


def row(difference, **changes):
    good = Row(
        RAN[0].name, "1", "drive", "native", 2, sorted(RAN[0].reads)[0][0], difference, "", "2026-11-25"
    )
    return replace(good, **changes)


def test_a_later_run_replaces_a_row_and_leaves_the_others(tmp_path):
    file = tmp_path / "results.json"
    keep([row(1e-9), row(2e-9, model="testrig")], file)
    keep([row(3e-9)], file)
    assert [(r.model, r.difference) for r in stored(file)] == [("drive", 3e-9), ("testrig", 2e-9)]


def test_the_worst_model_and_a_failure_are_shown(tmp_path):
    file, page = tmp_path / "results.json", tmp_path / "page.md"
    rows = [row(3e-12), row(4e-10, model="testrig"), row(None, model="wheelset", said="it crashed")]
    keep(rows, file)
    page.write_text(f"before\n{BEGIN}old\n{END}after\n")
    write_page(TOOLS, page, file)
    assert "2 of 3 | 4e-10 |" in page.read_text()
    assert page.read_text().startswith("before\n")
    assert page.read_text().endswith("after\n")
    assert "old" not in page.read_text()


@pytest.mark.parametrize(("value", "text"), [(0.0, "0"), (3.62e-12, "4e-12"), (6.3e-5, "6e-5")])
def test_a_difference_has_one_digit(value, text):
    assert shown(value) == text
