# ruff: noqa: E501 - a refusal and its sentence stand side by side
"""Checks of arguments: what passes, in which form, and the sentence of each refusal."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from strapdown import _checks as checks
from strapdown.rotation import quat_normalize

NAN, INF = float("nan"), float("inf")
ROWS = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]


# --- what passes ----------------------------------------------------------------------


@pytest.mark.parametrize(
    "value",
    [
        ROWS,
        np.array(ROWS, dtype=np.float32),
        np.array(ROWS, dtype=np.int16),
        np.asfortranarray(ROWS),
        np.array(ROWS)[::-1][::-1],
        np.ma.masked_array(ROWS, mask=False),
    ],
)
def test_samples_become_contiguous_float64(value):
    out = checks.as_samples("gyr", value)
    assert out.dtype == np.float64
    assert out.flags.c_contiguous
    assert_array_equal(out, ROWS)


def test_array_in_the_right_form_is_not_copied():
    rows = np.array(ROWS)
    assert checks.as_samples("gyr", rows) is rows
    t = np.arange(3.0)
    assert checks.as_times("t", t) is t


def test_empty_series_pass():
    assert checks.as_samples("gyr", np.empty((0, 3))).shape == (0, 3)
    assert checks.as_times("t", []).shape == (0,)
    assert checks.as_quats("q", np.empty((0, 4))).shape == (0, 4)


def test_nan_passes_where_it_is_allowed():
    rows = [[1.0, NAN, 3.0]]
    assert_array_equal(checks.as_samples("acc", rows, allow_nan=True), rows)
    assert_array_equal(checks.as_quats("q", [[NAN] * 4], allow_nan=True), [[NAN] * 4])


def test_masked_samples_become_nan():
    value = np.ma.masked_array([[1, 2, 3]], mask=[[0, 1, 0]])
    assert_array_equal(checks.as_samples("acc", value, allow_nan=True), [[1.0, NAN, 3.0]])


def test_rounded_unit_quaternion_is_scaled_and_a_unit_one_keeps_its_bits():
    q = np.array([[0.5, 0.5, 0.5, 0.5 + 4e-7]])
    out = checks.as_quats("q", q)
    assert abs(np.linalg.norm(out) - 1.0) < 3e-16
    assert q[0, 3] == 0.5 + 4e-7, "the input is left alone"
    unit = quat_normalize(np.random.default_rng(0).standard_normal((10_000, 4)))
    assert checks.as_quats("q", unit) is unit


def test_numbers_pass_and_become_floats():
    assert checks.positive("kp", np.float32(2.0)) == 2.0
    assert checks.positive("ki", 0, allow_zero=True) == 0.0
    assert checks.in_range("share", 1, 0.0, 1.0) == 1.0
    assert checks.finite("x", -3) == -3.0
    assert checks.whole("n", np.int64(3), low=3, high=3) == 3
    assert checks.whole("n", 4.0) == 4
    assert checks.one_of("mode", "fast", ["slow", "fast"]) == "fast"
    assert checks.same_length(a=np.zeros(3), b=np.zeros((3, 2))) == 3


# --- refusals -------------------------------------------------------------------------


def call(name, *args, **kwargs):
    return lambda: getattr(checks, name)(*args, **kwargs)


@pytest.mark.parametrize(
    ("refused", "message"),
    [
        (call("as_samples", "gyr", np.zeros((3, 100))), r"`gyr` must have shape \(n, 3\), got \(3, 100\)\.$"),
        (call("as_samples", "gyr", [1.0, 2.0, 3.0]), r"`gyr` must have shape \(n, 3\), got \(3,\)\.$"),
        (call("as_samples", "acc", [[0, 0, 1], [NAN, 0.1, 9.8]]), r"`acc` must be finite, got \[nan 0\.1 9\.8\] in row 1\.$"),
        (call("as_samples", "acc", [[0, NAN, 1], [INF, 0, 0]], allow_nan=True), r"`acc` must be finite or NaN, got \[inf .*\] in row 1\.$"),
        (call("as_samples", "acc", [[1, 2, 3], [4, 5]]), r"`acc` must be a regular array of numbers, got "),
        (call("as_series", "p", [1.0, 2.0], 3), r"`p` must have shape \(3,\), got \(2,\)\.$"),
        (call("as_series", "p", [[1.0]]), r"`p` must have shape \(n,\), got \(1, 1\)\.$"),
        (call("as_series", "p", [1.0, INF]), r"`p` must be finite, got inf in row 1\.$"),
        (call("as_vector", "lever_arm_b", [1.0, 2.0]), r"`lever_arm_b` must have shape \(3,\), got \(2,\)\.$"),
        (call("as_vector", "lever_arm_b", [1.0, NAN, 2.0]), r"`lever_arm_b` must be finite, got \[ 1\. nan 2\.\]\.$"),
        (call("as_vectors", "v_b", 1.0), r"`v_b` must have shape \(\.\.\., 3\), got \(\)\.$"),
        (call("as_vectors", "v_b", np.where(np.arange(12) == 7, NAN, 0.0).reshape(2, 2, 3)), r"`v_b` must be finite, got \[ 0\. nan 0\.\] at index \(1, 0\)\.$"),
        (call("as_matrices", "C", np.zeros((3, 4))), r"`C` must have shape \(\.\.\., 3, 3\), got \(3, 4\)\.$"),
        (call("as_matrices", "C", np.full((2, 3, 3), NAN)), r"`C` must be finite, got .* in row 0\.$"),
        (call("as_times", "t", [0.0, 0.02, 0.02]), r"`t` must increase, got 0\.02 after 0\.02 in row 2\.$"),
        (call("as_times", "t", [0.0, 1.0, 0.5, 2.0]), r"`t` must increase, got 0\.5 after 1\.0 in row 2\.$"),
        (call("as_times", "t", [1.0, 2.0], after=1.0), r"`t` must increase, got 1\.0 after 1\.0 in row 0\.$"),
        (call("as_times", "t", [0.0, NAN]), r"`t` must be finite, got nan in row 1\.$"),
        (call("as_times", "t", [0.0, 1.0], 3), r"`t` must have shape \(3,\), got \(2,\)\.$"),
        (call("as_quats", "q_nb", [[1, 0, 0, 0], [0.7, 0, 0, 0]]), r"`q_nb` must have unit norm within 1e-06, got norm 0\.7 in row 1; if only its direction counts, divide it by its norm first\.$"),
        (call("as_quats", "q_nb", [0, 0, 0, 1.00001]), r"`q_nb` must have unit norm within 1e-06, got norm 1\.00001; "),
        (call("as_quats", "q_nb", [[NAN] * 4]), r"`q_nb` must be finite, got \[nan nan nan nan\] in row 0\.$"),
        (call("as_quats", "q_nb", [1e200, 0, 0, 0]), r"`q_nb` must have unit norm within 1e-06, got norm "),
        (call("same_length", gyr=np.zeros((3, 3)), acc=np.zeros((4, 3))), r"`gyr` and `acc` must have equal length, got 3 and 4\.$"),
        (call("finite", "x", NAN), r"`x` must be finite, got nan\.$"),
        (call("positive", "kp", 0.0), r"`kp` must be positive and finite, got 0\.0\.$"),
        (call("positive", "ki", -1.0, allow_zero=True), r"`ki` must be non-negative and finite, got -1\.0\.$"),
        (call("positive", "kp", INF), r"`kp` must be positive and finite, got inf\.$"),
        (call("in_range", "share", 1.5, 0.0, 1.0), r"`share` must lie in \[0, 1\], got 1\.5\.$"),
        (call("in_range", "share", NAN, 0.0, 1.0), r"`share` must lie in \[0, 1\], got nan\.$"),
        (call("whole", "n", 0, low=1), r"`n` must be at least 1, got 0\.$"),
        (call("whole", "n", 9, low=1, high=8), r"`n` must be at least 1 and at most 8, got 9\.$"),
        (call("one_of", "filter", "madgwik", ["mahony", "madgwick"]), r"`filter` must be one of mahony, madgwick, got 'madgwik'; the nearest name is 'madgwick'\.$"),
        (call("one_of", "filter", "MEKF", ["mekf"]), r"; the nearest name is 'mekf'\.$"),
        (call("one_of", "filter", "zzz", ["mahony", "madgwick"]), r"got 'zzz'\.$"),
        (call("one_of", "filter", 3, ["mahony"]), r"got 3\.$"),
    ],
)  # fmt: skip
def test_value_is_refused_with_a_sentence(refused, message):
    with pytest.raises(ValueError, match=message):
        refused()


@pytest.mark.parametrize(
    ("refused", "message"),
    [
        (call("as_samples", "gyr", [["a", "b", "c"]]), r"`gyr` must hold real numbers, got dtype <U1\.$"),
        (call("as_samples", "gyr", [[None, 1.0, 2.0]]), r"`gyr` must hold real numbers, got dtype object\.$"),
        (call("as_samples", "gyr", [[1j, 0, 0]]), r"`gyr` must hold real numbers, got dtype complex128\.$"),
        (call("as_times", "t", np.array(["2024-01-01"], dtype="datetime64[s]")), r"`t` must hold real numbers, got dtype datetime64\[s\]\.$"),
        (call("positive", "kp", "2"), r"`kp` must be a number, got '2'\.$"),
        (call("finite", "x", None), r"`x` must be a number, got None\.$"),
        (call("finite", "x", 10**400), r"`x` must be a number, got 1000"),
        (call("whole", "n", 2.5), r"`n` must be a whole number, got 2\.5\.$"),
    ],
)  # fmt: skip
def test_other_things_than_numbers_are_refused(refused, message):
    with pytest.raises(TypeError, match=message):
        refused()
