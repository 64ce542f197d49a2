"""The report in headless Chromium: it fits a desk and a telephone, its charts live, and nothing fails."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from scenarios.closing.result import Result

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--hide-scrollbars",
    "--enable-logging=stderr", "--allow-file-access-from-files", "--virtual-time-budget=3000",
)  # fmt: skip
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


@pytest.mark.parametrize("width", [1280, 390])
def test_the_report_fits_and_is_alive(width: int, demo: tuple[Result, Path], tmp_path: Path) -> None:
    page = demo[1] / "report.html"
    found, errors = looked_at(page, width, tmp_path)
    assert errors == []
    assert found["inner"] == width
    assert found["scroll"] <= width
    assert found["wide"] == []
    assert found["charts"] == 2  # one for each output of the rig
    assert found["silent"] == 0
    assert found["links"] >= 8
    assert found["folded"] >= 1
    assert page.stat().st_size < LARGEST
