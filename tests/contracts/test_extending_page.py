"""The page on an effect and a model of one's own, followed as a reader would."""

from pathlib import Path

from fmus.host.fmu import Fmu
from tests.helpers.further import Further
from tests.helpers.pages import steps_of
from tests.helpers.paths import ROOT

PAGE = ROOT / "docs" / "extending.md"


def test_an_effect_and_a_model_of_the_page_are_built(tmp_path: Path) -> None:
    mine = Further(tmp_path)
    steps = list(steps_of(PAGE))
    assert [s.file for s in steps if s.file] == [
        "mine/fmus/effects/fifth_stiffness.py", "mine/fmus/pendulum/model.py",
    ]  # fmt: skip
    for step in steps:
        if step.file:
            mine.write(step.file.removeprefix("mine/"), step.text)
        elif step.command[0] == "railfmi":
            mine.railfmi(*step.command[1:])
    with Fmu(tmp_path / "build" / "Pendulum.fmu") as pendulum:
        name = "fifth_stiffness_pivot_k_5"
        pendulum.restart(phi=1.0, phi_dot=0.0)
        free = pendulum["phi_ddot"]
        pendulum.restart(phi=1.0, phi_dot=0.0, **{name: 2.0})
        assert abs(pendulum["phi_ddot"] - free + 2.0) < 1e-12  # k_5 phi^5 / J
