"""The lateral vehicle: quasi-static curving by hand, and the same vehicle put together from three FMUs."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmus.bogie.model import Bogie
from fmus.carbody.model import Carbody
from fmus.export.builders.native.build import build_native
from fmus.export.builders.pythonfmu import build_python
from fmus.host.master.master import Master
from fmus.variables import State
from fmus.vehiclelateral.model import VehicleLateral
from tests.helpers.evaluated import Evaluated

G = 9.81
SIDES = ("left", "right")
BOGIES = {"front": ("f", "12"), "rear": ("r", "34")}
BODY = ("y", "psi", "phi")
CONNECTED = [
    *((f"{b}.{F}_c", f"body.{F}_{end}") for b, (end, _) in BOGIES.items() for F in ("F_y", "M_z", "M_x")),
    *(
        (f"body.{q}_c{end}{dot}", f"{b}.{q}_c{dot}")
        for b, (end, _) in BOGIES.items()
        for q in BODY
        for dot in ("", "_dot")
    ),
]


@pytest.fixture(scope="module")
def vehicle():
    return Evaluated(VehicleLateral())


@pytest.fixture(scope="module")
def parts():
    return Evaluated(Bogie()), Evaluated(Carbody())


def in_bogie(name, numbers, end):
    """Name in a bogie's model of a variable of the vehicle; nothing where it is another's."""
    words = name.split("_")
    for place, word in enumerate(words):
        if place and word in (*numbers, end):
            words[place] = str(numbers.index(word) + 1) if word in numbers else "b"
            return "_".join(words)
    return ""


def curve(V, radius, cant):
    """Inputs of a curve to the left under all wheelsets."""
    return {"V": V, **{f"kappa_{i}": 1 / radius for i in "1234"}, **{f"cant_{i}": cant for i in "1234"}}


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**31))
def test_the_vehicle_is_its_two_bogies_and_its_body(vehicle, parts, seed):
    """Rates of all states are those of the three connected models, at any state, in any transition."""
    bogie, body = parts
    rng = np.random.default_rng(seed)
    x = {v.name: v.nominal * rng.uniform(-2, 2) for v in vehicle.model.of(State)}
    track = {
        f"{q}_{i}{dot}": size * rng.uniform(-1, 1)
        for q, size in (("y_irr", 1e-3), ("kappa", 2e-3), ("cant", 0.1))
        for i in "1234"
        for dot in ("", "_dot")
    }
    V = rng.uniform(5, 70)
    under = {
        f"{q}_{end}{dot}": np.mean([track[f"{q}_{i}{dot}"] for i in numbers])
        for end, numbers in BOGIES.values()
        for q in ("kappa", "cant")
        for dot in ("", "_dot")
    }
    own = {name: v for name, v in x.items() if name in body.names[State]}
    over = body.outputs(**own, **under, V=V)
    forces, found = {}, {}
    for end, numbers in BOGIES.values():
        names = {n: in_bogie(n, numbers, end) for n in (*x, *track)}
        given_ = {names[n]: v for n, v in (x | track).items() if names[n]}
        given_ |= {f"{q}_c{dot}": over[f"{q}_c{end}{dot}"] for q in BODY for dot in ("", "_dot")}
        rates, out = bogie.rates(**given_, V=V), bogie.outputs(**given_, V=V)
        found |= {n: rates[names[n]] for n in x if names[n]}
        forces |= {f"{F}_{end}": out[f"{F}_c"] for F in ("F_y", "M_z", "M_x")}
    # the body's cant deficiency has sines and cosines of the mean cant of a bogie, the vehicle's their means
    found |= body.rates(**own, **under, **forces, V=V)
    whole = vehicle.rates(**x, **track, V=V)
    for name, rate in whole.items():
        close = {"rel": 1e-9, "abs": 1e-9} if name != "y_c_dot" else {"abs": 0.02}
        assert rate == pytest.approx(found[name], **close), name


@pytest.mark.parametrize(("radius", "cant"), [(1500.0, 0.0), (1500.0, 0.06), (3000.0, 0.1)])
def test_quasi_static_curving_by_hand(vehicle, radius, cant):
    """Guiding forces carry the cant deficiency, wheel loads the weight and its moment about the rails."""
    V = 30.0
    said = curve(V, radius, cant)
    at = vehicle.equilibrium(**said)
    o = vehicle.outputs(**said, **at)
    across = V**2 / radius * np.cos(cant) - G * np.sin(cant)
    down = G * np.cos(cant) + V**2 / radius * np.sin(cant)
    bodies = [(32000.0, 1.8, at["y_c"]), *((2615.0, 0.6, at[f"y_{e}"]) for e in "fr")]
    bodies += [(1813.0, 0.46, at[f"y_{i}"]) for i in "1234"]
    mass = sum(m for m, _, _ in bodies)
    assert sum(o[f"Y_{i}_right"] - o[f"Y_{i}_left"] for i in "1234") == pytest.approx(mass * across, abs=0.01)
    assert sum(o[f"Q_{i}_{side}"] for i in "1234" for side in SIDES) == pytest.approx(mass * down, rel=1e-9)
    moment = sum((o[f"Q_{i}_right"] - o[f"Q_{i}_left"]) * 0.75 for i in "1234")
    shift = sum((o[f"Q_{i}_right"] + o[f"Q_{i}_left"]) * at[f"y_{i}"] for i in "1234")
    gyroscopic = 4 * 112 * V / 0.46 * V / radius
    by_hand = sum(m * (h * across - down * y) for m, h, y in bodies) + shift + gyroscopic
    assert moment == pytest.approx(
        by_hand, abs=120
    )  # of some 30 kN.m; rolling other than at V/r0 is left out


def test_the_body_leans_outwards_and_the_outer_wheels_are_loaded(vehicle):
    at = vehicle.equilibrium(**curve(30.0, 1000.0, 0.0))
    o = vehicle.outputs(**curve(30.0, 1000.0, 0.0), **at)
    assert at["phi_c"] > at["phi_f"] > 0  # left side up: to the outside of a curve to the left
    assert at["y_c"] < 0
    assert all(o[f"Q_{i}_right"] > o[f"Q_{i}_left"] for i in "1234")


def test_a_lost_yaw_damper_of_one_bogie_lowers_the_critical_speed(vehicle):
    def critical(**health):
        low, high = 40.0, 120.0
        while high - low > 0.2:
            V = (low + high) / 2
            grows = np.linalg.eigvals(vehicle.state_matrix(V=V, **health)).real.max() > 0
            low, high = (low, V) if grows else (V, high)
        return low

    sound, one, both = critical(), critical(h_d_f=0.0), critical(h_d_f=0.0, h_d_r=0.0)
    assert both <= one < sound


def errors(found, expected):
    """Largest differences over the largest value of each column, the worst of all columns."""
    return max(
        float(np.abs(found[n] - expected[n]).max() / np.abs(expected[n]).max()) for n in expected.columns[1:]
    )


@pytest.mark.slow
def test_three_fmus_of_the_master_run_as_the_one_fmu(tmp_path, vehicle):
    """Second order in the step with linear extrapolation; at 1 ms 8e-5 of the largest value of an output."""
    names = ("y_1", "psi_2", "y_f", "psi_f", "phi_f", "y_4", "psi_r", "y_c", "phi_c", "Q_1_left", "Y_3_right")
    whole, bogie = (build_python(m(), tmp_path) for m in (VehicleLateral, Bogie))
    body = build_native(Carbody(), tmp_path)  # which states that its motion depends on no force at once
    kick = {f"F_y_{i}_ext": f"4e3 * sin(6 * t) + {i}e3 * sin(9 * t)" for i in (1, 3)}
    curved = {f"kappa_{i}": 5e-4 for i in "1234"} | {f"cant_{i}": 0.02 for i in "1234"}

    def one(step):
        inputs = {f"v.{n}": v for n, v in (kick | curved | {"V": 40.0}).items()}
        with Master(
            {"v": whole}, [], step=step, inputs=inputs,
            record=[f"v.{n}" for n in names], record_step=0.02,
        ) as master:  # fmt: skip
            return master.run(1.0).data.rename(columns=lambda n: n.removeprefix("v."))

    def three(step):
        inputs = {f"{fmu}.V": 40.0 for fmu in (*BOGIES, "body")}
        renamed = {}
        for b, (end, numbers) in BOGIES.items():
            here = {n: in_bogie(n, numbers, end) for n in (*names, *kick, *curved)}
            inputs |= {f"{b}.{here[n]}": v for n, v in (kick | curved).items() if here[n]}
            inputs |= {f"body.kappa_{end}": 5e-4, f"body.cant_{end}": 0.02}
            renamed |= {f"{b}.{here[n]}": n for n in names if here[n]}
        renamed |= {f"body.{n}": n for n in names if n.endswith("_c")}
        with Master(
            {"front": bogie, "rear": bogie, "body": body}, CONNECTED, step=step, inputs=inputs,
            order="gauss_seidel", extrapolation="linear", record=list(renamed), record_step=0.02,
        ) as master:  # fmt: skip
            return master.run(1.0).data.rename(columns=renamed)

    exact = one(2.5e-4)
    found = {step: errors(three(step)[exact.columns], exact) for step in (4e-3, 2e-3, 1e-3)}
    assert found[1e-3] < 2e-4
    for coarse, fine in pairwise(found.values()):
        assert 2.5 < coarse / fine < 6
