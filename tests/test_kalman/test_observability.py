"""Rank and open directions against closed forms and against what a filter can find."""

import numpy as np
import pytest
from scipy import linalg

from strapdown import kalman

RNG = np.random.default_rng(3)


def test_chain_of_integrators_is_seen_from_its_end_only():
    F = np.diag(np.ones(4), 1)
    for k in range(5):
        found = kalman.observability(F, np.eye(5)[k : k + 1])
        assert found.rank == 5 - k  # what is integrated into it cannot be told from the front
        assert found.whole == (k == 0)
        assert found.open.shape == (5, k)
        np.testing.assert_allclose(np.abs(found.open).sum(axis=1) > 1e-9, np.arange(5) < k)


def test_derivative_and_step_tell_the_same():
    F = RNG.standard_normal((4, 4))
    F[0] = F[:, 0] = 0.0  # a state that stands alone
    H = np.array([[0.0, 1.0, 0.0, 0.0]])
    for matrix in (F, linalg.expm(0.1 * F), np.eye(4) + 0.1 * F):
        found = kalman.observability(matrix, H)
        assert found.rank == 3
        np.testing.assert_allclose(np.abs(found.open[:, 0]), [1, 0, 0, 0], atol=1e-9)


def test_open_directions_change_no_measurement_and_rotate_with_the_state():
    F, H = np.zeros((5, 5)), np.array([[1.0, 2.0, 0.0, 0.0, 0.0], [0.0, 1.0, 1.0, 0.0, 0.0]])
    F[3, 4] = 1.0
    T = linalg.qr(RNG.standard_normal((5, 5)))[0]
    found = kalman.observability(T @ F @ T.T, H @ T.T)
    assert found.rank == 2
    np.testing.assert_allclose(H @ T.T @ found.open, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.open.T @ found.open, np.eye(3), atol=1e-12)


def test_singular_values_are_those_of_the_stacked_matrix():
    F, H = RNG.standard_normal((3, 3)), RNG.standard_normal((2, 3))
    want = np.linalg.svd(np.vstack((H, H @ F, H @ F @ F)), compute_uv=False)
    np.testing.assert_allclose(kalman.observability(F, H).singular_values, want, rtol=1e-12)


def test_a_system_that_varies_is_seen_over_its_steps():
    """Two directions seen one after the other: together the plane, alone a line each."""
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    H = np.array([[1.0, 0.0]])
    assert kalman.observability(np.eye(2), H).rank == 1
    found = kalman.observability([turn, np.eye(2)], [H, H])
    assert found.rank == 2
    assert kalman.observability([np.eye(2)] * 2, [H, H]).rank == 1
    other = kalman.observability([np.eye(2), turn], [H, H])  # the last step is never looked at
    assert other.rank == 1


def test_nothing_measured_tells_nothing():
    found = kalman.observability(np.eye(3), np.zeros((1, 3)))
    assert found.rank == 0
    assert found.open.shape == (3, 3)


def test_what_stays_open_stays_uncertain_in_a_filter():
    """The variance along the open direction of a filter that has run for long."""
    F, H = np.eye(3), np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    found = kalman.observability(F, H)
    assert found.rank == 2
    P = np.eye(3)
    for _ in range(50):
        P = kalman.update(np.zeros(3), P, np.zeros(2), H, 1e-4 * np.eye(2)).P
    along = found.open[:, 0]
    assert along @ P @ along == pytest.approx(1.0, rel=1e-3)
    assert np.sort(np.linalg.eigvalsh(P))[1] < 1e-5


def test_tolerance_says_what_counts_as_zero():
    H = np.diag([1.0, 1e-4])
    assert kalman.observability(np.zeros((2, 2)), H).rank == 2
    assert kalman.observability(np.zeros((2, 2)), H, tolerance=1e-3).rank == 1


@pytest.mark.parametrize(
    ("F", "H", "sentence"),
    [
        (np.ones((2, 3)), np.ones((1, 3)), "`F` must be square"),
        (np.eye(3), np.ones((1, 2)), r"`H` must have shape \(n, 3\), got \(1, 2\)"),
        ([np.eye(2)] * 3, [np.ones((1, 2))] * 2, "`H` must be as many as `F`.*got 2 and 3"),
        (np.eye(2), [[np.nan, 0.0]], "`H` must be finite"),
    ],
)
def test_matrices_that_do_not_fit_are_refused(F, H, sentence):
    with pytest.raises(ValueError, match=sentence):
        kalman.observability(F, H)


def test_tolerance_must_be_positive():
    with pytest.raises(ValueError, match="`tolerance` must be positive"):
        kalman.observability(np.eye(2), np.eye(2), tolerance=0.0)
