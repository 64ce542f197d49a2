"""FMUs with effects built in, made when first asked for: one model or foreign FMU, many hypotheses."""

import os
from dataclasses import dataclass
from pathlib import Path

from fmus.effects import EFFECTS
from fmus.export.pythonfmu import build_python
from fmus.models import model_class


@dataclass(frozen=True)
class ModelBuilder:
    """Builds of one of our models, with its locations opened by probes; kept in a folder."""

    model: str
    folder: Path

    @property
    def offers(self) -> tuple[tuple[str, str], ...]:
        """(kind, location) of every effect that makes sense in the model."""
        ports = model_class(self.model)().ports()
        return tuple((k, at) for at, port in ports.items() for k, e in EFFECTS.items() if e.fits(port))

    def __call__(self, effects: tuple[tuple[str, str], ...]) -> Path:
        """Path of the FMU with these effects, all off at their start values."""
        target = self.folder / "+".join(["base", *(f"{k}@{at}" for k, at in effects)]) / "model.fmu"
        if not target.exists():
            model = model_class(self.model)([(EFFECTS[k], at) for k, at in effects], probes=True)
            part = target.with_name(f"{os.getpid()}.fmu")
            build_python(model, part)
            part.replace(target)
        return target
