"""Quaternion kernels against 40-digit arithmetic and against definitions."""

import math

import mpmath as mp
import numpy as np
import pytest
from truth import rotations as truth
from truth.compare import assert_close

from strapdown.kernels import quat

EPS = 2.2e-16
QUATS = truth.random_quats(12, seed=1)
VECTORS = np.random.default_rng(2).standard_normal((12, 3)) * 10.0
IDENTITY = (1.0, 0.0, 0.0, 0.0)


def matrix(q):
    return np.reshape(quat.dcm(*q), (3, 3))


# --- algebra --------------------------------------------------------------------------


@pytest.mark.parametrize(("a", "b"), list(zip(QUATS, QUATS[::-1] * 1.3, strict=True)))
def test_product_follows_the_table_of_units(a, b):
    # four products of numbers below 1.3, three sums
    assert_close(quat.mul(*a, *b), truth.hamilton(a, b), atol=6 * EPS)


def test_product_cancels_the_inner_letters():
    a, b = QUATS[0], QUATS[1]
    # 9 sums of products of numbers below 1
    assert_close(matrix(quat.mul(*a, *b)), matrix(a) @ matrix(b), atol=10 * EPS)


@pytest.mark.parametrize("q", QUATS)
def test_conjugate_is_the_inverse_rotation(q):
    assert_close(quat.mul(*q, *quat.conj(*q)), IDENTITY, atol=4 * EPS)
    assert_close(matrix(quat.conj(*q)), matrix(q).T, atol=4 * EPS)


def test_normalize_gives_unit_norm_and_keeps_the_direction():
    for q in QUATS * 7.0:
        unit = np.array(quat.normalize(*q))
        assert math.isclose(np.linalg.norm(unit), 1.0, abs_tol=2 * EPS)
        assert_close(unit * np.linalg.norm(q), q, rtol=4 * EPS)


# --- rotation of vectors --------------------------------------------------------------


@pytest.mark.parametrize("rotvec", VECTORS * 0.2)
def test_matrix_is_that_of_rodrigues(rotvec):
    q = truth.exp_quat(rotvec)
    assert_close(matrix(q), truth.rodrigues(rotvec), atol=5 * EPS)


@pytest.mark.parametrize(("q", "v"), list(zip(QUATS, VECTORS, strict=True)))
def test_rotate_takes_components_in_b_to_components_in_n(q, v):
    C_nb = matrix(q)
    tolerance = 10 * EPS * np.linalg.norm(v)
    assert_close(quat.rotate(*q, *v), C_nb @ v, atol=tolerance)
    assert_close(quat.rotate_inverse(*q, *v), C_nb.T @ v, atol=tolerance)


@pytest.mark.parametrize("q", QUATS)
def test_down_in_body_is_the_third_row_of_the_matrix(q):
    assert_close(quat.down_in_body(*q), quat.rotate_inverse(*q, 0.0, 0.0, 1.0), atol=4 * EPS)


# --- exponential and logarithm --------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 1e-200, 1e-9, 9.9e-3, 9.9999e-3, 1.0001e-2, 1.1e-2, 3, 10])
def test_exp_is_exact_on_both_sides_of_the_series_switch(angle):
    axis = np.array([0.48, -0.6, 0.64])
    q, expected = quat.exp(*(angle * axis)), truth.exp_quat(angle * axis)
    # the closed form takes the sine of an angle that is off by half a unit in the last place
    assert q[0] == pytest.approx(expected[0], abs=EPS * max(1.0, 0.5 * angle))
    assert_close(q[1:], expected[1:], rtol=3 * EPS, atol=EPS * angle)


def test_exp_of_the_conjugate_is_the_rotation_back():
    for r in VECTORS:
        assert_close(quat.exp(*-r), quat.conj(*quat.exp(*r)), atol=EPS)


@pytest.mark.parametrize(
    "angle", [0.0, 1e-200, 1e-9, 1.9e-4, 1.99999e-4, 2.00001e-4, 2.1e-4, 0.1, 1.0, 3.0, 3.14159]
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_log_is_exact_on_both_sides_of_the_series_switch(angle, sign):
    axis = np.array([0.48, -0.6, 0.64])
    q = truth.exp_quat(angle * axis)
    # the truth is the logarithm of the rounded q, not of what q was made from
    w, sine = mp.mpf(q[0]), mp.sqrt(sum(mp.mpf(x) ** 2 for x in q[1:]))
    k = 2 * mp.atan2(sine, w) / sine if sine else mp.mpf(2)
    expected = [float(k * mp.mpf(x)) for x in q[1:]]
    assert_close(quat.log(*(sign * q)), expected, rtol=4 * EPS)


def test_log_takes_the_short_way_round():
    r = np.array(quat.log(*quat.exp(0.0, 4.0, 0.0)))  # 4 rad one way is 2 pi - 4 the other
    assert_close(r, [0.0, 4.0 - 2.0 * np.pi, 0.0], atol=4 * EPS)


# --- from a matrix --------------------------------------------------------------------


@pytest.mark.parametrize(
    "rotvec",
    [
        (0.1, -0.2, 0.3), (3.1, 0.2, -0.1), (0.2, -3.1, 0.1), (-0.1, 0.2, 3.1),
        (np.pi, 0, 0), (0, np.pi, 0), (0, 0, np.pi), (1.81, 1.81, 1.81), (0.0, 0.0, 0.0),
        (-3.1, 0.2, -0.1), (-0.2, 3.1, 0.1), (-0.1, 0.2, -3.1),
        # almost half a turn: there w is tiny, and dividing by it would cost three digits
        (2.512, -1.508, 1.130), (-1.507, 2.512, 1.130), (1.130, 1.507, -2.512),
    ],
)  # fmt: skip
def test_quaternion_of_a_matrix_is_exact_at_every_angle(rotvec):
    C = truth.rodrigues(rotvec)
    q = np.array(quat.from_dcm(*C.ravel()))
    expected = truth.same_sign(truth.exp_quat(rotvec), q)
    assert_close(q, expected, atol=4 * EPS)
    assert q[0] >= 0.0


# --- from vectors ---------------------------------------------------------------------


@pytest.mark.parametrize(("a", "b"), list(zip(VECTORS, VECTORS[::-1] * 1e-5, strict=True)))
def test_two_vectors_give_the_shortest_rotation_from_one_to_the_other(a, b):
    q = quat.from_two_vectors(*a, *b)
    unit_a, unit_b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    assert_close(quat.rotate(*q, *unit_a), unit_b, atol=6 * EPS)
    assert 2.0 * math.acos(q[0]) == pytest.approx(math.acos(unit_a @ unit_b), abs=1e-14)


@pytest.mark.parametrize("gap", [0.0, 1e-17, 1e-15, 1e-12, 1e-8, 1e-3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("a", [*np.eye(3), *VECTORS[:3]])
def test_nearly_equal_and_nearly_opposite_vectors_are_exact_too(a, sign, gap):
    unit_a = a / np.linalg.norm(a)
    side = np.cross(unit_a, [0.36, 0.48, 0.8])
    b = sign * (unit_a + gap * side)
    q = quat.from_two_vectors(*a, *b)
    assert math.isclose(np.linalg.norm(q), 1.0, abs_tol=3 * EPS)
    assert_close(quat.rotate(*q, *unit_a), b / np.linalg.norm(b), atol=6 * EPS)


@pytest.mark.parametrize("roll", [-3.0, -1.0, 0.0, 0.4, 2.5])
@pytest.mark.parametrize("pitch", [-1.5, -0.3, 0.0, 0.7, 1.57])
def test_specific_force_at_rest_gives_roll_and_pitch_with_yaw_zero(roll, pitch):
    C_nb = truth.zyx(roll, pitch, 0.0)
    f_b = C_nb.T @ [0.0, 0.0, -9.81]
    assert_close(matrix(quat.from_acc(*f_b)), C_nb, atol=2e-14 / np.cos(pitch) ** 0.5)


@pytest.mark.parametrize("up_b", [*np.eye(3), *-np.eye(3)])
def test_specific_force_along_an_axis_levels_the_body(up_b):
    q = quat.from_acc(*(9.81 * up_b))
    assert_close(quat.rotate(*q, *up_b), [0.0, 0.0, -1.0], atol=2 * EPS)


@pytest.mark.parametrize("inclination", [-1.2, 0.0, 1.1, 1.5])
@pytest.mark.parametrize(
    "rpy", [(0.1, -0.2, 0.3), (-2.0, 1.2, -3.0), (3.0, -1.5, 1.6), (0, 0, 3.1)]
)
def test_force_and_field_give_the_whole_attitude(rpy, inclination):
    C_nb = truth.zyx(*rpy)
    f_b = C_nb.T @ [0.0, 0.0, -9.81]
    m_b = C_nb.T @ [48e-6 * np.cos(inclination), 0.0, 48e-6 * np.sin(inclination)]
    # the horizontal part of the field shrinks with cos(inclination)
    assert_close(matrix(quat.from_acc_mag(*f_b, *m_b)), C_nb, atol=6 * EPS / np.cos(inclination))


@pytest.mark.parametrize("scale", [1e-9, 0.05, 300.0])
def test_strength_of_force_and_field_does_not_matter(scale):
    f_b, m_b = np.array([1.0, 2.0, -9.0]), np.array([20.0, -5.0, 40.0])
    assert_close(quat.from_acc(*(scale * f_b)), quat.from_acc(*f_b), atol=2 * EPS)
    expected = quat.from_acc_mag(*f_b, *m_b)
    assert_close(quat.from_acc_mag(*(scale * f_b), *m_b), expected, atol=4 * EPS)
    assert_close(quat.from_acc_mag(*f_b, *(scale * m_b)), expected, atol=4 * EPS)


NOTHING = (0.0, 0.0, 0.0)
UP = (0.1, 0.2, -9.8)


@pytest.mark.parametrize(
    "q",
    [
        quat.from_acc(*NOTHING),
        quat.from_acc(math.nan, 0.0, -9.8),
        quat.from_two_vectors(*NOTHING, *UP),
        quat.from_two_vectors(*UP, *NOTHING),
        quat.from_two_vectors(*UP, math.nan, 0.0, 1.0),
        quat.from_acc_mag(*NOTHING, *UP),
        quat.from_acc_mag(*UP, *NOTHING),
        quat.from_acc_mag(*UP, *(5e-6 * np.array(UP))),
        quat.from_acc_mag(*UP, *(-5e-6 * np.array(UP) + 1e-11)),
        quat.from_acc_mag(0.0, 0.0, -9.8, 7e-7, 0.0, 1.0),
        quat.from_acc_mag(*UP, math.nan, 0.0, 1.0),
    ],
)
def test_vectors_without_a_direction_give_nan(q):
    assert np.isnan(q).all()


def test_field_near_the_vertical_still_counts():
    m_b = (1.3e-6, 0.0, 1.0)  # a little above the least sine
    assert_close(quat.from_acc_mag(0.0, 0.0, -9.8, *m_b), IDENTITY, atol=EPS)
