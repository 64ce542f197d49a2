"""All pages in headless Chromium: they fit a desk and a telephone, charts live, and nothing fails."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from fmus.host.apart.isolation import ISOLATED
from scenarios.cli.app import run_safely
from scenarios.closing.result import Result
from tests.helpers.paths import SHIPPED

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--hide-scrollbars",
    "--enable-logging=stderr", "--allow-file-access-from-files", "--virtual-time-budget=3000",
)  # fmt: skip
FORCED = "--parameter u --from 0.6 --to 1.2 --output x0 --set mu=0.3 --step 0.2"
LARGEST = 4_000_000  # bytes
# a frame has any width, which the window of a headless browser has not
FRAME = """<body style="margin:0"><iframe src="{page}" style="border:0;width:{width}px;height:900px"></iframe>
<pre></pre><script>
onload = () => setTimeout(() => {{
  const page = document.querySelector("iframe").contentDocument, whole = page.documentElement;
  const aside = ".wide, pre, details:not([open])";
  const wide = [...page.querySelectorAll("body *")].filter((e) => !e.closest(aside) &&
    e.getBoundingClientRect().right > whole.clientWidth + 1);
  const drawn = (c) => c.getBoundingClientRect().width > 0;
  const charts = [...page.querySelectorAll(".chart canvas")].filter(drawn);
  document.querySelector("pre").textContent = JSON.stringify({{
    cut: [...page.querySelectorAll(".wide, pre")].filter((e) => e.scrollWidth > e.clientWidth + 1)
      .map((e) => e.textContent.slice(0, 60)),
    inner: whole.clientWidth, scroll: whole.scrollWidth, wide: wide.map((e) => e.tagName),
    charts: charts.length, silent: [...page.images].filter((i) => !i.alt).length,
    links: page.querySelectorAll("nav a").length, folded: page.querySelectorAll("details").length,
  }});
}}, 1000);
</script>"""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine"),
]


def looked_at(page: Path, width: int, folder: Path) -> tuple[dict, list[str]]:
    """What a browser finds in a page, and the errors of its console."""
    frame = folder / "frame.html"
    frame.write_text(FRAME.format(page=page.resolve().as_uri(), width=width))
    done = subprocess.run(
        [str(CHROMIUM), *FLAGS, f"--user-data-dir={folder / 'user'}", "--dump-dom", frame.as_uri()],
        capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    [text] = re.findall(r"<pre>(\{.*?\})</pre>", done.stdout)
    return json.loads(text), [line for line in done.stderr.splitlines() if "CONSOLE" in line]


@pytest.fixture(scope="module")
def pages(demo: tuple[Result, Path], vdp: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a page of every command that writes one, with the closed loop of the session."""
    out = tmp_path_factory.mktemp("pages")
    (out / "close-loop").symlink_to(demo[1])
    shipped = SHIPPED / "demo"
    for name, *more in (
        ("estimate", str(shipped / "rig-friction")),
        ("plan", str(shipped / "rig-drag")),
        ("conicity", "--wheel", "S1002", "--rail", "60E1"),
        ("conicity-norm", "--pair", "A", "--draws", "1"),
        ("bifurcation", str(vdp), *FORCED.split()),
    ):
        assert run_safely([name, *more, "--out", str(out / name)]) == 0
    both = [str(shipped / name) for name in ("rig-drag", "rig-friction")]
    assert run_safely(["close-loop", *both, "--jobs", "1", "--out", str(out / "several")]) == 0
    assert run_safely(["report", str(out)]) == 0
    return out


def every_page() -> list[str]:
    """The pages by their place in the folder."""
    return [
        "close-loop/report.html", "estimate/estimate.html", "plan/plan.html", "conicity/conicity.html",
        "conicity-norm/norm.html", "bifurcation/bifurcation.html", "several/index.html", "summary.html",
    ]  # fmt: skip


@pytest.fixture(scope="module")
def pages_of_many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pages of a fleet and a campaign, whose answers are made up, and of a stream with an alarm."""
    pytest.importorskip("distributed", reason="the extra 'fleet' is not installed")
    from scenarios.campaign.page import write_page as write_campaign
    from tests.scenarios import test_campaign, test_fleet, test_watch_command

    out = tmp_path_factory.mktemp("many")
    for name in ("fleet", "campaign", "watch"):
        (out / name).mkdir()
    plan, store = test_fleet.six_vehicles(tmp_path_factory.mktemp("of_fleet"))
    test_fleet.write_page(out / "fleet", test_fleet.assembled(plan, store, {}, 1.0))
    points = test_campaign.plan_of(test_campaign.SHIPPED, ISOLATED)
    answers = test_campaign.answers_of(points, lambda p: sum(map(float, p.values())))
    write_campaign(out / "campaign", test_campaign.assembled(points, answers, {}, 1.0))
    told = test_watch_command.page(test_watch_command.STATUS, 1001.0)
    (out / "watch" / "watch.html").write_text(told, encoding="utf-8")
    return out


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("page", ["fleet/fleet.html", "campaign/campaign.html", "watch/watch.html"])
def test_a_page_of_many_fits(page: str, width: int, pages_of_many: Path, tmp_path: Path) -> None:
    assert_fits(pages_of_many / page, width, tmp_path)


def test_all_pages_are_there(pages: Path) -> None:
    assert all((pages / page).is_file() for page in every_page())
    names = {page.rpartition("/")[2] for page in every_page()}
    assert {file.name for file in pages.rglob("*.html")} <= names  # no page is left out


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize("page", every_page())
def test_a_page_fits_and_nothing_fails(page: str, width: int, pages: Path, tmp_path: Path) -> None:
    assert_fits(pages / page, width, tmp_path)


def assert_fits(page: Path, width: int, folder: Path) -> None:
    """Nothing reaches out of the page or is cut, no figure is without words, no script fails."""
    found, errors = looked_at(page, width, folder)
    assert errors == []
    assert found["inner"] == width
    assert found["scroll"] <= width
    assert found["wide"] == []
    assert found["cut"] == []
    assert found["silent"] == 0
    assert page.stat().st_size < LARGEST


@pytest.mark.parametrize("width", [1280, 390])
def test_the_report_is_alive(width: int, demo: tuple[Result, Path], tmp_path: Path) -> None:
    found, _ = looked_at(demo[1] / "report.html", width, tmp_path)
    assert found["charts"] == 2  # one for each output of the rig
    assert found["links"] >= 8
    assert found["folded"] >= 1
