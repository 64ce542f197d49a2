"""Options of the command line that follow from what the models offer to choose when they are built."""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from fmus.errors import BadInput
from fmus.model import Model
from fmus.models import MODELS
from fmus.option import BuildOption

Offers = dict[str, list[tuple[str, BuildOption]]]
METAVARS: dict[object, str] = {str: "TEXT", Path: "NAME|FILE"}  # and NUMBER


def with_build_options(command: Callable[..., None]) -> Callable[..., None]:
    """The command with an option more for each build option of a model, which it gets in its `**` argument.

    BadInput where a model's option has a name that the command itself uses.
    """
    own = [p for p in inspect.signature(command).parameters.values() if p.kind is not p.VAR_KEYWORD]
    offers = offered(MODELS)
    for name in [*(p.name for p in own), "help"]:
        if name in offers:
            owner = offers[name][0][0]
            raise BadInput(f"model '{owner}': build option '{name}' is an option of every build; rename it")
    further = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=_annotation(of))
        for name, of in offers.items()
    ]
    command.__dict__["__signature__"] = inspect.Signature([*own, *further])
    return command


def offered(models: dict[str, type[Model]]) -> Offers:
    """Build options by name, with the models that offer them."""
    found: Offers = {}
    for model, cls in models.items():
        for option in cls.build_options:
            found.setdefault(option.name, []).append((model, option))
    return found


def _annotation(of: list[tuple[str, BuildOption]]) -> object:
    """As text in any case, since a number may be a fraction; the model reads it."""
    words = "; ".join(f"of {model}: {_meaning(option)}" for model, option in of)
    metavar = METAVARS.get(of[0][1].type, "NUMBER")
    return Annotated[str | None, typer.Option(help=words, metavar=metavar)]


def _meaning(option: BuildOption) -> str:
    unit = f" in {option.unit}," if option.unit not in ("", "1") else ","
    if option.default == "":
        return option.meaning
    default = f"{option.default:g}" if option.is_number else option.default
    return f"{option.meaning}{unit} by default {default}"
