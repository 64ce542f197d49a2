"""`railfmi build`: FMUs of the models."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from fmus.contact.geometry.exact import exact_names
from fmus.effects import EFFECTS, parse_effect
from fmus.errors import BadInput
from fmus.model import Model
from fmus.models import MODELS, model_class
from fmus.wheelset.model import Wheelset
from fmus.wheelset.track import Track
from scenarios.cli.console import Out, app, said


@app.command()
def build(
    models: Annotated[
        list[str] | None, typer.Argument(help=f"of {', '.join(MODELS)}; all by default")
    ] = None,
    out: Out = Path("build"),
    kind: Annotated[
        str, typer.Option(help="python: PythonFMU, needs Python where it runs; native: C, needs nothing")
    ] = "python",
    fmi: Annotated[int, typer.Option(help="FMI version, 2 or 3; 3 is native")] = 2,
    platform: Annotated[
        list[str] | None, typer.Option(help="of native: host (default), all, or x86_64-linux and the like")
    ] = None,
    compiler: Annotated[
        str | None, typer.Option(help="of native: a C compiler of this machine instead of ziglang's")
    ] = None,
    effect: Annotated[
        list[str] | None, typer.Option(help=f"KIND@LOCATION to build in, off at first; {', '.join(EFFECTS)}")
    ] = None,
    wheel: Annotated[str | None, typer.Option(help="of the wheelset: profile by name or point file")] = None,
    rail: Annotated[str | None, typer.Option(help="of the wheelset: the same of the rail")] = None,
    cant: Annotated[str | None, typer.Option(help="of the wheelset: of the rails, such as 1/40")] = None,
    gauge: Annotated[str | None, typer.Option(help="of the wheelset: m, 14 mm below the crown")] = None,
    back_to_back: Annotated[
        str | None, typer.Option(help="of the wheelset: between the flange backs, m")
    ] = None,
) -> None:
    """Build FMUs of the models, with or without effects."""
    sizes = {"cant": cant, "gauge": gauge, "back_to_back": back_to_back}
    contact = {"wheel": wheel, "rail": rail, **sizes}
    given = {name: value for name, value in contact.items() if value is not None}
    made = [_model(name, effect or [], given) for name in models or MODELS]
    write = _writer(kind, fmi, platform or [], compiler)
    for model in made:
        for line in profiles_read(model):
            said.print(line, markup=False, soft_wrap=True)
        typer.echo(write(model, out))


def _model(name: str, effects: list[str], contact: dict[str, str]) -> Model:
    """The model of a name with effects, and where it has a contact, the profiles given for it."""
    chosen, parsed = model_class(name), [parse_effect(text) for text in effects]
    if not contact:
        return chosen(parsed)
    if not issubclass(chosen, Wheelset):
        raise BadInput(
            f"--{next(iter(contact)).replace('_', '-')}: {name} has no contact of profiles; leave it out"
        )
    return chosen(parsed, track=Track.parse(**contact))


def profiles_read(model: Model) -> list[str]:
    """How the point files of a wheelset's profiles were read: what was turned round, how it was smoothed."""
    if not isinstance(model, Wheelset):
        return []
    pair = model.track.pair
    return [f"{p.kind} {p.name}: {p.found}" for p in (pair.wheel, pair.rail) if p.name not in exact_names()]


def _writer(kind: str, fmi: int, platforms: list[str], compiler: str | None) -> Callable[[Model, Path], Path]:
    from fmus.export.builders.native.build import build_native
    from fmus.export.builders.pythonfmu import build_python

    if kind == "native":
        return lambda model, out: build_native(model, out, fmi, platforms or ("host",), compiler)
    if kind != "python":
        raise BadInput(f"--kind {kind}: 'python' and 'native' are built")
    if fmi != 2:
        raise BadInput(f"--fmi {fmi}: PythonFMU builds are FMI 2; use --kind native")
    if platforms or compiler:
        raise BadInput("--platform and --compiler: of native builds; use --kind native")
    return build_python
