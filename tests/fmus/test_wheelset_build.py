"""The wheelset built for a track of one's own: command line words, point files, what it tells."""

import zipfile

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fmus.contact import contact_table
from fmus.errors import BadInput
from fmus.export.builders.pythonfmu import build_python
from fmus.host.fmu import Fmu
from fmus.host.grading.check import grade
from fmus.wheelset.curves import FIELDS, E, contact_curves
from fmus.wheelset.model import NU, Wheelset
from fmus.wheelset.track import Track
from tests.helpers.profile_files import points_of, write_points


@pytest.mark.parametrize(
    ("words", "cant"), [("1/20", 0.05), (" 1/40 ", 0.025), ("0.05", 0.05), (0.025, 0.025), ("0", 0.0)]
)
def test_a_cant_is_a_slope_or_a_fraction(words, cant):
    assert Track.parse(cant=words).cant == pytest.approx(cant)


def test_sizes_are_read_from_words():
    track = Track.parse(gauge="1.432", back_to_back="1.3600", r0="0.45")
    assert (track.gauge, track.back_to_back, track.r0) == (1.432, 1.36, 0.45)
    assert track.half_distance == pytest.approx(0.75)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"cant": "1/0"}, "cant = '1/0' is no number; give a number, such as 0.025"),
        ({"cant": "1:20"}, "cant = '1:20' is no number"),
        ({"gauge": "wide"}, "gauge = 'wide' is no number; give m, such as 1.435"),
        ({"gauge": "nan"}, "gauge = 'nan' is no number"),
        ({"gauge": "1435"}, "gauge = 1435 must be from"),
        ({"gauge": "1.6"}, "never touch on their running surfaces"),
        ({"gauge": "1.37"}, "the flanges touch when it is centred; correct gauge"),
        ({"wheel": "S1003"}, "wheel = 'S1003' is neither a file nor an exact profile; did you mean 'S1002'"),
        ({"wheel": "60E1"}, "is a rail; give the profile of a wheel"),
        ({"width": "3"}, "wheelset has no build option .width.; it offers wheel, rail, cant, gauge"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(given, words):
    with pytest.raises(BadInput, match=words) as error:
        Track.parse(**given)
    assert "\n" not in str(error.value)


def test_a_point_file_that_is_no_profile_is_refused(tmp_path):
    inches = write_points(tmp_path / "inch.txt", points_of("S1002", 300, np.random.default_rng(1)) / 25.4)
    with pytest.raises(BadInput, match=r"inch\.txt"):
        Track.parse(wheel=str(inches))


def test_curves_are_the_table_also_between_its_nodes():
    shifts = np.sort(np.random.default_rng(1).uniform(-5.5e-3, 5.5e-3, 600))
    table = contact_table(shifts=shifts, E=E, nu=NU)
    found = contact_curves(Track()).map(len(shifts))(1, shifts.reshape(1, -1)).full()
    curve = dict(zip(FIELDS, found, strict=True))
    inner = np.abs(shifts) < 4.9e-3  # beyond, the contact runs to the flange within 0.2 mm
    r, expected = 0.46 + curve["growth"], table["r_left"].to_numpy()
    assert_allclose(r[inner], expected[inner], rtol=1e-6)
    assert_allclose(r, expected, rtol=6e-6)
    # the table's own patches jitter by 2e-5 of themselves, and its quasi-elastic points bend within 50 um
    for name, typical, largest in (("delta", 1e-6, 2e-3), ("a_hertz", 2e-5, 2e-3), ("b_hertz", 4e-5, 5e-3)):
        off = np.abs(curve[name] / table[f"{name.removesuffix('_hertz')}_left"] - 1)
        assert np.median(off) < typical
        assert off.max() < largest


def test_curves_do_not_overshoot_where_contact_jumps():
    jumps = contact_table(search="rigid")
    fine = np.linspace(-9e-3, 9e-3, 5001)
    curve = contact_curves(Track()).map(len(fine))(0, fine.reshape(1, -1)).full()
    for row, name in ((1, "delta_left"), (3, "a_left"), (4, "b_left")):
        low, high = jumps[name].min(), jumps[name].max()
        assert low - 0.02 * (high - low) < curve[row].min() < curve[row].max() < high + 0.02 * (high - low)


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A track with a measured wheel, steeper rails and other wheels, and its FMU."""
    folder = tmp_path_factory.mktemp("own")
    points = points_of("S1002", 800, np.random.default_rng(2), noise=2e-6)
    wheel = write_points(folder / "worn.txt", points)
    track = Track.parse(wheel=str(wheel), cant="1/20", r0="0.45")
    return track, build_python(Wheelset(track=track), folder)


def test_the_fmu_rolls_on_its_own_profiles(own):
    track, path = own
    table = contact_table(
        track.wheel, track.rail, cant=0.05, r0=0.45, shifts=np.array([2e-3]), E=2 * 8e10 * 1.28, nu=0.28
    )
    with Fmu(path) as fmu:
        fmu.restart(y=2e-3)
        for name, rel in (("r_left", 1e-6), ("delta_right", 1e-3), ("a_left", 1e-3), ("b_right", 1e-3)):
            assert fmu[name] == pytest.approx(float(table[name].iloc[0]), rel=rel)
        assert fmu["r0"] == 0.45


def test_the_fmu_tells_what_it_rolls_on(own):
    _, path = own
    with zipfile.ZipFile(path) as archive:
        description = archive.read("modelDescription.xml").decode()
        page = archive.read("documentation/index.html").decode()
    for text in (description, page):
        assert "wheel worn (r0 0.45 m, back to back 1.36 m) on rail 60E1 (cant 1:20, gauge 1.435 m)" in text


def test_the_model_says_it_in_one_line():
    assert "S1002" in Wheelset().about
    assert "\n" not in Wheelset().about


def test_the_fmu_passes_every_check(own):
    result = grade(own[1])
    assert result.ok, [check.sentence for check in result.checks if check.passed is False]
