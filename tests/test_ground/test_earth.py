# ruff: noqa: E501 - a refusal and its sentence stand side by side
"""The Earth against PROJ, pymap3d, closed formulas in 40 digits and published values."""

import csv
import datetime as dt
import warnings
from pathlib import Path

import mpmath as mp
import numpy as np
import pymap3d
import pytest
from numpy.testing import assert_array_equal
from pyproj import Geod, Transformer
from truth import ellipsoid as truth
from truth.compare import assert_close

from strapdown import constants, earth
from strapdown.errors import ModelExpiredWarning
from strapdown.units import DEG, HOUR, KM, MM, NT

EPS = 2.2e-16
NAN = float("nan")
LATITUDES = np.array([-90, -89.9999, -60, -30, -1e-7, 0, 30, 45, 60, 89.9, 90]) * DEG
LONGITUDES = np.array([-180, -179.9999, -120, 0, 1e-9, 77, 179.9999, 180]) * DEG
HEIGHTS = np.array([-10.9 * KM, -100.0, 0.0, 9 * KM, 400 * KM, 20_200 * KM])
GRID = np.stack(np.meshgrid(LATITUDES, LONGITUDES, HEIGHTS, indexing="ij"), -1).reshape(-1, 3)
REF = np.array([60.1 * DEG, 24.9 * DEG, 35.0])


# --- constants ------------------------------------------------------------------------


def test_derived_constants_follow_from_the_defining_ones():
    assert pytest.approx(float(truth.B), rel=EPS) == constants.WGS84_B
    assert pytest.approx(float(truth.E2), rel=1e-15) == constants.WGS84_E2
    assert pytest.approx(float(truth.E2 / (1 - truth.E2)), rel=1e-15) == constants.WGS84_EP2
    # printed with 11 digits, the last of which is rounded
    assert pytest.approx(float(truth.gravity(0, 0)), abs=6e-11) == constants.GAMMA_E
    assert pytest.approx(float(truth.gravity(mp.pi / 2, 0)), abs=1.1e-10) == constants.GAMMA_P
    k = truth.B * truth.gravity(mp.pi / 2, 0) / (truth.A * truth.gravity(0, 0)) - 1
    # the printed one was made from rounded values: 5e-13 m/s^2 of gravity
    assert pytest.approx(float(k), abs=6e-14) == constants.SOMIGLIANA_K
    m = truth.OMEGA**2 * truth.A**2 * truth.B / truth.GM
    assert pytest.approx(float(m), abs=6e-15) == constants.SOMIGLIANA_M


# --- shape ----------------------------------------------------------------------------


def test_radii_of_curvature_match_pymap3d_and_the_values_at_equator_and_pole():
    lat_deg = LATITUDES / DEG
    meridian = pymap3d.rcurve.meridian(lat_deg)
    assert_close(earth.meridian_radius(LATITUDES), meridian, rtol=1e-14)
    assert_close(
        earth.transverse_radius(LATITUDES), pymap3d.rcurve.transverse(lat_deg), rtol=1e-14
    )
    a, b = float(truth.A), float(truth.B)
    assert_close(earth.meridian_radius([0.0, np.pi / 2]), [b * b / a, a * a / b], rtol=1e-14)
    assert_close(earth.transverse_radius([0.0, np.pi / 2]), [a, a * a / b], rtol=1e-14)


def test_meridian_radius_is_the_arc_per_latitude():
    geod = Geod(ellps="WGS84")
    for lat_deg in (-75.0, -10.0, 33.0, 60.0, 89.0):
        step = 1e-3  # the error of the central difference is step^2 / 24 of the radius: 1e-11
        _, _, arc = geod.inv(10.0, lat_deg - step / 2, 10.0, lat_deg + step / 2)
        # arcs of 111 m are printed to nanometres
        assert earth.meridian_radius(lat_deg * DEG) == pytest.approx(arc / (step * DEG), rel=1e-9)


def test_ecef_matches_proj_and_the_definition():
    to_ecef = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    x, y, z = to_ecef.transform(GRID[:, 1] / DEG, GRID[:, 0] / DEG, GRID[:, 2])
    r_e = earth.ecef_from_lla(GRID)
    # eps of 26,600 km, some operations
    assert_close(r_e, np.stack((x, y, z), -1), atol=2e-8)
    for point, row in list(zip(GRID, r_e, strict=True))[::7]:
        assert_close(row, [float(c) for c in truth.ecef(*point)], atol=1e-8)


def test_geodetic_coordinates_come_back_everywhere():
    back = earth.lla_from_ecef(earth.ecef_from_lla(GRID))
    # a nanometre near the ground, eps of the distance farther out
    assert_close(back[:, 2], GRID[:, 2], atol=2e-8)
    assert_close(back[:, 0], GRID[:, 0], atol=6e-16)
    east = (back[:, 1] - GRID[:, 1] + np.pi) % (2 * np.pi) - np.pi
    assert (np.abs(east) * np.cos(GRID[:, 0]) < 1e-15).all()


def test_geodetic_coordinates_match_proj_near_the_ground():
    to_lla = Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True)
    rng = np.random.default_rng(0)
    r_e = rng.standard_normal((500, 3))
    r_e *= (rng.uniform(6.34e6, 6.4e6, 500) / np.linalg.norm(r_e, axis=1))[:, np.newaxis]
    lon, lat, height = to_lla.transform(*r_e.T)
    lla = earth.lla_from_ecef(r_e)
    # PROJ stops after the first round: its result comes back to within 0.06 mm only
    assert_close(lla[:, 0], lat * DEG, atol=1e-11)
    assert_close(lla[:, 1], lon * DEG, atol=1e-15)
    assert_close(lla[:, 2], height, atol=0.1 * MM)


def test_deep_points_come_back_too():
    rng = np.random.default_rng(1)
    r_e = rng.standard_normal((500, 3))
    r_e *= (rng.uniform(1.1e5, 6.3e6, 500) / np.linalg.norm(r_e, axis=1))[:, np.newaxis]
    assert_close(earth.ecef_from_lla(earth.lla_from_ecef(r_e)), r_e, atol=1e-8)


@pytest.mark.parametrize("z", [6_356_752.3142, -6_356_752.3142, 1e7])
def test_on_the_axis_longitude_is_zero(z):
    lat, lon, height = earth.lla_from_ecef([0.0, 0.0, z])
    assert (lat, lon) == (np.copysign(np.pi / 2, z), 0.0)
    assert height == pytest.approx(abs(z) - constants.WGS84_B, abs=1e-8)


def test_rows_of_c_ne_are_north_east_and_down():
    points = GRID[np.abs(GRID[:, 0]) < 1.57]
    C_ne = earth.dcm_ne(points)
    step = 1e-4
    for axis, direction in ((0, 0), (1, 1)):
        ahead, behind = points.copy(), points.copy()
        ahead[:, axis] += step
        behind[:, axis] -= step
        ahead[:, 0], behind[:, 0] = np.clip([ahead[:, 0], behind[:, 0]], -np.pi / 2, np.pi / 2)
        moved = earth.ecef_from_lla(ahead) - earth.ecef_from_lla(behind)
        unit = moved / np.linalg.norm(moved, axis=1, keepdims=True)
        # a chord over 1e-4 rad leaves its tangent by less than 1e-4, at the poles' edge too
        assert_close(C_ne[:, direction], unit, atol=2e-4)
    higher = points + [0.0, 0.0, 1000.0]
    up = (earth.ecef_from_lla(higher) - earth.ecef_from_lla(points)) / 1000.0
    assert_close(C_ne[:, 2], -up, atol=1e-11)  # 1e-8 m over 1000 m
    assert_close(
        C_ne @ np.swapaxes(C_ne, 1, 2), np.broadcast_to(np.eye(3), C_ne.shape), atol=4e-16
    )
    assert_close(np.linalg.det(C_ne), 1.0, atol=1e-15)


@pytest.mark.parametrize("lat_deg", [-90, -89.9, -60, -30, 0, 30, 60, 89.9, 90])
@pytest.mark.parametrize("lon_deg", [-179.999, 0, 24.9, 180])
def test_local_tangent_plane_matches_pymap3d(lat_deg, lon_deg):
    rng = np.random.default_rng(2)
    ref = np.array([lat_deg * DEG, lon_deg * DEG, 35.0])
    r_n = rng.uniform(-20e3, 20e3, (20, 3))
    lla = earth.lla_from_ned(r_n, ref)
    lat, lon, height = pymap3d.ned2geodetic(*r_n.T, lat_deg, lon_deg, 35.0)
    r_e = earth.ecef_from_lla(lla)
    assert_close(r_e, np.stack(pymap3d.geodetic2ecef(lat, lon, height), -1), atol=1e-3 * MM * 10)
    assert_close(earth.ned_from_lla(lla, ref), r_n, atol=1e-8)
    assert_close(earth.ned_from_ecef(r_e, ref), r_n, atol=1e-8)
    assert_close(
        earth.ned_from_ecef(r_e, ref),
        np.stack(pymap3d.ecef2ned(*r_e.T, lat_deg, lon_deg, 35.0), -1),
        atol=1e-8,
    )
    assert_close(earth.ecef_from_ned(r_n, ref), r_e, atol=1e-8)


def test_ground_ten_kilometres_away_lies_below_the_tangent_plane():
    geod = Geod(ellps="WGS84")
    lon, lat, _ = geod.fwd(24.9, 60.1, 30.0, 10e3)
    down = earth.ned_from_lla([lat * DEG, lon * DEG, 35.0], REF)[2]
    assert down == pytest.approx(7.8, abs=0.05)  # d^2 / 2R


def test_tangent_plane_works_across_the_antimeridian():
    ref = np.array([-16.5 * DEG, 179.999 * DEG, 0.0])
    r_n = earth.ned_from_lla([-16.5 * DEG, -179.999 * DEG, 0.0], ref)
    assert r_n[1] == pytest.approx(0.002 * DEG * 6_379_860 * np.cos(16.5 * DEG), rel=1e-4)


# --- rotation -------------------------------------------------------------------------


@pytest.mark.parametrize("lat", LATITUDES)
def test_earth_rate_is_the_polar_axis_seen_from_n(lat):
    C_ne = earth.dcm_ne([lat, 1.0, 0.0])
    assert_close(earth.earth_rate_n(lat), C_ne @ [0.0, 0.0, 7.292115e-5], atol=1e-20)


def test_earth_turns_once_in_a_sidereal_day():
    day = 2 * np.pi / np.linalg.norm(earth.earth_rate_n(0.7))
    assert day == pytest.approx(23 * HOUR + 56 * 60 + 4.1, abs=0.1)


@pytest.mark.parametrize("lat_deg", [-80, -30, 0, 30, 60, 89])
def test_transport_rate_is_how_c_ne_turns_along_the_way(lat_deg):
    lla = np.array([lat_deg * DEG, -2.9, 8000.0])
    v_n = np.array([180.0, -120.0, 30.0])
    dt_s = 1.0
    # r_e(t) to first order is enough: the midpoint rule's error is of second order
    C_en = earth.dcm_ne(lla).T
    r_e = earth.ecef_from_lla(lla)
    ahead = earth.dcm_ne(earth.lla_from_ecef(r_e + C_en @ v_n * dt_s / 2))
    behind = earth.dcm_ne(earth.lla_from_ecef(r_e - C_en @ v_n * dt_s / 2))
    skew = behind @ ahead.T  # exp(omega_en_n dt)
    omega = np.array([skew[2, 1] - skew[1, 2], skew[0, 2] - skew[2, 0], skew[1, 0] - skew[0, 1]])
    expected = omega / (2 * dt_s)
    # third-order term: (v dt / (R cos lat))^2 / 24 of the rate; round-off eps / dt
    tolerance = 1e-8 * np.abs(expected).max() / np.cos(lla[0]) ** 2 + 4e-16
    assert_close(earth.transport_rate_n(lla, v_n), expected, atol=tolerance)


@pytest.mark.parametrize("lat", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9])
def test_transport_rate_is_refused_at_the_pole_with_advice(lat):
    with pytest.raises(
        ValueError,
        match=r"`lla` must not be a pole, .*; navigate in ECEF or with a wander azimuth there\.$",
    ):
        earth.transport_rate_n([lat, 0.0, 0.0], [1.0, 1.0, 0.0])


# --- gravity --------------------------------------------------------------------------


@pytest.mark.parametrize("lat_deg", [-90, -60, -45, -30, 0, 15, 30, 45, 60, 89.9, 90])
def test_gravity_on_the_ellipsoid_is_the_closed_formula(lat_deg):
    expected = float(truth.gravity(lat_deg * DEG, 0.0))
    # the constants are printed to 1e-10 m/s^2
    assert earth.normal_gravity(lat_deg * DEG) == pytest.approx(expected, abs=2e-10)


@pytest.mark.parametrize(
    ("height", "error"), [(100.0, 0.011e-6), (1e3, 0.11e-6), (1e4, 0.7e-6), (4e4, 11e-6)]
)
@pytest.mark.parametrize("lat_deg", [-90, -45, 0, 30, 60])
def test_gravity_with_height_is_as_exact_as_documented(lat_deg, height, error):
    expected = float(truth.gravity(lat_deg * DEG, height))
    assert earth.normal_gravity(lat_deg * DEG, height) == pytest.approx(expected, abs=error)


def test_gravity_at_published_points():
    assert earth.normal_gravity(0.0) == pytest.approx(9.7803253359, abs=1e-10)  # TR8350.2
    assert earth.normal_gravity(np.pi / 2) == pytest.approx(9.8321849378, abs=1e-10)
    assert earth.normal_gravity(45 * DEG) == pytest.approx(9.80619, abs=1e-5)
    # gravity falls by 3.086 um/s^2 per metre, the free-air gradient of the textbooks
    fall = earth.normal_gravity(45 * DEG) - earth.normal_gravity(45 * DEG, 1.0)
    assert fall == pytest.approx(3.086e-6, abs=1e-9)


def test_gravity_vector_points_down():
    g_n = earth.gravity_n([[0.5, 1.0, 100.0], [-1.0, 2.0, 0.0]])
    assert_array_equal(g_n[:, :2], 0.0)
    assert_array_equal(g_n[:, 2], earth.normal_gravity([0.5, -1.0], [100.0, 0.0]))


# --- magnetic field -------------------------------------------------------------------

# Official test values of the WMM2025 by NOAA/NCEI and the British Geological Survey:
# WMM2025_TEST_VALUES.txt, a quarter of its rows, without the columns of secular change.
with (Path(__file__).parent / "wmm_2025_values.csv").open() as file:
    WMM_2025 = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


@pytest.mark.parametrize(
    "row", WMM_2025, ids=lambda r: f"{r['year']}_{r['lat_deg']}_{r['lon_deg']}"
)
def test_field_is_that_of_the_official_test_values(row):
    lla = (row["lat_deg"] * DEG, row["lon_deg"] * DEG, row["height_km"] * KM)
    field = earth.magnetic_field(lla, row["year"])
    # printed to 1 nT and 0.01 deg
    assert_close(field.field_n / NT, [row["x_nt"], row["y_nt"], row["z_nt"]], atol=0.501)
    assert field.declination / DEG == pytest.approx(row["declination_deg"], abs=0.00501)
    assert field.inclination / DEG == pytest.approx(row["inclination_deg"], abs=0.00501)
    assert field.model == "WMM-2025"


@pytest.mark.parametrize(
    ("year", "lat_deg", "lon_deg", "height_km", "xyz_nt", "model"),
    [
        # test values printed with WMM2010, WMM2015v2 and WMM2020
        (2010.0, 80, 0, 0, (6649.5, -714.6, 54346.2), "WMM-2010"),
        (2012.5, -80, 240, 100, (5535.5, 14765.4, -50625.9), "WMM-2010"),
        (2015.0, 0, 120, 0, (39521.1, 377.7, -11228.8), "WMM-2015v2"),
        (2017.5, -80, 240, 0, (5864.6, 15764.1, -52706.1), "WMM-2015v2"),
        (2020.0, 80, 0, 100, (6261.8, -185.5, 52429.1), "WMM-2020"),
        (2022.5, -80, 240, 100, (5815.0, 14803.0, -49755.3), "WMM-2020"),
    ],
)
def test_earlier_dates_take_the_model_of_their_time(
    year, lat_deg, lon_deg, height_km, xyz_nt, model
):
    field = earth.magnetic_field((lat_deg * DEG, lon_deg * DEG, height_km * KM), year)
    assert_close(field.field_n / NT, xyz_nt, atol=0.0501)  # printed to 0.1 nT
    assert field.model == model


@pytest.mark.parametrize("lat_deg", [90, -90])
def test_field_at_the_poles_is_finite_and_unique(lat_deg):
    fields = []
    for lon in (0.0, 1.0, -2.5):
        lla = (lat_deg * DEG, lon, 0.0)
        fields.append(earth.dcm_ne(lla).T @ earth.magnetic_field(lla, 2026.0).field_n)
    assert_close(fields, np.broadcast_to(fields[0], (3, 3)), atol=1e-6 * 60e-6)


def test_field_below_sea_level_is_a_little_stronger():
    deep, high = (earth.magnetic_field((0.9, 0.2, h), 2026.0).field_n for h in (-999.0, 0.0))
    # a dipole falls with the cube of the distance: 3 km / 6371 km
    ratio = np.linalg.norm(deep) / np.linalg.norm(high)
    assert ratio == pytest.approx(1.0 + 3.0 / 6371.0, abs=1e-4)


def test_field_has_no_seam_at_the_antimeridian():
    a = earth.magnetic_field((-16.5 * DEG, 180 * DEG, 0.0), 2026.0)
    b = earth.magnetic_field((-16.5 * DEG, -180 * DEG, 0.0), 2026.0)
    assert_close(a.field_n, b.field_n, rtol=1e-12)


def test_field_vector_agrees_with_its_angles():
    field = earth.magnetic_field(REF, 2026.3)
    north, east, down = field.field_n
    assert field.declination == pytest.approx(np.arctan2(east, north), abs=1e-12)
    assert field.inclination == pytest.approx(np.arctan2(down, np.hypot(north, east)), abs=1e-12)
    # the error model of the WMM2025: 0.26 deg and 5417 nT deg over the horizontal field
    expected = np.hypot(0.26, 5417 / (np.hypot(north, east) / NT))
    assert field.declination_std / DEG == pytest.approx(expected, rel=1e-9)
    assert np.isnan(earth.magnetic_field(REF, 2012.0).declination_std)


@pytest.mark.parametrize(
    ("date", "year"),
    [
        (dt.date(2026, 1, 1), 2026.0),
        (dt.date(2026, 7, 2), 2026.0 + 182 / 365),
        (dt.datetime(2024, 7, 2, 12), 2024.0 + 183.5 / 366),
        (
            dt.datetime(2026, 1, 1, 1, tzinfo=dt.timezone(dt.timedelta(hours=2))),
            2025 + (365 - 1 / 24) / 365,
        ),
        (2026, 2026.0),
        (np.float64(2026.25), 2026.25),
    ],
)
def test_date_becomes_a_decimal_year(date, year):
    assert earth.magnetic_field(REF, date).year == pytest.approx(year, abs=1e-9)


@pytest.mark.parametrize(("year", "model"), [(2031.5, "WMM-2025"), (2008.0, "WMM-2010")])
def test_date_out_of_the_models_warns_and_says_what_to_do(year, model):
    with pytest.warns(
        ModelExpiredWarning,
        match=rf"cover 2010 to 2030, got {year:.2f}: {model} is extrapolated, .* give the declination yourself",
    ):
        field = earth.magnetic_field(REF, year)
    assert field.model == model
    assert np.isfinite(field.field_n).all()


@pytest.mark.parametrize("year", [2010.0, 2029.999, 2030.0])
def test_date_within_the_models_does_not_warn(year):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        earth.magnetic_field(REF, year)


# --- shapes, NaN, empty, refusals -----------------------------------------------------

FUNCTIONS = [
    (earth.meridian_radius, ()), (earth.transverse_radius, ()), (earth.earth_rate_n, ()),
    (earth.normal_gravity, ()), (earth.ecef_from_lla, (3,)), (earth.dcm_ne, (3,)),
    (earth.gravity_n, (3,)), (lambda x: earth.ned_from_lla(x, REF), (3,)),
    (lambda x: earth.lla_from_ecef(earth.ecef_from_lla(x)), (3,)),
    (lambda x: earth.transport_rate_n(x, [1.0, 2.0, 3.0]), (3,)),
]  # fmt: skip


@pytest.mark.parametrize(("function", "item"), FUNCTIONS)
def test_any_leading_shape_and_nan_in_its_own_row(function, item):
    rows = np.random.default_rng(3).uniform(-1.4, 1.4, (6, *item))
    one_by_one = np.array([function(row) for row in rows])
    assert_close(function(rows), one_by_one, rtol=1e-14, atol=1e-9)
    cube = function(rows.reshape(2, 3, *item))
    assert_array_equal(cube.reshape(one_by_one.shape), function(rows))
    assert len(function(np.empty((0, *item)))) == 0
    rows[4] = NAN
    bad = np.isnan(function(rows)).reshape(6, -1).any(axis=1)
    assert_array_equal(bad, np.arange(6) == 4)


@pytest.mark.parametrize(
    ("refused", "message"),
    [
        (lambda: earth.ecef_from_lla([60.1, 24.9, 35.0]), r"latitude in `lla` must lie in \[-pi/2, pi/2\] rad, got 60\.1; if it is in degrees, multiply it by DEG\.$"),
        (lambda: earth.meridian_radius([0.1, -45.0]), r"latitude in `lat` must lie in .* got -45; "),
        (lambda: earth.normal_gravity(91 * DEG), r"latitude in `lat` must lie in .* got 1\.58825; "),
        (lambda: earth.normal_gravity(0.5, np.inf), r"`height` must be finite or NaN, got inf"),
        (lambda: earth.ecef_from_lla([0.1, 0.2]), r"`lla` must have shape \(\.\.\., 3\), got \(2,\)\.$"),
        (lambda: earth.ecef_from_lla([[0.1, np.inf, 0.2]]), r"`lla` must be finite or NaN, got .* in row 0\.$"),
        (lambda: earth.lla_from_ecef([[6.4e6, 0, 0], [6378.137, 0, 0]]), r"`r_e` must lie at least 100 km from the Earth's centre, got 6378\.14 m; is it really ECEF in metres\?$"),
        (lambda: earth.ned_from_ecef([6.4e6, 0, 0], [[0.1, 0.2, 0.3]]), r"`lla_ref` must have shape \(3,\), got \(1, 3\)\.$"),
        (lambda: earth.ned_from_ecef([6.4e6, 0, 0], [NAN, 0.2, 0.3]), r"`lla_ref` must be finite"),
        (lambda: earth.ned_from_ecef([6.4e6, 0, 0], [45.0, 0.2, 0.3]), r"latitude in `lla_ref` must lie"),
        (lambda: earth.magnetic_field([0.1, 0.2, 900e3], 2026.0), r"height of `lla` must lie in \[-1000, 850000\] m, got 900000\.$"),
        (lambda: earth.magnetic_field([0.1, 0.2, -1001.0], 2026.0), r"height of `lla` must lie in .*, got -1001\.$"),
        (lambda: earth.magnetic_field([60.1, 0.2, 0.0], 2026.0), r"latitude in `lla` must lie"),
        (lambda: earth.magnetic_field([[0.1, 0.2, 0.0]], 2026.0), r"`lla` must have shape \(3,\), got \(1, 3\)"),
        (lambda: earth.magnetic_field([NAN, 0.2, 0.0], 2026.0), r"`lla` must be finite"),
        (lambda: earth.magnetic_field(REF, 1999.0), r"`date` must lie within five years of 2010 to 2030, which the magnetic models cover, got 1999\.00\.$"),
        (lambda: earth.magnetic_field(REF, NAN), r"`date` must be finite, got nan"),
    ],
)  # fmt: skip
def test_wrong_input_is_refused_with_a_sentence(refused, message):
    with pytest.raises(ValueError, match=message):
        refused()


def test_date_as_text_is_refused():
    with pytest.raises(TypeError, match=r"`date` must be a number, got '2026-01-01'"):
        earth.magnetic_field(REF, "2026-01-01")
