"""Hook of MkDocs: the site shows the pages of the repository where they lie, and what they refer to.

A page keeps its path, so that its links hold both in the repository and on the site. The page of the Python
interface lists what the package railfmi declares as public.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
PAGES = (
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "docs/*.md",
    "benchmarks/**/*.md",
    "fmus/**/README.md",
)
LINK = re.compile(r"\]\(([^)#\s]+)")
INTERFACE = """# Python interface

What `import railfmi` offers. Everything is loaded on first use. The packages behind these names, `fmus`,
`estimator` and `scenarios`, are described in [CONTRIBUTING](CONTRIBUTING.md).

"""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Called by MkDocs: adds the pages and what they refer to."""
    pages = sorted({page for pattern in PAGES for page in ROOT.glob(pattern)})
    for path in sorted({*pages, *(file for page in pages for file in referred(page))}):
        files.append(File.generated(config, path.relative_to(ROOT).as_posix(), abs_src_path=str(path)))
    entries = "\n".join(f"::: {home}.{name}" for name, home in public())
    files.append(File.generated(config, "interface.md", content=INTERFACE + entries))
    return files


def referred(page: Path) -> Iterator[Path]:
    """The files beside the pages to which a page has links."""
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        file = (page.parent / link).resolve()
        if file.is_file() and file.suffix != ".md":
            yield file


def public() -> Iterator[tuple[str, str]]:
    """Name and module of everything that railfmi offers, sorted by name."""
    contact = assigned(ROOT / "fmus" / "contact" / "__init__.py", "PUBLIC")
    for name, home in sorted(assigned(ROOT / "railfmi" / "__init__.py", "_HOMES").items()):
        yield name, f"{home}.{contact[name]}" if home == "fmus.contact" else home


def assigned(file: Path, name: str) -> dict[str, Any]:
    """The dict that a module assigns to a name, without importing the module."""
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and any(
            isinstance(t, ast.Name) and t.id == name for t in node.targets
        ):
            return dict(ast.literal_eval(node.value))
    raise LookupError(f"{file} assigns no {name}")
