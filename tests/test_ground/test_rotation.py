# ruff: noqa: E501 - a refusal and its sentence stand side by side
"""Rotations on arrays against SciPy, 40-digit arithmetic and definitions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_array_equal
from scipy.spatial.transform import Rotation, Slerp
from truth import rotations as truth
from truth.compare import assert_close

from strapdown import rotation as rot
from strapdown.kernels import quat as kernels
from strapdown.units import DEG

EPS = 2.2e-16
Q = truth.random_quats(200, seed=5)
P = truth.random_quats(200, seed=6)
V = np.random.default_rng(7).standard_normal((200, 3)) * 20.0
RPY = np.random.default_rng(8).uniform([-3.14, -1.57, -3.14], [3.14, 1.57, 3.14], (200, 3))
NAN = float("nan")

rotvecs = arrays(np.float64, 3, elements=st.floats(-10.0, 10.0))


def same(q, reference, atol):
    assert_close(truth.same_sign(np.asarray(q), np.asarray(reference)), reference, atol=atol)


def scipy(q):
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


# --- against SciPy, which shares no code ----------------------------------------------


def test_product_rotation_and_inverse_match_scipy():
    same(rot.quat_mul(P, Q), np.roll((scipy(P) * scipy(Q)).as_quat(), 1, axis=-1), atol=5 * EPS)
    # 30 is the length of the vectors
    assert_close(rot.rotate(Q, V), scipy(Q).apply(V), atol=10 * EPS * 60.0)
    assert_close(
        rot.rotate(rot.quat_conj(Q), V), scipy(Q).apply(V, inverse=True), atol=10 * EPS * 60.0
    )
    assert_close(rot.rotation_angle(Q), scipy(Q).magnitude(), atol=8 * EPS)


def test_matrix_and_back_match_scipy():
    C = scipy(Q).as_matrix()
    assert_close(rot.dcm_from_quat(Q), C, atol=6 * EPS)
    same(rot.quat_from_dcm(C), Q, atol=6 * EPS)


def test_rotation_vector_and_back_match_scipy():
    rotvec = scipy(Q).as_rotvec()
    # near pi the vector turns with the rounding of q: 2 eps times pi
    assert_close(rot.rotvec_from_quat(Q), rotvec, atol=8 * EPS)
    same(rot.quat_from_rotvec(rotvec), Q, atol=5 * EPS)


def test_roll_pitch_yaw_and_back_match_scipy():
    expected = Rotation.from_euler("ZYX", RPY[:, ::-1])
    q = rot.quat_from_rpy(RPY)
    same(q, np.roll(expected.as_quat(), 1, axis=-1), atol=4 * EPS)
    # the nearest row to gimbal lock loses digits by 1 / cos(pitch)
    lost = (1.0 / np.cos(RPY[:, 1]))[:, np.newaxis]
    assert (np.abs(rot.rpy_from_quat(q) - RPY) < 8 * EPS * lost).all()


def test_conversion_from_and_to_scipy_is_the_same_rotation():
    same(rot.quat_from_scipy(rot.scipy_from_quat(Q)), Q, atol=3 * EPS)
    assert_close(rot.scipy_from_quat(Q).apply(V), rot.rotate(Q, V), atol=10 * EPS * 60.0)
    assert rot.quat_from_scipy(Rotation.identity()).shape == (4,)


@given(rotvecs)
def test_composition_of_all_four_forms_comes_back(r):
    q = rot.quat_from_rotvec(r)
    there = rot.quat_from_rpy(rot.rpy_from_dcm(rot.dcm_from_rotvec(rot.rotvec_from_quat(q))))
    same(there, q, atol=2e-14)  # the matrix rounds; gimbal lock takes a half angle of 1e-14


def test_remaining_pairs_agree_with_the_ones_they_are_made_of():
    C, r = rot.dcm_from_quat(Q), rot.rotvec_from_quat(Q)
    assert_close(rot.dcm_from_rotvec(r), C, atol=12 * EPS)
    assert_close(rot.rotvec_from_dcm(C), r, atol=1e-14)
    assert_close(rot.dcm_from_rpy(RPY), rot.dcm_from_quat(rot.quat_from_rpy(RPY)), atol=0)
    C = rot.dcm_from_rpy(RPY)
    assert_close(rot.dcm_from_rpy(rot.rpy_from_dcm(C)), C, atol=12 * EPS)
    assert_close(rot.dcm_from_rpy(rot.rpy_from_rotvec(r)), dcm(Q), atol=12 * EPS)
    assert_close(rot.dcm_from_rotvec(rot.rotvec_from_rpy(RPY)), C, atol=12 * EPS)


def dcm(q):
    return scipy(q).as_matrix()


# --- against definitions --------------------------------------------------------------


@pytest.mark.parametrize("rpy", [(0.3, -0.8, 2.5), (-3.0, 1.4, -2.0), (1.5, -1.57, 0.1)])
def test_roll_pitch_yaw_are_three_turns_in_the_order_z_y_x(rpy):
    assert_close(rot.dcm_from_rpy(rpy), truth.zyx(*rpy), atol=5 * EPS)


@pytest.mark.parametrize(
    ("rpy_deg", "v_b", "v_n"),
    [
        ((0, 0, 90), (1, 0, 0), (0, 1, 0)),  # heading east: forward is east
        ((0, 30, 0), (1, 0, 0), (np.cos(30 * DEG), 0, -0.5)),  # nose up: forward rises
        ((90, 0, 0), (0, 1, 0), (0, 0, 1)),  # roll right: the right wing points down
    ],
)
def test_signs_of_roll_pitch_yaw(rpy_deg, v_b, v_n):
    q_nb = rot.quat_from_rpy(np.array(rpy_deg) * DEG)
    assert_close(rot.rotate(q_nb, v_b), v_n, atol=2 * EPS)


@pytest.mark.parametrize("q", [Q[3], Q[4]])
def test_kernels_and_array_functions_are_the_same_algebra(q):
    assert_close(rot.quat_mul(q, P[0]), kernels.mul(*q, *P[0]), atol=2 * EPS)
    assert_close(rot.rotate(q, V[0]), kernels.rotate(*q, *V[0]), atol=20 * EPS * 60)
    assert_close(rot.dcm_from_quat(q).ravel(), kernels.dcm(*q), atol=2 * EPS)
    assert_close(rot.rotvec_from_quat(q), kernels.log(*q), atol=4 * EPS)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-160, 1e-20, 1e-9, 1e-3, 1.0, np.pi, 1e3, 1e10])
def test_exponential_is_exact_at_any_size(angle):
    r = angle * np.array([0.48, -0.6, 0.64])
    expected = truth.exp_quat(r)
    q = rot.quat_from_rotvec(r)
    # sine and cosine of a large angle move with its last place
    same(q, expected, atol=EPS * max(2.0, angle))
    assert_close(np.abs(q[1:]), np.abs(expected[1:]), rtol=4 * EPS * max(1.0, angle))


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-160, 1e-20, 1e-9, 1e-3, 1.0, 3.14159])
def test_rotation_vector_keeps_all_digits_of_small_angles(angle):
    r = angle * np.array([0.48, -0.6, 0.64])
    assert_close(
        rot.rotvec_from_quat(truth.exp_quat(r)), r, rtol=6 * EPS, atol=1e-15 * (angle > 3)
    )


@pytest.mark.parametrize("turn", [np.eye(3)[0], np.eye(3)[1], np.eye(3)[2], [0.6, 0.0, 0.8]])
def test_half_turns_are_exact_in_every_form(turn):
    C = 2.0 * np.outer(turn, turn) - np.eye(3)
    q = rot.quat_from_dcm(C)
    assert_close(q, [0.0, *turn], atol=2 * EPS)
    assert_close(np.abs(rot.rotvec_from_quat(q)), np.pi * np.abs(turn), atol=4 * EPS)
    assert_close(rot.dcm_from_quat(q), C, atol=4 * EPS)


# --- gimbal lock ----------------------------------------------------------------------

AWAY = [0.0, 1e-16, 1e-15, 1e-14, 1e-13, 1e-12, 1e-10, 1e-8, 1e-6, 1e-3]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("away", AWAY)
def test_round_trip_near_gimbal_lock_is_the_same_rotation(sign, away):
    rpy = RPY.copy()
    rpy[:, 1] = sign * (np.pi / 2 - away)
    q = rot.quat_from_rpy(rpy)
    # within a half angle of 1e-14 of the lock, roll is set to zero at that price
    same(rot.quat_from_rpy(rot.rpy_from_quat(q)), q, atol=1.1e-14 if away < 1e-13 else 6 * EPS)


@pytest.mark.parametrize(
    ("rpy_deg", "expected_deg"),
    [((20, 90, 50), (0, 90, 30)), ((20, -90, 50), (0, -90, 70)), ((170, -90, 50), (0, -90, -140))],
)
def test_in_gimbal_lock_roll_is_zero_and_yaw_carries_the_turn(rpy_deg, expected_deg):
    rpy = rot.rpy_from_quat(rot.quat_from_rpy(np.array(rpy_deg) * DEG))
    assert_close(rpy, np.array(expected_deg) * DEG, atol=1e-15)
    assert rpy[0] == 0.0


def test_ranges_of_roll_pitch_yaw():
    rpy = rot.rpy_from_quat(np.vstack((Q, -Q, np.eye(4), -np.eye(4))))
    assert (np.abs(rpy) <= np.array([np.pi, np.pi / 2, np.pi])).all()
    assert (rpy[:, [0, 2]] > -np.pi).all()


# --- other conventions ----------------------------------------------------------------


def jpl_matrix(q):
    """C of a JPL quaternion (x, y, z, w): (2 w^2 - 1) I - 2 w [v x] + 2 v v^T."""
    v, w = q[:3], q[3]
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return (2 * w * w - 1) * np.eye(3) - 2 * w * skew + 2 * np.outer(v, v)


def test_jpl_quaternion_takes_n_to_b():
    for q in Q[:20]:
        jpl = rot.jpl_from_quat(q)
        assert_close(jpl_matrix(jpl), rot.dcm_from_quat(q).T, atol=8 * EPS)
        assert_array_equal(rot.quat_from_jpl(jpl), q)


def test_scalar_last_moves_the_scalar():
    assert_array_equal(rot.scalar_last_from_quat([0.8, 0.0, 0.6, 0.0]), [0.0, 0.6, 0.0, 0.8])
    assert_array_equal(rot.quat_from_scalar_last(rot.scalar_last_from_quat(Q)), Q)


def test_enu_and_ned_name_the_same_directions():
    assert_array_equal(rot.enu_from_ned([1.0, 2.0, 3.0]), [2.0, 1.0, -3.0])
    assert_array_equal(rot.ned_from_enu(rot.enu_from_ned(V)), V)


def test_attitude_relative_to_enu_is_the_same_attitude():
    q_enu_b = rot.quat_enu_from_ned(Q)
    assert_close(rot.rotate(q_enu_b, V), rot.enu_from_ned(rot.rotate(Q, V)), atol=20 * EPS * 60.0)
    assert_close(rot.quat_ned_from_enu(q_enu_b), Q, atol=3 * EPS)


# --- slerp, interpolation, mean -------------------------------------------------------


@pytest.mark.parametrize("fraction", [0.0, 1e-9, 0.25, 0.5, 1.0])
def test_slerp_matches_scipy(fraction):
    for q_a, q_b in zip(Q[:20], P[:20], strict=True):
        expected = Slerp([0.0, 1.0], scipy(np.stack((q_a, q_b))))(fraction)
        same(rot.slerp(q_a, q_b, fraction), np.roll(expected.as_quat(), 1), atol=8 * EPS)


def test_slerp_takes_the_short_way_and_starts_on_the_side_of_the_first():
    q_b = rot.quat_from_rotvec([0.0, 0.0, 0.2])
    q_a = np.array([-1.0, 0.0, 0.0, 0.0])
    half = rot.slerp(q_a, q_b, 0.5)
    assert_close(half, -rot.quat_from_rotvec([0.0, 0.0, 0.1]), atol=2 * EPS)


def test_slerp_broadcasts_and_extrapolates():
    q_a, q_b = rot.quat_from_rotvec([[0, 0, 0], [0, 0, 0.3]])
    out = rot.slerp(q_a, q_b, [-1.0, 0.0, 2.0])
    assert_close(rot.rotvec_from_quat(out)[:, 2], [-0.3, 0.0, 0.6], atol=4 * EPS)


def test_interpolation_matches_scipy_and_hits_the_given_times():
    t = np.cumsum(np.random.default_rng(1).uniform(0.01, 0.2, 200))
    asked = np.sort(np.concatenate((t, np.random.default_rng(2).uniform(t[0], t[-1], 100))))
    out = rot.interpolate(asked, t, Q)
    same(out, np.roll(Slerp(t, scipy(Q))(asked).as_quat(), 1, axis=-1), atol=20 * EPS)
    same(rot.interpolate(t, t, Q), Q, atol=2 * EPS)


def test_interpolation_next_to_nan_is_nan_and_elsewhere_not():
    q = Q[:4].copy()
    q[2] = NAN
    out = rot.interpolate([0.5, 1.0, 1.5, 2.5, 3.0], [0.0, 1.0, 2.0, 3.0], q)
    assert_array_equal(np.isnan(out).any(axis=1), [False, False, True, True, False])


def test_mean_matches_scipy_with_and_without_weights():
    near = rot.quat_mul(Q[0], rot.quat_from_rotvec(0.02 * V))
    signs = np.where(np.arange(200) % 3 == 0, -1.0, 1.0)[:, np.newaxis]
    weights = np.random.default_rng(3).uniform(0.0, 5.0, 200)
    for w in (None, weights):
        expected = np.roll(scipy(near).mean(weights=w).as_quat(), 1)
        # an eigenvector is good to eps over the gap of the eigenvalues
        same(rot.mean_rotation(near * signs, w), expected, atol=1e-14)


def test_mean_of_two_is_half_way_and_of_one_is_itself():
    same(rot.mean_rotation([Q[0], P[0]]), rot.slerp(Q[0], P[0], 0.5), atol=1e-14)
    same(rot.mean_rotation([Q[0]]), Q[0], atol=4 * EPS)


def test_nearest_matrix_undoes_noise_and_gives_a_rotation():
    C = rot.dcm_from_quat(Q)
    noisy = C + 1e-3 * np.random.default_rng(4).standard_normal(C.shape)
    fixed = rot.nearest_dcm(noisy)
    assert_close(
        fixed @ np.swapaxes(fixed, -1, -2), np.broadcast_to(np.eye(3), C.shape), atol=16 * EPS
    )
    assert_close(np.linalg.det(fixed), 1.0, atol=16 * EPS)
    # no rotation is nearer, the true one least of all
    assert (
        np.linalg.norm(fixed - noisy, axis=(1, 2)) <= np.linalg.norm(C - noisy, axis=(1, 2))
    ).all()
    assert np.linalg.det(rot.nearest_dcm(np.diag([1.0, 1.0, -0.5]))) == pytest.approx(1.0)


# --- angles ---------------------------------------------------------------------------


@given(st.floats(-1e6, 1e6))
def test_wrapped_angle_is_in_range_and_the_same_direction(angle):
    out = float(rot.wrap_pi(angle))
    assert -np.pi < out <= np.pi
    # whole turns are multiples of the float 2 pi, which is off by 2.5e-16 each
    assert abs(np.sin(out) - np.sin(angle)) < 1e-10


@pytest.mark.parametrize(
    ("angle", "expected"),
    [(np.pi, np.pi), (-np.pi, np.pi), (3 * np.pi, np.pi), (0.0, 0.0), (4.0, 4.0 - 2 * np.pi),
     (-4.0, 2 * np.pi - 4.0), (2 * np.pi, 0.0), (-1.5, -1.5), (np.nextafter(-np.pi, 0), -np.pi)],
)  # fmt: skip
def test_wrapping_at_the_edges(angle, expected):
    assert rot.wrap_pi(angle) == pytest.approx(expected, abs=1e-15)


# --- shapes, NaN, empty, huge ---------------------------------------------------------

UNARY = [
    (rot.quat_conj, 4), (rot.quat_normalize, 4), (rot.rotation_angle, 4), (rot.dcm_from_quat, 4),
    (rot.rpy_from_quat, 4), (rot.rotvec_from_quat, 4), (rot.quat_from_rpy, 3),
    (rot.quat_from_rotvec, 3), (rot.dcm_from_rpy, 3), (rot.dcm_from_rotvec, 3),
    (rot.rpy_from_rotvec, 3), (rot.rotvec_from_rpy, 3), (rot.scalar_last_from_quat, 4),
    (rot.quat_from_scalar_last, 4), (rot.jpl_from_quat, 4), (rot.quat_from_jpl, 4),
    (rot.enu_from_ned, 3), (rot.ned_from_enu, 3), (rot.quat_enu_from_ned, 4),
    (rot.quat_ned_from_enu, 4),
]  # fmt: skip
MATRIX = [rot.quat_from_dcm, rot.rpy_from_dcm, rot.rotvec_from_dcm]


@pytest.mark.parametrize(("function", "width"), UNARY, ids=lambda x: getattr(x, "__name__", x))
def test_any_leading_shape_gives_the_same_rows(function, width):
    rows = Q[:12] if width == 4 else RPY[:12]
    one_by_one = np.array([function(row) for row in rows])
    assert_array_equal(function(rows), one_by_one)
    cube = function(rows.reshape(2, 3, 2, width))
    assert_array_equal(cube.reshape(one_by_one.shape), one_by_one)
    assert len(function(np.empty((0, width)))) == 0


@pytest.mark.parametrize(("function", "width"), UNARY, ids=lambda x: getattr(x, "__name__", x))
def test_nan_stays_in_its_row_and_wrong_input_is_refused(function, width):
    rows = (Q if width == 4 else RPY)[:4].copy()
    clean = function(rows)
    rows[1] = NAN
    out = function(rows)
    assert np.isnan(out[1]).any()
    assert_array_equal(np.delete(out, 1, axis=0), np.delete(clean, 1, axis=0))
    with pytest.raises(
        ValueError, match=rf"must have shape \(\.\.\., {width}\), got \({width}, 7\)"
    ):
        function(np.zeros((width, 7)))
    rows[2] = np.inf
    with pytest.raises(ValueError, match=r"must be finite or NaN, got \[inf .* in row 2\.$"):
        function(rows)


@pytest.mark.parametrize("function", MATRIX, ids=lambda f: f.__name__)
def test_matrices_of_any_leading_shape_with_nan(function):
    C = rot.dcm_from_quat(Q[:12])
    one_by_one = np.array([function(matrix) for matrix in C])
    assert_array_equal(function(C.reshape(3, 4, 3, 3)).reshape(one_by_one.shape), one_by_one)
    assert len(function(np.empty((0, 3, 3)))) == 0
    C[5, 1, 1] = NAN
    assert_array_equal(np.isnan(function(C)).any(axis=-1), np.arange(12) == 5)


def test_products_and_rotations_broadcast():
    assert_array_equal(rot.quat_mul(Q[0], P)[7], rot.quat_mul(Q[0], P[7]))
    assert_array_equal(rot.rotate(Q, [1.0, 2.0, 3.0])[7], rot.rotate(Q[7], [1.0, 2.0, 3.0]))
    assert rot.rotate(Q[:5, np.newaxis], V[:7]).shape == (5, 7, 3)


def test_inputs_are_left_alone():
    q, v = Q.copy(), V.copy()
    rot.quat_mul(q, q), rot.rotate(q, v), rot.slerp(q, q, 0.5), rot.mean_rotation(q)
    rot.quat_normalize(q), rot.quat_conj(q), rot.rpy_from_quat(q), rot.enu_from_ned(v)
    assert_array_equal(q, Q)
    assert_array_equal(v, V)


def test_huge_and_tiny_quaternions_normalize_without_overflow():
    q = rot.quat_normalize([[3e300, 4e300, 0, 0], [3e-300, 0, 4e-300, 0]])
    assert_close(q, [[0.6, 0.8, 0, 0], [0.6, 0, 0.8, 0]], atol=2 * EPS)


@pytest.mark.parametrize("scale", [1e-300, 1.0, 1e300])
def test_rotation_vectors_of_any_size_give_unit_quaternions(scale):
    q = rot.quat_from_rotvec(scale * np.array([1.0, -2.0, 3.0]))
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=4 * EPS)


@pytest.mark.parametrize(
    ("refused", "message"),
    [
        (lambda: rot.quat_mul(Q[:3], Q[:4]), r"`q_ab` and `q_bc` must have equal or broadcastable lengths, got shapes \(3, 4\) and \(4, 4\)"),
        (lambda: rot.rotate(Q[:3], V[:4]), r"`q_nb` and `v_b` must have equal or broadcastable"),
        (lambda: rot.slerp(Q[:3], Q[:4], 0.5), r"`q_a` and `q_b` must have equal or broadcastable"),
        (lambda: rot.slerp(Q[0], Q[1], np.inf), r"`fraction` must be finite or NaN, got inf"),
        (lambda: rot.quat_normalize([0.0, 0.0, 0.0, 0.0]), r"`q` must not be zero"),
        (lambda: rot.quat_conj([2.0, 0.0, 0.0, 0.0]), r"`q_ab` must have unit norm within 1e-06, got norm 2"),
        (lambda: rot.quat_from_dcm(1.001 * np.eye(3)), r"`C_nb` must be orthonormal within 1e-06, got C\^T C off by 0.002; `nearest_dcm` gives"),
        (lambda: rot.quat_from_dcm(np.diag([1.0, 1.0, -1.0])), r"`C_nb` must have determinant \+1, got a mirror image"),
        (lambda: rot.nearest_dcm(np.full((3, 3), NAN)), r"`matrix` must be finite"),
        (lambda: rot.scipy_from_quat(Q[:4].reshape(2, 2, 4)), r"`q_nb` must have shape \(4,\) or \(n, 4\) for SciPy, got \(2, 2, 4\)"),
        (lambda: rot.scipy_from_quat([NAN] * 4), r"`q_nb` must be finite"),
        (lambda: rot.interpolate([1.0, 9.0], [0.0, 1.0, 2.0], Q[:3]), r"`t` must lie in \[0\.0, 2\.0\] of `t_q`, got 1\.0 to 9\.0; cut it"),
        (lambda: rot.interpolate([1.0], [], np.empty((0, 4))), r"`t` must lie in an empty span of `t_q`"),
        (lambda: rot.interpolate([1.0], [0.0, 0.0], Q[:2]), r"`t_q` must increase, got 0\.0 after 0\.0 in row 1"),
        (lambda: rot.interpolate([1.0], [0.0, 2.0], Q[:3]), r"`q` must have shape \(2, 4\) like `t_q`, got \(3, 4\)"),
        (lambda: rot.mean_rotation(np.empty((0, 4))), r"`q` must have shape \(n, 4\) with n >= 1, got \(0, 4\)"),
        (lambda: rot.mean_rotation(Q[0]), r"`q` must have shape \(n, 4\) with n >= 1, got \(4,\)"),
        (lambda: rot.mean_rotation(np.eye(4)[:2]), r"`q` must have a unique mean"),
        (lambda: rot.mean_rotation(Q[:2], [1.0, -1.0]), r"`weights` must be non-negative and not all zero"),
        (lambda: rot.mean_rotation(Q[:2], [0.0, 0.0]), r"`weights` must be non-negative and not all zero"),
        (lambda: rot.mean_rotation(Q[:2], [1.0]), r"`weights` must have shape \(2,\), got \(1,\)"),
        (lambda: rot.wrap_pi(np.inf), r"`angle` must be finite or NaN, got inf"),
    ],
)  # fmt: skip
def test_wrong_input_is_refused_with_a_sentence(refused, message):
    with pytest.raises(ValueError, match=message):
        refused()


def test_interpolation_at_no_times_is_empty():
    assert rot.interpolate([], [0.0, 1.0], Q[:2]).shape == (0, 4)
    assert np.isnan(rot.wrap_pi([NAN, 1.0])).sum() == 1
