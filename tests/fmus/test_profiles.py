"""Profiles: exact sections, and what is made of measured points."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import fmus
from fmus.contact.cache import folder
from fmus.contact.geometry.exact import exact_names, exact_profile
from fmus.contact.geometry.measured import load_profile, measured_profile
from fmus.errors import BadInput
from tests.helpers.paths import SHARED
from tests.helpers.profile_files import points_of, write_points

DATA = SHARED / "data" / "contact"
BENCHMARK = {"S1002": "MBench_S1002_v3_points.csv", "UIC60_Manchester": "MBench_UIC60_v3_points.csv"}
# mm, where sections of EN 15302 meet at an angle: field sides, and the two cones of H
FIELD = (30.0, 60.0)
EDGES = {
    "EN15302_WheelA": FIELD, "EN15302_WheelB": FIELD, "EN15302_WheelC": (-59.5, 29.0, 59.0),
    "EN15302_WheelH": (-10.2297, *FIELD), "EN15302_WheelI": FIELD,
}  # fmt: skip
TREAD = np.linspace(-0.020, 0.035, 400)  # m, without the step of curvature at -26 mm


def benchmark(name):
    file = DATA / BENCHMARK[name]
    if not file.is_file():
        pytest.skip(f"{file} is not there; the data come beside the repository")
    return file


@pytest.mark.parametrize("name", exact_names())
def test_sections_meet(name):
    profile = exact_profile(name)
    joints, step = profile.breaks[1:-1], 1e-12
    # the published sections of S1002 meet within 0.12 um, slopes within 8e-6; the arcs of rails meet
    # within rounding of their centres; those of EN 15302 are printed to 0.1 um, flanks to 5e-4 mm
    norm = name.startswith("EN15302")
    height = 8.2e-7 if norm else 1.3e-7
    assert_allclose(profile.height(joints - step), profile.height(joints + step), atol=height)
    smooth = ~np.isin(np.round(joints * 1e3, 4), EDGES.get(name, ()))
    slope = 4e-3 if norm else 1e-5
    assert_allclose(profile.slope(joints - step)[smooth], profile.slope(joints + step)[smooth], atol=slope)
    edge = np.abs(profile.slope(joints - step) - profile.slope(joints + step))[~smooth]
    assert (edge > 0.02).all()


@pytest.mark.parametrize("name", exact_names())
def test_slope_and_curvature_are_derivatives(name):
    profile = exact_profile(name)
    y = np.linspace(profile.begin, profile.end, 997)[1:-1]
    clear = np.abs(y[:, None] - profile.breaks).min(axis=1) > 1e-4  # of the steps of curvature
    y = y[clear & (np.abs(profile.slope(y)) < 5)]
    h = 1e-6
    slope = (profile.height(y + h) - profile.height(y - h)) / (2 * h)
    bend = (profile.slope(y + h) - profile.slope(y - h)) / (2 * h)
    # third derivatives reach 1e6 / m^2 at the steepest place
    assert_allclose(profile.slope(y), slope, atol=1e-5)
    assert_allclose(profile.curvature(y), bend / (1 + slope**2) ** 1.5, rtol=1e-5, atol=1e-4)


def test_frame_of_the_wheel():
    wheel = exact_profile("S1002")
    assert wheel.height(0.0) == 0.0
    assert_allclose(wheel.height(-0.055), -0.028, atol=1e-9)  # flange of 28 mm, 15 mm from its back
    assert_allclose(wheel.height(wheel.end), 0.002635676, atol=1e-8)  # 1:15 at the field side
    assert_allclose(wheel.slope(-0.039), 2.747477419)  # flank of 70 degrees
    assert_allclose(wheel.curvature([-0.055, -0.036]), [1 / 0.012, -1 / 0.013])  # tip and root


def test_frame_of_the_rail():
    rail = exact_profile("60E1")
    y = np.linspace(0, rail.end, 300)
    assert rail.height(0.0) == 0.0
    assert_allclose(rail.height(-y), rail.height(y), atol=1e-15)
    assert_allclose(rail.height(0.036), -0.0143, atol=5e-6)  # head of 72 mm, 14.3 mm below its top
    assert_allclose(rail.curvature([0.005, 0.02, 0.03]), [-1 / 0.3, -1 / 0.08, -1 / 0.013])


def test_shoulder_of_the_benchmark_rail_is_higher():
    # Manchester's UIC 60 holds R300 to 10.5 mm; EN 13674-1 to 10.228 mm
    lift = exact_profile("UIC60_Manchester").height(0.026) - exact_profile("60E1").height(0.026)
    assert_allclose(lift, 0.040e-3, atol=0.002e-3)


def test_beyond_its_ends_a_profile_is_not():
    wheel = exact_profile("S1002")
    beyond = [wheel.begin - 1e-9, wheel.end + 1e-9]
    assert np.isnan([wheel.height(beyond), wheel.slope(beyond), wheel.curvature(beyond)]).all()


def test_exact_wheel_goes_through_the_points_of_the_benchmark():
    y, z = np.loadtxt(benchmark("S1002"), delimiter=",").T * 1e-3
    assert_allclose(exact_profile("S1002").height(-y), -z, atol=2e-9)


def test_exact_rail_goes_through_the_points_of_the_benchmark():
    y, z = np.loadtxt(benchmark("UIC60_Manchester"), delimiter=",").T * 1e-3
    rail, angle = exact_profile("UIC60_Manchester"), np.arctan(1 / 40)
    across, up = y + 7.4917e-3, -z + 0.093706e-3  # the rail's axis in the points' frame, fitted
    own = across * np.cos(angle) + up * np.sin(angle)
    turned = -across * np.sin(angle) + up * np.cos(angle)
    off = (turned - rail.height(own)) * np.cos(np.arctan(rail.slope(own)))
    assert_allclose(off[np.abs(own) < 0.0355], 0.0, atol=2e-9)


def test_unknown_profile():
    with pytest.raises(BadInput, match=r"neither a file nor an exact profile; did you mean 'S1002'\?"):
        load_profile("S1020", "wheel")


# ---- point files


@pytest.mark.parametrize("name", BENCHMARK)
def test_points_without_noise_give_the_profile(name):
    kind = exact_profile(name).kind
    made = measured_profile(benchmark(name), kind)
    y, z = np.loadtxt(benchmark(name), delimiter=",").T * 1e-3
    y = -y if kind == "wheel" else y
    inside = (y > made.begin) & (y < made.end) & (np.abs(y) < 0.035)
    y, z = y[inside], -z[inside]
    # a step of curvature is spread over about 2 mm, which moves the curve by about 1 um
    assert_allclose((made.height(y) - z) / np.hypot(1, made.slope(y)), 0, atol=2e-6)
    assert "z of the file points down" in made.found
    assert ("to the flange" in made.found) == (kind == "wheel")
    assert ("the head leans inwards by about 1:4" in made.found) == (kind == "rail")


@settings(max_examples=6)
@given(
    st.integers(0, 2**32 - 1), st.integers(500, 1500), st.floats(5e-6, 20e-6), st.booleans(), st.booleans()
)
def test_noisy_wheel_in_any_direction(tmp_path_factory, seed, n, noise, down, turned):
    points = points_of("S1002", n, np.random.default_rng(seed), noise, begin=-0.068)
    points = points * [-1 if turned else 1, -1 if down else 1] + [0, 0.0123]
    file = write_points(tmp_path_factory.mktemp("wheel") / "worn.txt", points[:: -1 if seed % 2 else 1])
    made, true = measured_profile(file, "wheel"), exact_profile("S1002")
    # p parameters fitted to n points leave an error of noise sqrt(p/n) rms; 600 draws had 1.0 of that in the
    # median and 2.7 at most, since only some ten of the parameters lie on the tread
    p = float(made.found.split(" parameters")[0].split()[-1])
    away = made.height(TREAD) - true.height(TREAD)
    assert np.sqrt(np.mean(away**2)) < 4 * noise * np.sqrt(p / n)
    wrong = made.curvature(TREAD) - true.curvature(TREAD)
    # the tread's own curvature is 4 /m rms over these places; the reverse slope begins with a step of 4
    assert np.sqrt(np.mean(wrong**2)) < 1.0
    rms = float(made.found.split("smoothed to ")[1].split()[0]) * 1e-6
    assert 0.85 * noise < rms < 1.2 * noise


def test_noisy_rail_is_found_by_its_gauge_side(tmp_path):
    # measured 24 mm deep on the gauge side, 7 mm on the field side, which the file has at the left
    points = points_of("60E1", 700, np.random.default_rng(4), 1e-5, begin=-0.0365, end=0.0335)
    made = measured_profile(write_points(tmp_path / "rail.csv", -points, "; "), "rail")
    assert "z of the file points down" in made.found
    assert "y of the file points inwards" in made.found
    assert "leans" not in made.found
    y = np.linspace(-0.022, 0.022, 200)
    true = exact_profile("60E1")
    assert_allclose(made.height(y), true.height(y), atol=2e-5)
    # a step of curvature, as from R300 to R80 and to R13 at 26 mm, is spread over some mm
    clear = np.abs(np.abs(y) - 0.010228) > 0.004
    assert_allclose(made.curvature(y[clear]), true.curvature(y[clear]), atol=2.5)


def test_stated_noise_is_left_over(tmp_path):
    points = points_of("S1002", 600, np.random.default_rng(0), 5e-6)
    file = write_points(tmp_path / "wheel.txt", points)
    found = measured_profile(file, "wheel", 30e-6).found
    assert "smoothed to 30 um rms, stated" in found


def test_overhangs_are_left_out(tmp_path):
    tread = points_of("S1002", 600, np.random.default_rng(0), 5e-6)
    back = np.column_stack([np.linspace(-0.0660, tread[0, 0], 60), np.linspace(0.015, tread[0, 1], 60)])
    made = measured_profile(write_points(tmp_path / "wheel.txt", np.vstack([back[:-1], tread])), "wheel")
    assert_allclose(made.height(TREAD), exact_profile("S1002").height(TREAD), atol=1e-5)


def test_flange_back_sets_the_zero(tmp_path):
    tread = points_of("S1002", 800, np.random.default_rng(0), 2e-6)
    wall = np.column_stack([np.full(40, tread[0, 0]), np.linspace(0.020, tread[0, 1], 40)])
    file = write_points(tmp_path / "wheel.txt", np.vstack([wall[:-1], tread]) + np.array([0.07, 0]))
    made = measured_profile(file, "wheel")
    assert "set the flange back 70 mm from the tape circle" in made.found
    assert_allclose(made.height(TREAD), exact_profile("S1002").height(TREAD), atol=2e-5)


FORMS = [
    (",", ""),
    (";", "# y, z\n"),
    ("\t", "y_mm\tz_mm\n\n"),
    ("  ", "% MiniProf\n! of 2024\n"),
    (", ", ""),
]


@pytest.mark.parametrize(("separator", "header"), FORMS)
def test_separators_headers_and_decimal_commas(tmp_path, separator, header):
    points = points_of("S1002", 300, np.random.default_rng(1))
    file = write_points(tmp_path / "a.txt", points, separator, header)
    first = measured_profile(file, "wheel")
    if "," not in separator:
        text = file.read_text().replace(".", ",")
        (tmp_path / "b.txt").write_text(text)
        assert measured_profile(tmp_path / "b.txt", "wheel").sections == first.sections
    assert_allclose(first.height(TREAD), exact_profile("S1002").height(TREAD), atol=1e-6)


def good(name="S1002", n=400):
    return points_of(name, n, np.random.default_rng(2), begin=-0.066 if name == "S1002" else None)


def swapped(points):
    order = np.arange(len(points))
    order[[200, 220]] = order[[220, 200]]
    return points[order]


def looped(points):
    turn = np.linspace(0, 2 * np.pi, 40)
    loop = points[250] + 0.003 * np.column_stack([np.sin(turn), np.cos(turn) - 1])
    return np.vstack([points[:250], loop, points[251:]])


# points of a profile made wrong, the kind they are given as, and words the message must hold
WRONG = {
    "metres": (lambda: good() * 1e-3, "wheel", "looks like metres; multiply both columns by 1000"),
    "inches": (lambda: good() / 25.4, "wheel", "looks like inches; multiply both columns by 25.4"),
    "inches of a rail": (lambda: good("60E1") / 25.4, "rail", "looks like inches"),
    "too short": (lambda: good()[good()[:, 0] > 0.012], "wheel", "is too short, 4"),
    "too few": (lambda: good(n=20), "wheel", "holds 20 points, too few"),
    "shuffled": (lambda: np.random.default_rng(0).permutation(good()), "wheel", "is not sorted along"),
    "swapped": (lambda: swapped(good()), "wheel", "y runs back at line 2"),
    "looped": (lambda: looped(good()), "wheel", "crosses its own course at lines 2"),
    "two halves": (lambda: np.roll(good(), 200, axis=0), "wheel", "is not sorted along"),
    "gap": (lambda: np.delete(good(), slice(230, 300), axis=0), "wheel", "has a gap of"),
    "wheel as rail": (good, "rail", "looks like a wheel but is given as a rail"),
    "rail as wheel": (lambda: good("60E1"), "wheel", "looks like a rail but is given as a wheel"),
    "a line": (
        lambda: np.linspace([-0.06, 0], [0.06, 0.001], 200),
        "wheel",
        "is no wheel profile (flat over",
    ),
    "tread alone": (lambda: good()[good()[:, 0] > -0.022], "wheel", "shows a tread with a flange"),
    "elsewhere": (
        lambda: good()[good()[:, 0] > -0.056] + [0.03, 0],
        "wheel",
        "shift y so that 0 is the tape",
    ),
    "micrometres": (lambda: good() * 1e3, "wheel", "looks like micrometres"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_points_are_refused(tmp_path, case):
    points, kind, words = WRONG[case]
    file = write_points(tmp_path / "profile.txt", points())
    assert_one_line(file, kind, words)


TEXTS = {
    "1.0 2.0\n1.5 nan\n": "line 2 holds a number that is not finite",
    "-70\n-69\n": "line 1 has one column",
    "1 2\n3 4\nend of file\n": "line 3 is not two numbers",
    "": "holds 0 points, too few",
    "only words\nand more\n": "holds 0 points, too few",
}


@pytest.mark.parametrize("text", TEXTS)
def test_wrong_texts_are_refused(tmp_path, text):
    file = tmp_path / "profile.txt"
    file.write_text(text)
    assert_one_line(file, "wheel", TEXTS[text])


def assert_one_line(file, kind, words):
    with pytest.raises(BadInput) as refused:
        measured_profile(file, kind)
    message = str(refused.value)
    assert message.startswith(f"{file}: ")
    assert words in message
    assert "\n" not in message


def test_smoothing_out_of_range(tmp_path):
    file = write_points(tmp_path / "wheel.txt", good())
    with pytest.raises(BadInput, match=r"smoothing = 0\.02 must be above 0 and below 0\.001 m"):
        measured_profile(file, "wheel", 0.02)


def test_fits_are_kept_on_disk(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    measured_profile(write_points(tmp_path / "wheel.txt", good(n=407)), "wheel")
    assert len(list(folder().glob("*.npz"))) == 1


def test_a_fit_does_not_depend_on_the_number_of_threads(tmp_path):
    """A machine with one core cannot tell; OpenBLAS then has one thread anyway."""
    script = """
        import sys
        import numpy as np
        from fmus.contact.geometry.smoothing import smooth_curve
        print(smooth_curve(*np.loadtxt(sys.argv[1]).T).spline.c.tobytes().hex())
    """
    file = tmp_path / "points.txt"
    np.savetxt(file, good(n=1500))
    command = [sys.executable, "-c", textwrap.dedent(script), str(file)]
    where = os.environ | {"PYTHONPATH": str(Path(fmus.__file__).parents[1])}
    one, two = (
        subprocess.run(
            command, env=where | {"OPENBLAS_NUM_THREADS": threads}, check=True, capture_output=True
        ).stdout
        for threads in ("1", "2")
    )
    assert one == two
