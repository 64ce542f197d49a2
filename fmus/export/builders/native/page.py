"""documentation/index.html of a native FMU: equations, symbols, how to use and how to compile it."""

import inspect
from base64 import b64encode
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from mimetypes import guess_type
from pathlib import Path

from jinja2 import Environment, FileSystemLoader
from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup

from fmus.export.builders.native.table import Table
from fmus.model import Model

HERE = Path(__file__).parent


def page(model: Model, table: Table, fmi: int) -> str:
    """The page of a model; its equations come from the README.md beside the model."""
    template = Environment(loader=FileSystemLoader(HERE), autoescape=True).get_template(
        "documentation.html.j2"
    )
    return template.render(table=table, fmi=fmi, equations=_equations(model), casadi=version("casadi"))


def _equations(model: Model) -> Markup:
    source = Path(inspect.getfile(type(model)))
    readme = source.with_name("README.md")
    if source.name != "model.py" or not readme.is_file():
        return Markup("")
    # raw HTML is off, so what comes out is safe to put into the page
    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = markdown.parse(readme.read_text(encoding="utf-8"))
    for token in tokens:
        token.children = list(_self_contained(token.children or [], readme.parent))
    return Markup(markdown.renderer.render(tokens, markdown.options, {}))


def _self_contained(tokens: Sequence[Token], folder: Path) -> Iterator[Token]:
    """Pictures put into the page; links to files beside the source, which the FMU has not, as plain text."""
    opened: list[bool] = []
    for token in tokens:
        if token.type == "image":
            token.attrSet("src", _embedded(folder / str(token.attrGet("src"))))
        if token.type == "link_open":
            opened.append(str(token.attrGet("href")).startswith("http"))
        kept = opened[-1] if token.type in ("link_open", "link_close") else True
        if token.type == "link_close":
            opened.pop()
        if kept:
            yield token


def _embedded(picture: Path) -> str:
    """A picture as an address that holds it; as it is where there is no such file."""
    kind = guess_type(picture.name)[0]
    if kind is None or not picture.is_file():
        return picture.name
    return f"data:{kind};base64,{b64encode(picture.read_bytes()).decode()}"
