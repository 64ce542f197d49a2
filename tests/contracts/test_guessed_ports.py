"""What `railfmi init` guesses of the ports of an FMU, against the terminals that every model declares."""

from pathlib import Path

import numpy as np

from fmus.export.builders.native.table import table
from fmus.host.archive import describe
from fmus.model import equations
from fmus.models import MODELS
from scenarios.preparing.draft import draft
from scenarios.preparing.survey import Channel, Raster
from tests.helpers.sizes import by_size

NOTHING = Raster(Path("log.csv"), "time", np.arange(3.0), (Channel("-", None, np.zeros(3), ()),), ())


@by_size
def test_a_port_has_the_motion_of_its_terminal(name, built):
    """By names, units and descriptions alone, as of any FMU."""
    model, fmu = MODELS[name](), built(name)
    found = {p.force: (p.velocity, p.displacement) for p in draft(fmu, describe(fmu), [NOTHING]).ports}
    for terminal in table(model, equations(model)).terminals:
        of = terminal.members
        assert found[of["force"]] == (of["velocity"], of["displacement"])
