"""Pages from templates: what is written into them is escaped, and a value that is missing is an error."""

import re
from html import escape, unescape
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

SHARED = Path(__file__).parents[1] / "closing"  # the style sheet of the report, for other pages too

TABLE = re.compile(r"<table\b.*?</table>", re.S)
HEAD = re.compile(r"<th\b[^>]*>(.*?)</th>", re.S)
ROW = re.compile(r"<tr\b.*?</tr>", re.S)
CELL = re.compile(r"<td\b")
TAG = re.compile(r"<[^>]+>")
SECTION = re.compile(r'<section id="([\w-]+)">\s*<h2>(.*?)</h2>', re.S)
NUMBER = re.compile(r"^<span>\d+</span>")
CONTENTS = "<!-- contents -->"


def rendered(home: Path, template: str, **values: Any) -> str:
    """A page from a template in the folder `home`; it may include files of it and the shared style sheets.

    Where the template has the comment `contents`, the page has a list of its sections. Each cell of a table
    carries the heading of its column, so that a narrow screen can show a row as a block.
    """
    env = Environment(
        loader=FileSystemLoader([home, SHARED]), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    page = env.get_template(template).render(**values)
    return TABLE.sub(lambda table: _labelled(table[0]), page).replace(CONTENTS, _contents(page))


def _labelled(table: str) -> str:
    """A table whose cells carry the headings of their columns; one with cells over several rows stays."""
    if "rowspan" in table or "colspan" in table:
        return table.replace("<table", '<table data-whole="true"', 1)
    heads = [escape(" ".join(unescape(TAG.sub("", head)).split())) for head in HEAD.findall(table)]
    return ROW.sub(lambda row: _labelled_row(row[0], heads), table)


def _labelled_row(row: str, heads: list[str]) -> str:
    left = iter(heads)
    return CELL.sub(lambda _: f'<td data-head="{next(left, "")}"', row)


def _contents(page: str) -> str:
    """The sections of a page as a list of links; none for a page of one section."""
    sections = [(at, NUMBER.sub("", title)) for at, title in SECTION.findall(page)]
    links = "".join(f'<li><a href="#{at}">{title}</a></li>' for at, title in sections)
    return f'<nav aria-label="Contents"><ol>{links}</ol></nav>' if len(sections) > 1 else ""
