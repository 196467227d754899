"""Attitude errors against SciPy and closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.errors import DataGap, MissingStream
from strapdown.evaluation import attitude_errors, robust_circular_mean
from strapdown.recording import AttitudeReference, MountReference, PositionReference, Reference
from strapdown.solution import Solution, Status
from strapdown.units import DEG

NED_FROM_ENU = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])


def quats(rotation):
    """(w, x, y, z) of a SciPy rotation."""
    return np.roll(np.atleast_2d(rotation.as_quat()), 1, axis=1)


def solution(t, rotation, *, heading="magnetic", status=None, **more):
    status = np.zeros(len(t), np.int64) if status is None else status
    return Solution(
        t=np.asarray(t),
        q_nb=quats(rotation),
        status=status,
        filter="test",
        heading_reference=heading,
        **more,
    )


def reference(t, rotation, *, heading="magnetic", **more):
    return Reference(
        attitude=AttitudeReference(t=t, q_nb=quats(rotation), **more), heading=heading
    )


def clock(n, rate=100.0):
    return np.arange(n) / rate


def wandering(n, seed=0):
    """Attitudes all over the sphere."""
    return Rotation.random(n, rng=np.random.default_rng(seed))


def test_errors_are_those_that_broad_defines_in_enu():
    n = 500
    q_ref, q_est = wandering(n, 1), wandering(n, 2)
    _, _, z, w = (q_est * q_ref.inv()).as_quat().T  # both taken as sensor -> ENU
    errors = attitude_errors(
        solution(clock(n), NED_FROM_ENU * q_est), reference(clock(n), NED_FROM_ENU * q_ref)
    )
    # arccos and arctan of the definition lose half of the digits at their ends
    assert errors.total == pytest.approx(2 * np.arccos(np.abs(w)), abs=1e-7)
    assert np.abs(errors.heading) == pytest.approx(2 * np.arctan(np.abs(z / w)), abs=1e-12)
    assert errors.inclination == pytest.approx(2 * np.arccos(np.sqrt(w * w + z * z)), abs=1e-7)


def test_heading_error_is_positive_when_turned_clockwise_too_far():
    q_ref = Rotation.from_euler("ZYX", [2.9, 0.3, -0.7])  # yaw, pitch, roll
    q_est = Rotation.from_rotvec([0, 0, 20 * DEG]) * q_ref  # about down; crosses +-180 deg
    errors = attitude_errors(solution([0.0], q_est), reference([0.0], q_ref))
    assert errors.heading / DEG == pytest.approx([20.0], abs=1e-12)
    assert errors.rpy[0] / DEG == pytest.approx([0.0, 0.0, 20.0], abs=1e-12)
    assert errors.inclination[0] < 1e-15


def test_tilt_is_resolved_about_north_and_east_of_the_estimate():
    q_ref = Rotation.from_euler("ZYX", [2.0, 0.3, -0.7])
    turn = Rotation.from_rotvec([2 * DEG, -3 * DEG, 0]) * Rotation.from_rotvec([0, 0, 70 * DEG])
    errors = attitude_errors(solution([0.0], turn * q_ref), reference([0.0], q_ref))
    assert errors.tilt_n[0] / DEG == pytest.approx([2.0, -3.0], abs=1e-12)
    assert errors.heading[0] / DEG == pytest.approx(70.0, abs=1e-12)
    assert errors.inclination[0] / DEG == pytest.approx(np.hypot(2, 3), abs=1e-12)


def test_upside_down_is_seen():
    q_ref = Rotation.from_euler("ZYX", [1.0, 0.2, 0.1])
    errors = attitude_errors(
        solution([0.0], Rotation.from_rotvec([np.pi, 0, 0]) * q_ref), reference([0.0], q_ref)
    )
    assert errors.inclination[0] == pytest.approx(np.pi, abs=1e-15)
    assert errors.total[0] == pytest.approx(np.pi, abs=1e-15)


@pytest.mark.parametrize("size", [1e-5, 1e-9, 1e-13])
def test_tiny_errors_keep_their_digits(size):
    n = 50
    q_ref = wandering(n, 3)
    tilt = Rotation.from_rotvec(np.tile([0.6 * size, 0.8 * size, 0.0], (n, 1)))
    errors = attitude_errors(solution(clock(n), tilt * q_ref), reference(clock(n), q_ref))
    # a product of unit quaternions is off by some eps: relative to the error, eps / size
    allowed = 1e-6 + 8 * np.finfo(float).eps / size
    assert errors.total / size == pytest.approx(1.0, abs=allowed)
    assert errors.inclination / size == pytest.approx(1.0, abs=allowed)


def test_an_estimate_that_is_the_reference_has_no_error_but_round_off():
    q_ref = wandering(200, 4)
    errors = attitude_errors(solution(clock(200), q_ref), reference(clock(200), q_ref))
    assert errors.total.max() < 4e-16  # sums in another order
    # the sign of a quaternion means nothing
    sol = solution(clock(200), q_ref)
    flipped = Solution(t=sol.t, q_nb=-sol.q_nb, status=sol.status, filter="test",
                       heading_reference="magnetic")  # fmt: skip
    assert attitude_errors(flipped, reference(clock(200), q_ref)).total.max() < 4e-16


def test_the_solution_is_interpolated_to_the_references_own_times():
    axis = np.array([0.3, -0.5, 0.81]) / np.linalg.norm([0.3, -0.5, 0.81])

    def attitude(t):  # constant rate: slerp is exact
        return Rotation.from_rotvec(np.outer(2.0 * t, axis)) * Rotation.from_euler("x", 0.4)

    t, t_ref = clock(1000), 0.0031 + clock(370, 37.0)
    errors = attitude_errors(
        solution(t, attitude(t)), reference(t_ref, attitude(t_ref)), max_gap=0.05
    )
    assert len(errors) == np.count_nonzero(t_ref <= t[-1])
    assert errors.total.max() < 1e-13  # round-off of an angle of 20 rad and some products
    shifted = attitude_errors(
        solution(t, attitude(t)), reference(t_ref, attitude(t_ref + 0.002)), max_gap=0.05
    )
    assert shifted.total == pytest.approx(2.0 * 0.002, abs=1e-12)  # rate times delay


def test_only_samples_that_count_are_used():
    n = 100
    q_ref = wandering(n, 5)
    q_est = Rotation.from_rotvec([0, 0, 1 * DEG]) * q_ref
    status = np.zeros(n, np.int64)
    status[:10] = Status.ALIGNING
    status[40:60] = Status.MAG_REJECTED  # counts
    valid = np.ones(n, bool)
    valid[20:25] = False
    q = quats(q_ref)
    q[30] = np.nan
    part = AttitudeReference(t=clock(n) + 0.0, q_nb=q, valid=valid)
    errors = attitude_errors(solution(clock(n), q_est, status=status), part)
    assert len(errors) == n - 10 - 5 - 1
    assert errors.left_out == {"reference not valid": 6, "solution still aligning": 10}
    assert errors.heading / DEG == pytest.approx(1.0, abs=1e-12)


def test_times_outside_and_in_gaps_do_not_count():
    q = wandering(4, 6)
    t = np.array([1.0, 1.1, 4.0, 4.1])
    t_ref = np.array([0.5, 1.0, 2.0, 4.0, 4.1, 5.0])
    errors = attitude_errors(solution(t, q), reference(t_ref, wandering(6, 7)))
    assert errors.t.tolist() == [1.0, 4.0, 4.1]
    assert errors.left_out == {
        "outside the span of the solution": 2,
        "in a gap of the solution": 1,
    }


# --- heading ----------------------------------------------------------------------------


@pytest.mark.parametrize("offset_deg", [-179.5, -30.0, 0.0, 91.0, 179.8])
@pytest.mark.parametrize("who", ["solution", "reference"])
def test_one_constant_is_taken_from_an_arbitrary_heading(offset_deg, who):
    n = 400
    rng = np.random.default_rng(8)
    noise = rng.normal(scale=1.0, size=n) * DEG
    noise -= noise.mean()
    q_ref = wandering(n, 9)
    yaw = np.outer(offset_deg * DEG + noise, [0, 0, 1])
    tilt = Rotation.from_rotvec([0.5 * DEG, 0, 0])
    q_est = Rotation.from_rotvec(yaw) * tilt * q_ref
    errors = attitude_errors(
        solution(clock(n), q_est, heading="arbitrary" if who == "solution" else "true"),
        reference(clock(n), q_ref, heading="arbitrary" if who == "reference" else "true"),
    )
    assert errors.heading_removed
    # a sample or two may lie beyond 3 deviations; leaving them out moves the mean this much
    assert errors.heading == pytest.approx(noise, abs=0.02 * DEG)
    left = errors.heading_constant / DEG - offset_deg
    assert (left + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.02)
    assert errors.inclination / DEG == pytest.approx(0.5, abs=1e-12)
    assert errors.total == pytest.approx(
        (Rotation.from_rotvec(np.outer(errors.heading, [0, 0, 1])) * tilt).magnitude(), abs=1e-12
    )
    assert "constant" in errors.heading_note
    assert "arbitrary" in errors.heading_note


def test_yaw_loses_the_same_constant_as_heading():
    n = 200
    yaw = np.linspace(-3, 3, n)
    q_ref = Rotation.from_euler("ZYX", np.stack((yaw, 0.2 * np.cos(yaw), 0.3 * yaw), axis=1))
    q_est = Rotation.from_rotvec([0, 0, 100 * DEG]) * q_ref
    errors = attitude_errors(solution(clock(n), q_est, heading="arbitrary"),
                             reference(clock(n), q_ref))  # fmt: skip
    assert errors.rpy == pytest.approx(0.0, abs=1e-12)


def test_a_known_heading_keeps_its_offset_unless_asked():
    q_ref = wandering(50, 10)
    sol = solution(clock(50), Rotation.from_rotvec([0, 0, 5 * DEG]) * q_ref)
    ref = reference(clock(50), q_ref)
    kept = attitude_errors(sol, ref)
    assert kept.heading / DEG == pytest.approx(5.0, abs=1e-12)
    assert (kept.heading_removed, kept.heading_constant) == (False, 0.0)
    assert "nothing was taken" in kept.heading_note
    asked = attitude_errors(sol, ref, remove_heading=True)
    assert asked.heading == pytest.approx(0.0, abs=1e-14)
    assert asked.heading_constant / DEG == pytest.approx(5.0, abs=1e-12)
    assert asked.heading_note.startswith("As asked")


def test_different_norths_are_pointed_out():
    q_ref = wandering(5, 11)
    errors = attitude_errors(
        solution(clock(5), q_ref, heading="magnetic"),
        reference(clock(5), q_ref, heading="true"),
    )
    assert "declination" in errors.heading_note
    free = attitude_errors(solution(clock(5), q_ref, heading="arbitrary"),
                           reference(clock(5), q_ref), remove_heading=False)  # fmt: skip
    assert "no constant" in free.heading_note


def test_the_circular_mean_ignores_a_lost_stretch_and_keeps_a_drift():
    rng = np.random.default_rng(12)
    clean = 3.1 + 0.01 * rng.normal(size=2000)  # across the wrap
    lost = np.concatenate((clean, rng.uniform(-np.pi, np.pi, 200)))
    # standard error of 2000 samples is 2.2e-4
    assert robust_circular_mean(np.mod(lost + np.pi, 2 * np.pi) - np.pi) == pytest.approx(
        3.1, abs=1e-3
    )
    drift = np.linspace(0.2, 0.9, 1001)
    assert robust_circular_mean(drift) == pytest.approx(0.55, abs=1e-12)
    assert robust_circular_mean(np.full(9, -2.5)) == pytest.approx(-2.5, abs=1e-15)


# --- mount ------------------------------------------------------------------------------


def test_roll_pitch_yaw_are_the_vehicles_where_the_mount_is_known():
    n = 30
    rpy = np.stack((np.full(n, 0.05), np.linspace(-0.1, 0.1, n), np.linspace(-3, 3, n)), axis=1)
    q_nv = Rotation.from_euler("ZYX", rpy[:, ::-1])
    q_vb = Rotation.from_euler("ZYX", [1.3, 80 * DEG, np.pi])  # box stands on its edge
    off = np.array([1.0, -0.5, 2.0]) * DEG
    estimate = Rotation.from_euler("ZYX", (rpy + off)[:, ::-1]) * q_vb
    attitude = AttitudeReference(t=clock(n), q_nb=quats(q_nv * q_vb))
    mount = MountReference(
        t=[-5.0, 0.1],
        q_vb=quats(Rotation.concatenate([Rotation.identity(), q_vb])),
        valid=[False, True],  # not yet known at first
    )
    errors = attitude_errors(
        solution(clock(n), estimate), Reference(attitude=attitude, mount=mount, heading="magnetic")
    )
    assert errors.axes == "vehicle"
    assert errors.rpy / DEG == pytest.approx(np.tile([1.0, -0.5, 2.0], (n, 1)), abs=1e-10)
    alone = attitude_errors(solution(clock(n), estimate), attitude)
    assert alone.axes == "body"
    assert alone.total == pytest.approx(errors.total, abs=0)  # a mount turns both alike


def test_where_both_know_a_mount_the_vehicles_attitudes_are_compared():
    n = 30
    q_nv = wandering(n)
    own = Rotation.from_euler("ZYX", [1.3, 80 * DEG, np.pi])
    stated = Rotation.from_euler("Z", 25 * DEG) * own  # the reference's mount is wrong
    off = Rotation.from_rotvec([0.0, 0.0, 0.7 * DEG])
    found = np.arange(n) >= 10
    q_vb = quats(Rotation.concatenate([own] * n))
    q_vb[~found] = [1.0, 0.0, 0.0, 0.0]  # as before the mount is found
    errors = attitude_errors(
        solution(clock(n), off * q_nv * own, q_vb=q_vb, std_attitude_n=np.ones((n, 3))),
        Reference(
            attitude=AttitudeReference(t=clock(n), q_nb=quats(q_nv * stated)),
            mount=MountReference(t=[0.0], q_vb=quats(stated)),
            heading="magnetic",
        ),
    )
    assert errors.through_own_mount
    assert errors.axes == "vehicle"
    assert errors.left_out == {"mount not found yet": 10}
    assert errors.heading / DEG == pytest.approx(np.full(20, 0.7), abs=1e-10)
    assert errors.inclination / DEG == pytest.approx(np.zeros(20), abs=1e-5)
    assert errors.std_n is None  # what is stated is of the box
    summary = errors.summary()
    assert summary["heading_rmse_deg"] == pytest.approx(0.7)
    assert summary["heading_std_deg"] == pytest.approx(0.0, abs=1e-10)
    assert summary["inclination_within_3sigma"] is None


# --- standard deviations ----------------------------------------------------------------


def test_sigma_figures_of_honest_noise_are_those_of_the_rayleigh_distribution():
    n = 40_000
    rng = np.random.default_rng(13)
    sigma = np.array([0.2, 0.5, 3.0]) * DEG * rng.uniform(0.5, 2.0, size=(n, 1))
    error = Rotation.from_rotvec(sigma * rng.normal(size=(n, 3)))
    q_ref = wandering(n, 14)
    sol = solution(clock(n), error * q_ref, std_attitude_n=sigma)
    errors = attitude_errors(sol, reference(clock(n), q_ref))
    within = 1.0 - np.exp(-4.5)  # of two degrees of freedom
    # three standard errors of a share of n
    assert errors.inclination_within_3sigma == pytest.approx(within, abs=0.0016)
    needed = np.sqrt(-2.0 * np.log(0.03))  # holds 97 %
    assert errors.inclination_sigma_ratio == pytest.approx(3.0 / needed, rel=0.015)

    timid = attitude_errors(
        solution(clock(n), error * q_ref, std_attitude_n=2.0 * sigma), reference(clock(n), q_ref)
    )
    assert timid.inclination_sigma_ratio == pytest.approx(
        2.0 * errors.inclination_sigma_ratio, rel=1e-12
    )
    assert timid.inclination_within_3sigma > 0.999


def test_without_stated_sigma_there_is_no_share():
    errors = attitude_errors(solution([0.0], wandering(1)), reference([0.0], wandering(1)))
    assert errors.inclination_within_3sigma is None
    assert errors.inclination_sigma_ratio is None
    assert errors.std_n is None


def test_a_sigma_of_zero_holds_no_error_but_that_of_zero():
    q_ref = wandering(2, 15)
    tilt = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0]])
    errors = attitude_errors(
        solution([0.0, 1.0], tilt * q_ref, std_attitude_n=np.zeros((2, 3))),
        reference([0.0, 1.0], q_ref),
    )
    assert errors.inclination_within_3sigma in (0.0, 0.5)  # the first is zero but for round-off
    assert errors.summary()["inclination_sigma_ratio"] in (None, 0.0)


# --- summary and refusals ---------------------------------------------------------------


def test_summary_is_in_degrees_and_statistics_are_those_of_numpy():
    n = 1000
    rng = np.random.default_rng(16)
    heading = 4 * DEG * rng.normal(size=n)
    q_ref = wandering(n, 17)
    q_est = Rotation.from_rotvec(np.outer(heading, [0, 0, 1])) * q_ref
    errors = attitude_errors(solution(clock(n), q_est), reference(clock(n), q_ref))
    summary = errors.summary()
    rms = np.sqrt(np.mean((heading / DEG) ** 2))
    assert summary["heading_rmse_deg"] == pytest.approx(rms, rel=1e-12)
    assert summary["total_rmse_deg"] == pytest.approx(rms, rel=1e-12)
    assert summary["inclination_rmse_deg"] < 1e-12
    assert summary["samples"] == n
    stats = errors.statistics()["heading"]
    size = np.abs(heading)
    assert stats.median == pytest.approx(np.median(size), rel=1e-12)
    assert stats.p95 == pytest.approx(np.percentile(size, 95), rel=1e-12)
    assert stats.maximum == pytest.approx(size.max(), rel=1e-12)
    assert set(errors.statistics()) == {"total", "heading", "inclination", "roll", "pitch", "yaw"}


def test_inputs_stay_as_they_are():
    q_ref = wandering(20, 18)
    sol, ref = solution(clock(20), q_ref, heading="arbitrary"), reference(clock(20), q_ref)
    before = sol.q_nb.copy(), ref.attitude.q_nb.copy()
    attitude_errors(sol, ref)
    assert np.array_equal(sol.q_nb, before[0])
    assert np.array_equal(ref.attitude.q_nb, before[1])


def test_a_reference_without_attitude_is_refused():
    position = PositionReference(t=[0.0], lla=[[0.1, 0.2, 3.0]])
    with pytest.raises(MissingStream, match="need a reference with attitude"):
        attitude_errors(solution([0.0], wandering(1)), Reference(position=position))


def test_no_sample_that_counts_is_refused_with_the_reasons():
    status = np.array([0, Status.ALIGNING])
    sol = solution([0.0, 0.1], wandering(2), status=status)
    ref = reference([0.05, 0.1, 7.0], wandering(3))
    with pytest.raises(
        DataGap, match=r"no reference sample counts of 3: 1 outside .*, 2 solution still aligning"
    ):
        attitude_errors(sol, ref)
