"""The documents: links lead somewhere, files that are named exist, counts carry their right intervals."""

import re
import shlex
from pathlib import Path

import pytest
from scipy.stats import binomtest
from typer.testing import CliRunner

from estimator.filters import filters
from scenarios.cli.app import loaded
from scenarios.experiment.estimated import Options
from tests.helpers.paths import ROOT

DOCUMENTS = [
    *ROOT.glob("*.md"),
    *(f for top in ("docs", "fmus", "benchmarks") for f in (ROOT / top).rglob("*.md")),
]
LINK = re.compile(r"\]\(([^)\s]+)\)")
CODE = re.compile(r"```.*?```", re.S)
# patterns such as tests/*.py are no files, and NAME stands for what a reader puts there
NAMED = re.compile(r"(?<![\w/.-])(?:fmus|estimator|scenarios|tests|benchmarks)(?:/[\w.-]+)+(?![\w*/])")


def ids(path: Path) -> str:
    return str(path.relative_to(ROOT))


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as they are made of their words."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", head).strip().lower().replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", DOCUMENTS, ids=ids)
def test_links_lead_to_files_and_headings(page: Path) -> None:
    for link in LINK.findall(CODE.sub("", page.read_text(encoding="utf-8"))):
        if link.startswith("http"):
            continue
        file, _, anchor = link.partition("#")
        target = (page.parent / file).resolve() if file else page
        assert target.exists(), f"{ids(page)} links to {link}"
        assert not anchor or anchor in anchors(target), f"{ids(page)} links to {link}"


@pytest.mark.parametrize("page", DOCUMENTS, ids=ids)
def test_files_that_are_named_exist(page: Path) -> None:
    for name in NAMED.findall(page.read_text(encoding="utf-8")):
        known = name.rstrip(".")
        assert "NAME" in known or (ROOT / known).exists(), f"{ids(page)} names {known}"


def test_the_boxes_of_the_architecture_are_folders_or_modules() -> None:
    """A box that was renamed or removed in the code is noticed in the picture."""
    drawn = (ROOT / "docs" / "architecture.svg").read_text(encoding="utf-8")
    heads = re.findall(r'font-size="15" fill="#222" font-weight="bold"[^>]*>([a-z_, ]+)<', drawn)
    floors = [ROOT / name for name in ("scenarios", "estimator", "fmus")]
    names = [name for head in heads for name in head.split(", ")]
    assert len(names) >= 20
    for name in names:
        assert any((top / name).is_dir() or (top / f"{name}.py").is_file() for top in floors), name


def test_the_scoreboard_gives_the_exact_interval_of_each_count() -> None:
    text = (ROOT / "docs" / "challenge.md").read_text(encoding="utf-8")
    rows = re.findall(r"\| (\d+) of (\d+) \| ([\d.]+) % \| ([\d.]+) to ([\d.]+) % \|", text)
    assert len(rows) >= 15
    for hits, total, *given in rows:
        rate = int(hits) / int(total)
        interval = binomtest(int(hits), int(total)).proportion_ci(0.95, "exact")
        found = [100 * x for x in (rate, interval.low, interval.high)]
        assert found == pytest.approx([float(x) for x in given], abs=0.051), f"{hits} of {total}"


def test_the_readmes_package_for_other_tools_is_written(tmp_path: Path, monkeypatch) -> None:
    [line] = re.findall(r"^railfmi (export-ssp .*?) +#", (ROOT / "README.md").read_text(), re.M)
    command, scenario, *options = shlex.split(line)
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(
        loaded([command]), [command, str(ROOT / scenario), *options, "--kind", "python"]
    )
    assert done.exit_code == 0, done.output
    assert [f.suffix for f in tmp_path.iterdir()] == [".ssp"]


@pytest.mark.parametrize(
    ("page", "line"),
    [("estimate.md", r"^\| `filter` \|(.*)$"), ("experiment.md", r"^filter = (.*)$")],
)
def test_the_key_filter_is_documented_with_every_filter_and_the_default_first(page: str, line: str) -> None:
    [said] = re.findall(line, (ROOT / "docs" / page).read_text(encoding="utf-8"), re.M)
    first, *others = re.findall(r'"(\w+)"', said)
    assert first == Options().filter
    assert {first, *others} == set(filters())
