"""Tracks: what a vehicle feels of them, and that they have the spectra, statistics and shapes asked for."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from scipy.signal import csd, welch
from scipy.stats import chi2

from fmus.errors import BadInput
from fmus.models import MODELS
from fmus.variables import Input
from scenarios.track import (
    SPECTRA,
    Spectrum,
    Track,
    inputs,
    journey,
    profile_figure,
    read_source,
    read_track,
    riders,
)
from scenarios.track.defects import DEFECTS
from scenarios.track.figures import spectrum_figure
from scenarios.track.rails import PLANES, QUANTITIES
from scenarios.track.statistics import CHOCEN_DOBRIKOV, Statistics, fit
from scenarios.track.synthesis import generator, realise
from tests.helpers.paths import ROOT, SHARED

COEFFICIENTS = SHARED / "data" / "benchmarks" / "track_psd_coefficients.json"
HERE = Path()
D1 = (3.0, 25.0)  # m, the range of wavelengths D1 of EN 13848-1
BAND = (2 * np.pi / D1[1], 2 * np.pi / D1[0])
GOOD = {"kind": "spectrum", "spectrum": "erri_low", "length": 600.0, "wavelengths": list(D1), "seed": 1}
heights = arrays(np.int64, 12, elements=st.integers(-10000, 10000)).map(lambda microns: 1e-6 * microns)


def waves(length: float = 600.0, seed: int = 1, **more) -> Track:
    return read_track(GOOD | {"length": length, "seed": seed} | more, HERE)


# ---- rails, values, slopes


@given(heights, heights, heights, heights)
def test_rails_and_their_means_say_the_same(yl, yr, zl, zr):
    s = np.arange(12.0)
    a = Track.from_samples(s, {"y_left": yl, "y_right": yr, "z_left": zl, "z_right": zr})
    b = Track.from_samples(
        s, {"alignment": (yl + yr) / 2, "gauge": yl - yr, "level": (zl + zr) / 2, "cross_level": zl - zr}
    )
    for name in QUANTITIES:
        assert_allclose(getattr(a.rails, name), getattr(b.rails, name), atol=1e-15)
    assert_array_equal(a.distance, s)
    assert_allclose(a.y_left, yl, atol=1e-15)
    assert_allclose(a.z_right, zr, atol=1e-15)


@given(heights, st.floats(0, 11))
def test_cubics_run_through_the_samples_and_never_past_them(z, s):
    track = Track.from_samples(np.arange(12.0), {"level": z})
    i = min(int(s), 10)
    assert min(z[i : i + 2]) - 1e-12 <= track.at(s).level <= max(z[i : i + 2]) + 1e-12


@given(heights)
def test_slopes_are_the_derivative(z):
    track = Track.from_samples(np.arange(12.0), {"z_left": z, "z_right": np.zeros(12)})
    x, w = np.polynomial.legendre.leggauss(3)  # exact for the square polynomials that slopes are
    s = np.arange(11.0)[:, None] + (x + 1) / 2
    assert_allclose((track.slope(s).z_left * w / 2).sum(axis=1), np.diff(z), atol=1e-14)


def test_beyond_its_ends_a_track_goes_straight_on():
    track = Track.from_samples([10.0, 11.0, 12.0], {"alignment": [1e-3, 3e-3, 2e-3]})
    assert_allclose(track.at([-5.0, 10.0, 12.0, 99.0]).alignment, [1e-3, 1e-3, 2e-3, 2e-3])
    assert_array_equal(track.slope([-5.0, 99.0]).alignment, 0)
    assert (track.start, track.end) == (10.0, 12.0)


def test_a_track_cannot_be_changed():
    given_z = np.zeros(3)
    track = Track.from_samples([0.0, 1.0, 2.0], {"level": given_z})
    given_z[1] = 1.0
    assert_array_equal(track.at([0.5, 1.0]).level, 0)
    with pytest.raises(ValueError, match="read-only"):
        track.layers[0].rails.z_left[0] = 1.0


@pytest.mark.parametrize(
    ("distance", "rails", "words"),
    [
        ([0.0, 0.0], {"level": [0, 0]}, "distance: needs at least two finite numbers that increase"),
        ([0.0], {"level": [0]}, "distance: needs at least two"),
        ([0.0, 1.0], {"level": [0, 0, 0]}, "level: needs one finite number for each of the 2 distances"),
        ([0.0, 1.0], {"gauge": [0, np.nan]}, "gauge: needs one finite number"),
        ([0.0, 1.0], {"y_left": [0, 0]}, "'y_left' is given without 'y_right'"),
        ([0.0, 1.0], {"z_right": [0, 0], "level": [0, 0]}, "describe the same direction"),
    ],
)
def test_samples_that_make_no_track(distance, rails, words):
    with pytest.raises(ValueError, match=words):
        Track.from_samples(distance, rails)


# ---- journeys and inputs


TIMES = st.floats(-5, 30).map(lambda t: round(t, 6))  # quad does not take 1e-308 s


@given(arrays(np.float64, 5, elements=st.floats(0.0, 60.0)), TIMES, st.floats(-100, 100))
def test_distance_is_the_integral_of_speed(speeds, t, start):
    run = journey((np.array([0.0, 2.0, 3.0, 10.0, 20.0]) + 1.5, speeds), start)
    exact = quad(run.speed, 0, t, points=[x for x in (1.5, 3.5, 4.5, 11.5, 21.5) if 0 < x < t] or None)[0]
    assert_allclose(run.distance(t), start + exact, atol=1e-6)


def test_a_constant_speed():
    assert_allclose(journey(20.0, start=5.0).distance([0.0, 3.0]), [5.0, 65.0])
    assert_allclose(journey(20.0).speed([0.0, 3.0]), 20.0)


@pytest.mark.parametrize("V", [np.nan, ([0.0, 0.0], [1.0, 1.0]), ([0.0, 1.0], [1.0]), ([], [])])
def test_what_is_no_speed(V):
    with pytest.raises(BadInput, match="speed V: needs"):
        journey(V)


VARYING = ([0.0, 8.0, 20.0], [12.0, 30.0, 5.0])


@pytest.mark.parametrize(("model", "geometry"), [("wheelset", {}), ("vehicle7dof", {"axle_spacing": 2.5})])
def test_rates_are_the_derivatives_of_the_inputs(model, geometry):
    found = inputs(waves(), VARYING, model, **geometry)
    t = np.linspace(1, 19, 4001)
    h = 1e-5
    names = [name for name in found if name.endswith("_dot")]
    assert len(names) == {"wheelset": 1, "vehicle7dof": 4}[model]
    for name in names:
        u = found[name.removesuffix("_dot")]
        rate = found[name](t)
        # central differences err by h² u'''/6 and at the corners of the slopes
        assert_allclose((u(t + h) - u(t - h)) / (2 * h), rate, atol=2e-3 * np.abs(rate).max())


def test_the_rear_bogie_feels_what_the_front_one_felt():
    found = inputs(waves(), 20.0, "vehicle7dof", a1=9.5, a2=9.5)
    t = np.linspace(1, 25, 1000)
    for side in "lr":
        for end in ("", "_dot"):
            front, rear = found[f"u_f{side}{end}"], found[f"u_r{side}{end}"]
            assert np.ptp(rear(t)) > 0
            assert_allclose(rear(t), front(t - 0.95), atol=1e-12)


def test_a_bogie_side_feels_the_mean_of_its_axles():
    track = waves()
    found = inputs(track, 20.0, "vehicle7dof", axle_spacing=2.5, offset=7.0)
    t = np.linspace(0, 20, 100)
    s = 20 * t + 7
    assert_allclose(found["u_fl"](t), (track.at(s + 1.25).z_left + track.at(s - 1.25).z_left) / 2)
    rear = (track.at(s - 17.75).z_right + track.at(s - 20.25).z_right) / 2
    assert_allclose(found["u_rr"](t), rear)


def test_the_wheelset_feels_alignment_gauge_and_speed():
    track = waves()
    found = inputs(track, VARYING, "wheelset", offset=3.0)
    t = np.linspace(0, 15, 100)
    s = journey(VARYING).distance(t) + 3
    assert list(found) == ["y_irr", "y_irr_dot", "gauge_irr", "V"]
    assert_allclose(found["y_irr"](t), track.at(s).alignment)
    assert_allclose(found["gauge_irr"](t), track.at(s).gauge)
    assert_allclose(found["V"](t), np.interp(t, *VARYING))


@pytest.mark.parametrize("model", MODELS)
def test_an_input_on_a_track_has_the_unit_of_what_it_is(model):
    felt = riders().get(model, {})
    assert {v.name for v in MODELS[model]().of(Input) if v.name in felt} == felt.keys()
    for name, where in felt.items():
        unit = "m/s" if where.rate or where.quantity == "speed" else "m"
        assert vars(MODELS[model])[name].unit == unit
    if felt:
        assert inputs(waves(), 20.0, model).keys() == felt.keys()
    else:
        with pytest.raises(BadInput, match=f"model '{model}' takes no inputs from a track"):
            inputs(waves(), 20.0, model)


def test_models_that_know_no_track():
    with pytest.raises(
        BadInput, match="model 'wheelst' takes no inputs from a track; did you mean 'wheelset'"
    ):
        inputs(waves(), 20.0, "wheelst")
    with pytest.raises(BadInput, match="'vehicle7dof' on a track has no 'a3'"):
        inputs(waves(), 20.0, "vehicle7dof", a3=1.0)


# ---- spectra

EVERY_SPECTRUM = [(name, q) for name, of in SPECTRA.items() for q in of]


@pytest.mark.parametrize(("name", "quantity"), EVERY_SPECTRUM)
def test_the_variance_of_a_band_is_the_integral_of_its_density(name, quantity):
    S = SPECTRA[name][quantity]
    assert_allclose(S.variance(*BAND), quad(S.density, *BAND)[0], rtol=1e-9)
    # the same over cycles per metre
    cycles = quad(S.density_per_cycle, 1 / D1[1], 1 / D1[0])[0]
    assert_allclose(S.variance(*BAND), cycles, rtol=1e-9)


corners = st.tuples(*[st.floats(0.01, 3.0)] * 3).filter(lambda c: min(np.diff(sorted(c))) > 1e-2)


@given(corners, st.booleans(), st.sampled_from([1, 2]))
def test_units_and_sides_of_ones_own_spectrum(c, high_pass, sides):
    """A density over 1/m, one- or two-sided, put together here from its definition."""
    A, n_c, n_r, n_s = 1e-7, *c[:2], (c[2] if high_pass else None)
    S = Spectrum.of(A, n_c, n_r, n_s, per="1/m", sides=sides)

    def printed(n):
        value = A * n_c**2 / ((n**2 + n_r**2) * (n**2 + n_c**2))
        return value * n**2 / (n**2 + n_s**2) if high_pass else value

    assert_allclose(S.density_per_cycle(0.2), sides * printed(0.2), rtol=1e-12)
    variance = sides * quad(printed, 1 / D1[1], 1 / D1[0])[0]
    assert_allclose(S.variance(*BAND), variance, rtol=1e-7)


def test_the_whole_variance_in_closed_form():
    # integral from 0 to infinity: pi A Oc/(2 Or (Or + Oc))
    S = SPECTRA["erri_low"]["level"]
    whole = np.pi * S.A * S.Omega_c / (2 * S.Omega_r * (S.Omega_r + S.Omega_c))
    assert_allclose(S.variance(1e-12, 1e12), whole, rtol=1e-9)


@pytest.mark.parametrize(
    "wrong", [(0.0, 1, 0), (1, 0.0, 1), (1, 1, 1), (1, 1, -1), (1, np.inf, 1), (1, 2, 1, 2)]
)
def test_what_is_no_spectrum(wrong):
    with pytest.raises(BadInput, match="a spectrum needs"):
        Spectrum(*wrong)


def test_spectra_are_those_of_the_standards():
    if not COEFFICIENTS.exists():
        pytest.skip("the table of published coefficients is not beside the repository")
    table = json.loads(COEFFICIENTS.read_text())
    w = np.geomspace(0.05, 5, 30)
    erri = table["german_ERRI_B176"]
    c, r, s = (erri[k] for k in ("Wc", "Wr", "Ws"))
    low_pass = c**2 / ((w**2 + r**2) * (w**2 + c**2))
    for level in ("low", "high"):
        A, of = erri[level], SPECTRA[f"erri_{level}"]
        assert_allclose(of["level"].density(w), A["A_v"] * low_pass)
        assert_allclose(of["alignment"].density(w), A["A_a"] * low_pass)
        assert_allclose(of["gauge"].density(w), A["A_g"] * low_pass * w**2 / (w**2 + s**2))
        # the standard's cross level is an angle; a height over twice half the base of 0.75 m is 1.5 m of it
        angle = A["A_v"] / 0.75**2 * low_pass * w**2 / (w**2 + s**2)
        assert_allclose(of["cross_level"].density(w), 1.5**2 * angle)
    fra = table["FRA_vertical_form2"]
    lateral = table["FRA_lateral_UNVERIFIED_from_memory"]["A_a_cm2rad_per_m"]
    form = 0.25e-4 * fra["Wc"] ** 2 / (w**2 * (w**2 + fra["Wc"] ** 2))  # cm² to m²
    for k, A_v in fra["A_v_cm2rad_per_m"].items():
        assert_allclose(SPECTRA[f"fra_{k}"]["level"].density(w), A_v * form)
        assert_allclose(SPECTRA[f"fra_{k}"]["alignment"].density(w), lateral[k] * form)


@pytest.mark.parametrize("name", SPECTRA)
def test_in_short_waves_the_rails_are_independent(name):
    """Then the difference of two equal variances is four times their mean's, and the units agree."""
    of = SPECTRA[name]
    assert_allclose(of["cross_level"].density(100.0) / of["level"].density(100.0), 4, rtol=1e-3)


@pytest.mark.parametrize(
    ("name", "alignment", "level"),
    [("erri_low", 0.714e-3, 0.984e-3), ("erri_high", 1.213e-3, 1.611e-3), ("fra_6", 1.429e-3, 1.429e-3)],
)
def test_standard_deviations_in_d1(name, alignment, level):
    # by quadrature of the printed formulas, in m; a factor of 2, 2 pi or 1e-2 would show
    assert_allclose(SPECTRA[name]["alignment"].variance(*BAND) ** 0.5, alignment, rtol=1e-3)
    assert_allclose(SPECTRA[name]["level"].variance(*BAND) ** 0.5, level, rtol=1e-3)


def test_worse_classes_are_rougher():
    for quantity in ("alignment", "level"):
        rough = [SPECTRA[f"fra_{k}"][quantity].variance(*BAND) for k in range(1, 7)]
        assert np.all(np.diff(rough) < 0)
        assert SPECTRA["erri_low"][quantity].variance(*BAND) < SPECTRA["erri_high"][quantity].variance(*BAND)


# ---- realisations


@pytest.mark.parametrize(("name", "quantity"), EVERY_SPECTRUM)
def test_a_realisation_has_the_variance_of_its_band(name, quantity):
    S = SPECTRA[name][quantity]
    x = realise(S, 700.0, 10000, BAND, generator(3, quantity))
    assert_allclose(np.var(x), S.variance(*BAND), rtol=1e-12)
    assert abs(x.mean()) < 1e-12 * x.std()


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("quantity", ["alignment", "gauge", "level", "cross_level"])
def test_the_realised_spectrum_is_the_requested_one(quantity, seed):
    """Welch's estimate over 47 half-overlapping pieces of 500 m, against the chi-squared it scatters by."""
    track = waves(12000.0, seed, step=0.15)
    S = SPECTRA["erri_low"][quantity]
    x = getattr(track.rails, quantity)[:-1]
    n, estimate = welch(x, fs=1 / 0.15, nperseg=round(500 / 0.15), window="hann", detrend=False)
    inside = (n > 1 / D1[1] + 4 / 500) & (n < 1 / D1[0] - 4 / 500)
    ratio = estimate[inside] / S.density_per_cycle(n[inside])
    dof = 2 * 47 / (1 + 2 / 36)  # Hann pieces that overlap by half correlate by 1/6
    low, high = chi2.ppf([1e-6, 1 - 1e-6], dof) / dof
    assert ratio.min() > low
    assert ratio.max() < high
    # neighbours hang together over some 1.5 bins
    assert ratio.mean() == pytest.approx(1, abs=4 * np.sqrt(2 / dof * 1.5 / ratio.size))
    outside = (n < 1 / D1[1] - 4 / 500) | (n > 1 / D1[0] + 4 / 500)
    assert estimate[outside].sum() < 1e-6 * estimate.sum()


def test_cubics_between_the_samples_add_no_power_to_speak_of():
    track = waves(3000.0)
    s = np.arange(0, 3000, 0.02)
    for values, share in ((track.at(s).level, 1e-7), (track.slope(s).level, 1e-4)):
        n, estimate = welch(values, fs=50, nperseg=25000)
        assert estimate[n > 1 / D1[0] + 4 / 500].sum() < share * estimate.sum()


def test_a_finer_spacing_shows_the_same_track():
    coarse, fine = waves(step=0.3), waves(step=0.05)
    assert_allclose(fine.z_left[::6], coarse.z_left, atol=1e-15)


def test_same_seed_same_track_and_no_quantity_asks_the_others():
    assert_array_equal(waves(seed=7).y_left, waves(seed=7).y_left)
    alone = waves(seed=7, quantities=["level"])
    assert_allclose(alone.rails.level, waves(seed=7).rails.level, atol=1e-15)
    assert_array_equal(alone.y_left, 0)


def test_seeds_and_quantities_are_independent():
    a, b = waves(12000.0, 1, step=0.3).rails, waves(12000.0, 2, step=0.3).rails
    pairs = [(a.level, b.level), (a.level, a.alignment), (a.gauge, a.cross_level), (a.level, a.cross_level)]
    for x, y in pairs:
        n, cross = csd(x, y, fs=1 / 0.3, nperseg=1000)
        (_, p), (_, q) = welch(x, fs=1 / 0.3, nperseg=1000), welch(y, fs=1 / 0.3, nperseg=1000)
        inside = (n > 1 / D1[1]) & (n < 1 / D1[0])
        coherence = np.abs(cross[inside]) ** 2 / (p[inside] * q[inside])
        assert coherence.mean() < 3 / 70  # 1/K for independent signals in K pieces, here some 79 that overlap


def test_a_track_closes_on_itself_or_runs_in_from_nothing():
    closed, started = waves(), waves(run_in=50.0)
    for name in ("y_left", "z_right"):
        x = getattr(closed, name)
        assert x[0] != 0
        assert_allclose(x[-1], x[0], rtol=1e-12)
        y = getattr(started, name)
        assert y[0] == 0
        later = closed.distance >= 50
        assert_allclose(x[later], y[later], rtol=1e-12)
    assert_allclose(started.slope(0.0).level, 0, atol=1e-9)


# ---- statistics


@pytest.mark.parametrize("name", ["erri_low", "fra_4"])
@pytest.mark.parametrize("seed", range(3))
def test_the_line_of_the_thesis_has_its_statistics(name, seed):
    track = waves(3000.0, seed, spectrum=name, like="chocen_dobrikov", step=0.15)
    for quantity, wanted in CHOCEN_DOBRIKOV.items():
        x = getattr(track.rails, quantity)[:-1]
        assert_allclose([x.std(), x.max(), x.min()], [wanted.sd, wanted.max, wanted.min], rtol=1e-6)


@settings(max_examples=15)
@given(st.floats(3.0, 6.5), st.floats(3.0, 6.5), st.integers(0, 99))
def test_extremes_are_met_and_the_spectrum_keeps_its_form(highest, lowest, seed):
    x = realise(SPECTRA["erri_high"]["level"], 1500.0, 8000, BAND, generator(seed, "level"))
    y = fit(x, Statistics(sd=2e-3, max=highest * 2e-3, min=-lowest * 2e-3))
    assert_allclose([y.std(), y.max(), y.min()], [2e-3, 2e-3 * highest, -2e-3 * lowest], rtol=1e-6)
    before, after = (np.abs(np.fft.rfft(z / z.std())) ** 2 for z in (x, y))
    assert np.abs(np.sqrt(after) - np.sqrt(before)).max() < 0.005 * np.sqrt(before.max())
    assert after[before < 1e-9 * before.max()].sum() < 2e-6 * after.sum()


def test_the_standard_deviation_alone_only_scales():
    x = realise(SPECTRA["fra_6"]["gauge"], 600.0, 4000, BAND, generator(1, "gauge"))
    assert_allclose(fit(x, Statistics(sd=1e-3)), 1e-3 * x / x.std(), rtol=1e-12, atol=1e-15)


def test_the_spectrum_asked_for_follows_the_standard_deviation():
    source = read_source(GOOD | {"statistics": {"level": {"sd": 2e-3}}})
    low = SPECTRA["erri_low"]
    assert_allclose(source.requested["level"].variance(*BAND), 4e-6, rtol=1e-12)
    assert source.requested["level"].Omega_c == low["level"].Omega_c
    assert source.requested["gauge"] == low["gauge"]
    assert_allclose(source.track(HERE).rails.level[:-1].std(), 2e-3, rtol=1e-9)
    by_rails = read_source(GOOD | {"statistics": {"z_left": {"sd": 1e-3}, "z_right": {"sd": 2e-3}}})
    assert set(by_rails.requested) == {"alignment", "gauge"}


@pytest.mark.parametrize("extremes", [{"max": 1e-3}, {"max": 20e-3, "min": -20e-3}])
def test_extremes_that_no_such_track_has(extremes):
    with pytest.raises(BadInput, match=r"extremes of .* out of reach .* sd 0.001 m, which come to"):
        waves(statistics={"alignment": {"sd": 1e-3, **extremes}})


# ---- defects

SIZES = {"length": 4.0, "wavelength": 6.0, "cycles": 3, "transition": 1.5}
EVERY_DEFECT = sorted(DEFECTS)


def defect(shape: str, **more):
    fields = DEFECTS[shape].model_fields.items()
    sizes = {name: SIZES.get(name, 2.0) for name, field in fields if field.is_required() or name in SIZES}
    return {"shape": shape, **sizes, "position": 50.0, "height": 2e-3, **more}


def laid(shape: str, **more) -> Track:
    return read_track({"kind": "defect", **defect(shape, **more)}, HERE)


@pytest.mark.parametrize("on", QUANTITIES)
@pytest.mark.parametrize("shape", EVERY_DEFECT)
def test_a_defect_stands_where_and_on_what_it_says(shape, on):
    track = laid(shape, on=on)
    s = np.linspace(0, 100, 2001)
    moved = getattr(track.at(s), on)
    assert_allclose(np.abs(moved).max(), 2e-3, rtol=1e-12)
    assert_allclose(moved[0], 0, atol=2e-3 * 1e-4)
    for rails, means in PLANES:
        for pair in (rails, means):
            if on in pair:  # its partner stays at rest, the other direction too
                other = pair[1 - pair.index(on)]
                assert_array_equal(getattr(track.at(s), other), 0)
        if on not in (*rails, *means):
            assert_array_equal([getattr(track.at(s), name) for name in rails], 0)


@pytest.mark.parametrize("shape", EVERY_DEFECT)
def test_the_slope_of_a_defect_is_its_derivative(shape):
    track = laid(shape, on="z_left")
    h = 1e-6
    # off the corners, which lie at whole and half metres
    s = np.linspace(30, 70, 801) + 0.0131
    slope = track.slope(s).z_left
    assert_allclose((track.at(s + h).z_left - track.at(s - h).z_left) / (2 * h), slope, atol=1e-9)
    assert (np.abs(slope).max() > 0) == (shape != "step")


def test_shapes_by_hand():
    s = np.array([47.0, 48.0, 49.0, 50.0, 51.0, 52.0, 53.0])
    rows = {
        "step": [0, 0, 0, 1, 1, 1, 1],
        "ramp": [0, 0, 0.103515625, 0.5, 0.896484375, 1, 1],
        "dip": [0, 0, 0.5, 1, 0.5, 0, 0],
        "kink": [0, 0, 0.5, 1, 0.5, 0, 0],
        "cusp": np.exp(-np.abs(s - 50) / 4),
        "cyclic_top": [0, 0.25, 0.75, 1, 0.75, 0.25, 0],
        "gauge_widening": [0, 0, 1 - 17 / 81, 1, 1 - 17 / 81, 0, 0],  # quintic at two thirds: 64/81
    }
    assert rows.keys() <= DEFECTS.keys()
    for shape, row in rows.items():
        assert_allclose(laid(shape, on="level").at(s).level, 2e-3 * np.array(row), atol=1e-15, err_msg=shape)


def test_defects_lie_on_top_of_a_track_and_change_nothing_else():
    plain, spoilt = waves(), waves(add=[defect("dip"), defect("gauge_widening", position=300.0)])
    s = np.linspace(0, 600, 5001)
    dip, wide = laid("dip"), laid("gauge_widening", position=300.0)
    for name in QUANTITIES:
        apart = getattr(plain.at(s), name) + getattr(dip.at(s), name) + getattr(wide.at(s), name)
        assert_allclose(getattr(spoilt.at(s), name), apart, atol=1e-15)
    assert np.isin(spoilt.distance, plain.distance).sum() == plain.distance.size


# ---- measured files


def write(folder: Path, columns: dict[str, np.ndarray], name: str = "track.csv") -> Path:
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{float(cell)!r}" for cell in row) for row in rows)]
    (folder / name).write_text("\n".join(lines) + "\n")
    return folder


RECORD = waves(200.0)
FILE = {
    "kind": "file",
    "data": "track.csv",
    "distance": {"column": "km", "unit": "km"},
    "columns": {
        "y_left": {"column": "yl", "unit": "mm"},
        "y_right": {"column": "yr", "unit": "mm", "factor": -1},
        "level": {"column": "level", "unit": "m"},
    },
}


def record() -> dict[str, np.ndarray]:
    s = RECORD.distance
    r = RECORD.rails
    return {"km": 12 + s / 1e3, "yl": 1e3 * r.y_left, "yr": -1e3 * r.y_right, "level": r.level, "t": s / 20}


def test_a_file_over_distance(tmp_path):
    track = read_track(FILE, write(tmp_path, record()))
    assert_allclose(track.distance, RECORD.distance, atol=1e-9)
    assert_allclose(track.y_left, RECORD.y_left, atol=1e-15)
    assert_allclose(track.y_right, RECORD.y_right, atol=1e-15)
    assert_allclose(track.rails.level, RECORD.rails.level, atol=1e-15)
    assert_array_equal(track.rails.cross_level, 0)


def over_time(**speed) -> dict:
    table = {key: value for key, value in FILE.items() if key != "distance"}
    return table | {"time": {"column": "t", "unit": "s"}, **speed}


def test_a_file_over_time_at_a_constant_speed(tmp_path):
    track = read_track(over_time(V=20.0), write(tmp_path, record()))
    assert_allclose(track.distance, RECORD.distance, atol=1e-9)


def test_a_file_over_time_with_its_speed(tmp_path):
    t = np.linspace(0, 10, 51)
    columns = {"t": t + 3, "v": 3.6 * (5 + 2 * t), "level": np.sin(t)}
    table = {
        "kind": "file",
        "data": "track.csv",
        "time": {"column": "t", "unit": "s"},
        "speed": {"column": "v", "unit": "km/h"},
        "columns": {"level": {"column": "level", "unit": "mm"}},
    }
    track = read_track(table, write(tmp_path, columns))
    assert_allclose(track.distance, 5 * t + t**2, atol=1e-12)  # the exact integral of a speed that is linear
    assert_allclose(track.rails.level, 1e-3 * np.sin(t), atol=1e-15)


def spoilt(**changes) -> dict:
    columns = record()
    for name, (row, value) in changes.items():
        columns[name][row] = value
    return columns


@pytest.mark.parametrize(
    ("table", "columns", "words"),
    [
        (FILE | {"data": "no.csv"}, record(), "no.csv: data file cannot be read"),
        (FILE | {"data": "track.xyz"}, record(), "has no known format; convert it to one of .csv"),
        (FILE | {"distance": {"column": "kmm", "unit": "km"}}, record(), "column 'kmm' is not in"),
        (
            FILE | {"distance": {"column": "km", "unit": "s"}},
            record(),
            "column 'km': unit 's' does not fit 'm'",
        ),
        (FILE, spoilt(km=(7, 0.0)), "line 9: column 'km' goes from"),
        (
            FILE,
            spoilt(level=(4, np.nan)),
            "line 6: column 'level' holds 'nan'|line 6: column 'level' holds no",
        ),
        (
            over_time(speed={"column": "level", "unit": "m/s"}),
            record(),
            "speed column 'level' is not greater than 0",
        ),
        (FILE, {k: v[:1] for k, v in record().items()}, "has one row of data; a track needs at least two"),
        (FILE | {"V": 20.0}, record(), "[track] needs either 'V' or [speed] if [time] is given"),
        (over_time(), record(), "[track] needs either 'V' or [speed] if [time] is given, and neither"),
        (over_time(V=-1.0), record(), "key 'track.V' must be greater than 0, not '-1.0'"),
        (FILE | {"time": {"column": "t", "unit": "s"}}, record(), "needs either [distance] or [time]"),
        (FILE | {"columns": {}}, record(), "key 'track.columns' must hold at least one entry"),
        (FILE | {"columns": {"y_left": {"column": "yl", "unit": "mm"}}}, record(), "without 'y_right'"),
    ],
)
def test_bad_files_in_one_line(tmp_path, table, columns, words):
    with pytest.raises(BadInput) as refused:
        read_track(table, write(tmp_path, columns))
    assert any(word in str(refused.value) for word in words.split("|"))
    assert "track" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_words_in_a_column(tmp_path):
    write(tmp_path, record())
    file = tmp_path / "track.csv"
    lines = file.read_text().splitlines()
    lines[3] = ",".join(["bridge", *lines[3].split(",")[1:]])
    file.write_text("\n".join(lines))
    with pytest.raises(BadInput, match="line 4: column 'km' holds 'bridge', not a number"):
        read_track(FILE, tmp_path)


# ---- declarations

OWN = {"A": 2e-7, "Omega_c": 0.8, "Omega_r": 0.02}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "spectrm"}, "key 'track.kind' = 'spectrm' is not known; did you mean 'spectrum'?"),
        ({"lenght": 3.0}, "key 'track.lenght' is not known; did you mean 'length'?"),
        ({"spectrum": "eri_low"}, "[track] spectrum 'eri_low' is not known; did you mean 'erri_low'?"),
        ({"own": {"level": OWN}}, "[track] needs either 'spectrum', the name of one, or [own] spectra"),
        ({"spectrum": None, "own": {"levl": OWN}}, "must be one of alignment, gauge, level, cross_level"),
        ({"spectrum": None, "own": {"level": OWN | {"Omega_r": 0.8}}}, "[track.own.level] a spectrum needs"),
        (
            {"spectrum": None, "own": {"level": OWN | {"per": "m"}}},
            "track.own.level.per' must be one of rad/m, 1/m",
        ),
        ({"quantities": ["levl"]}, "key 'track.quantities[0]' must be one of alignment, gauge, level"),
        ({"spectrum": None, "own": {"level": OWN}, "quantities": ["gauge"]}, "'gauge' has no spectrum"),
        ({"seed": -1}, "key 'track.seed' must be greater than or equal to 0, not '-1'"),
        ({"seed": 1.5}, "key 'track.seed' must be a whole number, not '1.5'"),
        ({"quantities": "level"}, "key 'track.quantities' must be a list, not 'level'"),
        ({"wavelengths": [0.0, 5.0]}, "[track] 'wavelengths' must be greater than 0"),
        ({"wavelengths": [5.0, 3.0]}, "key 'track.wavelengths' must increase"),
        ({"length": 20.0}, "[track] 'length' 20 m is shorter than the longest wave 25 m"),
        ({"step": 1.0}, "[track] 'step' 1 m is too coarse for waves of 3 m; take at most 0.375 m"),
        ({"run_in": -1.0}, "[track] 'run_in' must lie between 0 and the length"),
        (
            {"like": "chocen_dobrikow"},
            "'like' = 'chocen_dobrikow' is no known line; did you mean 'chocen_dobrikov'?",
        ),
        (
            {"like": "chocen_dobrikov", "statistics": {"gauge": {"sd": 1e-3}}},
            "'like' and 'statistics' both set the statistics",
        ),
        ({"statistics": {"gauge": {"sd": 0.0}}}, "key 'track.statistics.gauge.sd' must be greater than 0"),
        (
            {"statistics": {"gauge": {"sd": 1.0, "min": 1.0}}},
            "'track.statistics.gauge.min' must be less than 0",
        ),
        (
            {"statistics": {"z_left": {"sd": 1.0}, "level": {"sd": 1.0}}},
            "'level' describe the same direction",
        ),
        (
            {"statistics": {"gauge": {"sd": 1.0}}, "quantities": ["level"]},
            "'gauge' has statistics but no spectrum",
        ),
        ({"add": 3}, "key 'track.add' must be one or more tables [[track.add]]"),
        ({"add": [{"position": 1.0}]}, "key 'track.add[0].shape' is missing; known are cusp"),
        ({"add": [{"shape": "dpi"}]}, "key 'track.add[0].shape' = 'dpi' is not known; did you mean 'dip'?"),
        ({"add": [defect("dip") | {"lenght": 1.0}]}, "key 'track.add[0].lenght' is not known; did you mean"),
        ({"add": [defect("dip") | {"on": "top"}]}, "key 'track.add[0].on' must be one of y_left, y_right"),
        ({"add": [defect("dip") | {"length": -1.0}]}, "key 'track.add[0].length' must be greater than 0"),
        ({"add": [defect("cyclic_top") | {"cycles": 0}]}, "key 'track.add[0].cycles' must be greater than"),
        ({"add": [defect("gauge_widening") | {"transition": 3.0}]}, "[track.add[0]] two transitions of 3 m"),
    ],
)
def test_bad_declarations_in_one_line(changes, words):
    table = {key: value for key, value in (GOOD | changes).items() if value is not None}
    with pytest.raises(BadInput) as refused:
        read_track(table, HERE)
    message = str(refused.value)
    assert words in message
    for leaked in ("\n", "pydantic", "validation", "Input should", "Value error", "[type="):
        assert leaked not in message


def test_what_is_missing_is_named():
    with pytest.raises(BadInput, match=r"key 'track\.kind' is missing; known are defect, file, spectrum"):
        read_track({}, HERE)
    with pytest.raises(BadInput, match=r"'track\.length', 'track\.wavelengths', 'track\.seed' are missing"):
        read_track({"kind": "spectrum", "spectrum": "fra_5"}, HERE)
    with pytest.raises(BadInput, match="key 'track' must be a table, not '3'"):
        read_track(3, HERE)


def test_ones_own_spectrum_is_realised():
    own = {"level": OWN | {"per": "1/m", "sides": 2}}
    table = {key: value for key, value in GOOD.items() if key != "spectrum"} | {"own": own}
    track = read_track(table, HERE)
    x = track.rails.level[:-1]
    assert_allclose(x.var(), Spectrum.of(2e-7, 0.8, 0.02, per="1/m", sides=2).variance(*BAND), rtol=1e-9)
    assert_array_equal(track.y_left, 0)


# ---- figures and documents


def test_figures_show_the_track_and_what_was_asked_for():
    track, source = waves(3000.0), read_source(GOOD)
    profile = profile_figure(track, window=(100.0, 200.0))
    left = profile.axes[1].lines[0]
    assert_allclose(left.get_ydata(), 1e3 * track.at(left.get_xdata()).z_left, atol=1e-12)
    assert (left.get_xdata()[0], left.get_xdata()[-1]) == (100.0, 200.0)
    spectra = spectrum_figure(track, source.requested, source.wavelengths)
    assert [ax.get_title(loc="left") for ax in spectra.axes] == ["Alignment", "Gauge", "Level", "Cross level"]
    for ax, quantity in zip(spectra.axes, source.requested, strict=True):
        estimated, requested = ax.lines
        w, S = requested.get_data()
        assert_allclose([w[0], w[-1]], BAND)
        assert_allclose(S, SPECTRA["erri_low"][quantity].density(w))
        inner = (w > 1.2 * w[0]) & (w < w[-1] / 1.2)
        shown = np.exp(np.interp(np.log(w), np.log(estimated.get_xdata()), np.log(estimated.get_ydata())))
        assert np.abs(np.log(shown[inner] / S[inner]).mean()) < 0.15


@pytest.mark.parametrize("document", ["track.md", "sensors.md"])
def test_the_examples_of_the_documents_run(document, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = (ROOT / "docs" / document).read_text().split("```")[1::2]
    code = [block.removeprefix("python\n") for block in blocks if block.startswith("python\n")]
    assert code
    space: dict = {}
    for block in code:
        exec(compile(block, document, "exec"), space)
    assert space["checked"]
