"""documentation/index.html of a native FMU: equations, symbols, how to use and how to compile it."""

import inspect
from importlib.metadata import version
from pathlib import Path

from jinja2 import Environment, FileSystemLoader
from markdown_it import MarkdownIt
from markupsafe import Markup

from fmus.export.native.table import Table
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
    text = readme.read_text(encoding="utf-8")
    # raw HTML is off, so what comes out is safe to put into the page
    return Markup(MarkdownIt("commonmark", {"html": False}).enable("table").render(text))
