"""The settings of a scenario that SSP 1.0 cannot represent, as a separate file in the package."""

from collections.abc import Sequence
from typing import Any

from fmus.contact.forces.conditions import CONDITIONS
from fmus.errors import BadInput, did_you_mean
from fmus.export.provenance import FOLDER
from scenarios.exchange.toml_text import toml_text
from scenarios.experiment.table import Table
from scenarios.simulating.asking import asked
from scenarios.simulating.declaration import Declaration, Moment
from scenarios.simulating.reading import Scenario

PLACE = f"{FOLDER}/scenario.toml"


def settings(scenario: Scenario, variant: str) -> bytes:
    """The file at PLACE for one variant; formulas that name variants are left out with them."""
    d = scenario.variants[variant]
    table = {
        "id": scenario.id,
        "question": scenario.declared.question,
        "order": d.order,
        "extrapolation": d.extrapolation,
        "seed": d.seed,
        "step": d.step,
        "delayed": [wire.target for wire in d.connections if wire.delayed],
        "record": _given(d.record),
        "sensors": d.sensors,
        "events": [_event(moment) for moment in d.events],
        "expect": _expectations(scenario, variant),
        "figure": _figures(scenario, variant),
    }
    return toml_text({key: value for key, value in table.items() if value not in ({}, [])}).encode()


def dropped(scenario: Scenario, variant: str) -> int:
    """The number of expectations left out because they concern other variants or several at once."""
    return len(scenario.declared.expect) - len(_expectations(scenario, variant))


def _event(moment: Moment) -> dict[str, Any]:
    values = dict(moment.set)
    for name, condition in moment.friction.items():
        values |= {f"{name}.{variable}": v for variable, v in CONDITIONS[condition].items()}
    return {"time": moment.time, "set": values}


def _expectations(scenario: Scenario, variant: str) -> list[dict[str, Any]]:
    return [
        {"that": e.that, "because": e.because}
        for e, question in asked(scenario).expectations
        if variant in question.variants and _single([question.formula.names], scenario)
    ]


def _figures(scenario: Scenario, variant: str) -> list[dict[str, Any]]:
    """Figures with those of their panels that are about this variant alone."""
    curves, found = asked(scenario).curves, []
    for i, picture in enumerate(scenario.declared.figure):
        panels = []
        for j, panel in enumerate(picture.panels):
            drawn, over = curves[i, j]
            questions = [*drawn, *([over] if over else [])]
            about = all(variant in q.variants or not q.formula.names for q in questions)
            if about and _single([q.formula.names for q in questions], scenario):
                panels.append(_given(panel, "variants"))
        if panels:
            found.append({"name": picture.name, "title": picture.title, "panels": panels})
    return found


def _given(table: Table, *without: str) -> dict[str, Any]:
    """The keys of a table that the scenario has."""
    return {k: v for k, v in table if k in table.model_fields_set and k not in without}


def _single(names: Sequence[Sequence[str]], scenario: Scenario) -> bool:
    """Whether no name begins with that of a variant."""
    return all(n.partition(".")[0] not in scenario.variants for some in names for n in some)


def chosen(scenario: Scenario, variant: str | None) -> str:
    """The variant to export: the given one, or the only one."""
    names = list(scenario.variants)
    if variant is None and len(names) > 1:
        raise BadInput(f"{scenario.file}: has variants {', '.join(names)}; choose one with --variant")
    if variant is not None and variant not in names:
        raise BadInput(f"{scenario.file}: there is no variant '{variant}'; {did_you_mean(variant, names)}")
    return variant or names[0]


def motion(scenario: Scenario, variant: str) -> Declaration:
    """The declaration of a variant; raises BadInput if it has no FMUs."""
    d = scenario.variants[variant]
    if d.contact is not None:
        raise BadInput(
            f"{scenario.file}: is a scenario of a contact table without FMUs; choose a scenario with FMUs"
        )
    return d
