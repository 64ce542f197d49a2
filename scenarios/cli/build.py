"""`railfmi build`: build FMUs of the models of railfmi, with or without effects."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from fmus.effects import EFFECTS
from fmus.errors import BadInput
from fmus.model import Model
from fmus.models import MODELS, model_with
from fmus.option import Choice
from scenarios.cli.build_options import with_build_options
from scenarios.cli.console import Out, app
from scenarios.cli.voice import echo, found, progress, said


@app.command()
@with_build_options
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
    **options: Choice | None,
) -> None:
    """Build FMUs of the models, with or without effects."""
    if effect and not models:
        raise BadInput(f"--effect {effect[0]}: name the model that gets it, of {', '.join(MODELS)}")
    given = {name: value for name, value in options.items() if value is not None}
    made = [model_with(name, effect or [], given) for name in models or MODELS]
    write = _writer(kind, fmi, platform or [], compiler)
    files: list[Path] = []
    for model in made:
        for line in model.notes():
            said.print(line, markup=False, soft_wrap=True)
        with progress(f"building {model.name}, {len(files) + 1} of {len(made)}"):
            files.append(write(model, out))
        echo(files[-1])
    found(files)


def _writer(kind: str, fmi: int, platforms: list[str], compiler: str | None) -> Callable[[Model, Path], Path]:
    if kind == "native":
        from fmus.export.builders.native.build import build_native

        return lambda model, out: build_native(model, out, fmi, platforms or ("host",), compiler)
    if kind != "python":
        raise BadInput(f"--kind {kind}: 'python' and 'native' are built")
    if fmi != 2:
        raise BadInput(f"--fmi {fmi}: PythonFMU builds are FMI 2; use --kind native")
    if platforms or compiler:
        raise BadInput("--platform and --compiler: of native builds; use --kind native")
    from fmus.export.builders.pythonfmu import build_python

    return build_python
