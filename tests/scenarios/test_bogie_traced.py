"""Effects on a bogie are traced in records of its truth: yaw dampers that are lost, wheels that are worn."""

import numpy as np
import pytest

from scenarios import close_loop
from tests.truth.bogie import NOISE, Truth, write_record

SLIPPERY = (0.45, 0.4, 0.6, 0.9, 0.4)  # somewhat off the declared friction


@pytest.mark.slow
@pytest.mark.parametrize(
    ("true", "seed", "duration", "effect", "parameter", "value"),
    [
        (Truth(friction=SLIPPERY, yaw_dampers=0.0), 3, 16.0, "damping_change@secondary_yaw", "change", -1.0),
        (Truth(friction=SLIPPERY, hollow=0.4), 4, 8.0, "parameter_offset@wear", "delta", 1.0),
    ],
)
def test_it_is_traced(tmp_path, true, seed, duration, effect, parameter, value):
    write_record(tmp_path, "bogie", np.random.default_rng(seed), true, duration=duration)
    result = close_loop(tmp_path / "bogie", tmp_path / "out", jobs=1)
    assert result.verdict == "traced"
    [found] = result.effects
    assert f"{found.kind}@{found.location}" == effect
    assert found.parameters[parameter][0] == pytest.approx(value, abs=0.05)
    for output, noise in NOISE.items():
        assert result.error[output]["after"] < 1.1 * noise
