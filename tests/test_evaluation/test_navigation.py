"""Navigation errors against pymap3d and closed forms."""

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from strapdown.errors import DataGap, MissingStream
from strapdown.evaluation import ErrorStatistics, navigation_errors
from strapdown.recording import AttitudeReference, PositionReference, Reference
from strapdown.solution import Solution, Status

PLACES = [(-60.0, 20.0), (-30.0, -70.0), (0.0, 0.0), (45.0, 7.0), (89.9, 120.0)]  # deg
MM = 1e-3


def moved(lla, ned):
    """Geodetic points `ned` metres from `lla`, by pymap3d."""
    lat, lon, h = pymap3d.ned2geodetic(*ned.T, *lla.T, deg=False)
    return np.stack((lat, lon, h), axis=-1)


def walk(n, lat_deg=45.0, lon_deg=7.0):
    """A track that starts at a place, some 10 m a second to the north-east."""
    ned = np.outer(np.arange(n) * 0.1, [7.0, 7.0, 0.3])
    start = np.broadcast_to([np.radians(lat_deg), np.radians(lon_deg), 100.0], ned.shape)
    return moved(start, ned)


def solution(t, lla, *, q_nb=None, **more):
    q_nb = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1)) if q_nb is None else q_nb
    more.setdefault("status", np.zeros(len(t), np.int64))
    return Solution(t=np.asarray(t, float), q_nb=q_nb, filter="test", lla=lla,
                    heading_reference="true", **more)  # fmt: skip


def clock(n):
    return np.arange(n) * 0.1


@pytest.mark.parametrize(("lat", "lon"), PLACES)
def test_position_errors_are_metres_north_east_down(lat, lon):
    n = 50
    truth = walk(n, lat, lon)
    off = np.random.default_rng(1).normal(scale=3.0, size=(n, 3))
    errors = navigation_errors(
        solution(clock(n), moved(truth, off)),
        Reference(position=PositionReference(t=clock(n), lla=truth)),
    )
    # ECEF coordinates carry 1e-9 m; the ground bends by 1e-6 m over these offsets
    assert errors.position_n == pytest.approx(off, abs=0.01 * MM)
    assert errors.vertical == pytest.approx(-off[:, 2], abs=0.01 * MM)
    assert errors.horizontal == pytest.approx(np.hypot(off[:, 0], off[:, 1]), abs=0.01 * MM)
    stats = errors.statistics()["horizontal"]
    assert stats.rmse == pytest.approx(np.sqrt(np.mean(off[:, 0] ** 2 + off[:, 1] ** 2)), rel=1e-5)


def test_there_is_no_step_at_the_antimeridian():
    n = 40
    truth = walk(n, 10.0, 179.9999)
    truth[:, 1] = np.mod(truth[:, 1] + np.pi, 2 * np.pi) - np.pi
    assert truth[0, 1] > 3
    assert truth[-1, 1] < -3  # crossed
    t_ref = clock(n - 1) + 0.05
    middle = walk(2 * n, 10.0, 179.9999)  # twice as long, every second is a midpoint
    half = moved(np.broadcast_to(middle[0], (n - 1, 3)), np.outer(t_ref, [7.0, 7.0, 0.3]))
    half[:, 1] = np.mod(half[:, 1] + np.pi, 2 * np.pi) - np.pi
    errors = navigation_errors(
        solution(clock(n), truth), Reference(position=PositionReference(t=t_ref, lla=half))
    )
    assert len(errors) == n - 1
    assert errors.horizontal.max() < 0.1 * MM


def test_a_lever_arm_moves_the_solution_to_the_antenna():
    n = 60
    rng = np.random.default_rng(2)
    attitude = Rotation.from_euler("ZYX", np.cumsum(0.02 * rng.normal(size=(n, 3)), axis=0))
    arm = np.array([1.2, -0.7, -1.5])
    imu = walk(n)
    antenna = moved(imu, attitude.apply(arm))
    sol = solution(clock(n), imu, q_nb=np.roll(attitude.as_quat(), 1, axis=1))
    ref = Reference(position=PositionReference(t=clock(n), lla=antenna))
    at_antenna = navigation_errors(sol, ref, lever_arm_b=arm)
    assert np.abs(at_antenna.position_n).max() < 0.01 * MM
    assert at_antenna.lever_arm_b.tolist() == arm.tolist()
    at_imu = navigation_errors(sol, ref)
    assert np.linalg.norm(at_imu.position_n, axis=1) == pytest.approx(
        np.linalg.norm(arm), abs=0.01 * MM
    )


def test_velocity_of_the_antenna_has_its_turning():
    n, rate = 200, 0.8  # rad/s about down
    t = np.arange(n) * 0.01
    yaw = Rotation.from_rotvec(np.outer(rate * t, [0, 0, 1]))
    arm = np.array([2.0, 0.0, 0.0])
    v_ref = rate * np.stack((-2 * np.sin(rate * t), 2 * np.cos(rate * t), 0 * t), axis=1)
    imu = np.tile(walk(2)[:1], (n, 1))
    ref = PositionReference(t=t, lla=moved(imu, yaw.apply(arm)), v_n=v_ref)
    sol = solution(t, imu, q_nb=np.roll(yaw.as_quat(), 1, axis=1), v_n=np.zeros((n, 3)))
    errors = navigation_errors(sol, Reference(position=ref), lever_arm_b=arm)
    assert errors.velocity.max() < 1e-9  # a constant rate: differences of attitude are exact


def test_velocity_errors_are_estimate_less_reference():
    n = 20
    truth = walk(n)
    v = np.random.default_rng(3).normal(size=(n, 3))
    errors = navigation_errors(
        solution(clock(n), truth, v_n=v + [0.3, -0.4, 1.2]),
        Reference(position=PositionReference(t=clock(n), lla=truth, v_n=v)),
    )
    assert errors.velocity_n == pytest.approx(np.tile([0.3, -0.4, 1.2], (n, 1)), abs=1e-14)
    assert errors.statistics()["velocity"].rmse == pytest.approx(1.3, abs=1e-14)
    assert errors.summary()["velocity_rmse_m_s"] == pytest.approx(1.3, abs=1e-14)


def test_samples_before_the_first_position_do_not_count():
    n = 30
    truth = walk(n)
    lla = truth.copy()
    lla[:8] = np.nan
    status = np.zeros(n, np.int64)
    status[:11] = Status.ALIGNING
    valid = np.ones(n, bool)
    valid[-4:] = False
    errors = navigation_errors(
        solution(clock(n), lla, status=status),
        Reference(position=PositionReference(t=clock(n), lla=truth, valid=valid)),
    )
    assert len(errors) == n - 11 - 4
    assert errors.left_out == {"reference not valid": 4, "solution without position yet": 11}


def test_share_within_3_sigma_is_that_of_the_rayleigh_distribution():
    n = 20_000
    sigma = np.tile([2.0, 0.5, 4.0], (n, 1))
    off = sigma * np.random.default_rng(4).normal(size=(n, 3))
    truth = np.tile(walk(2)[:1], (n, 1))
    errors = navigation_errors(
        solution(clock(n), moved(truth, off), std_position_n=sigma),
        Reference(position=PositionReference(t=clock(n), lla=truth)),
    )
    within = 1.0 - np.exp(-4.5)
    assert errors.horizontal_within_3sigma == pytest.approx(within, abs=0.0023)  # 3 std. errors
    assert errors.std_position_n.shape == (n, 3)


def test_attitude_errors_come_along_where_they_overlap():
    n = 20
    truth = walk(n)
    level = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
    position = PositionReference(t=clock(n), lla=truth)
    both = Reference(position=position, attitude=AttitudeReference(t=clock(n), q_nb=level))
    errors = navigation_errors(solution(clock(n), truth), both)
    assert errors.attitude is not None
    assert errors.attitude.total.max() == 0.0
    assert {"horizontal_rmse_m", "vertical_rmse_m", "total_rmse_deg"} <= set(errors.summary())
    later = Reference(position=position, attitude=AttitudeReference(t=clock(n) + 99, q_nb=level))
    assert navigation_errors(solution(clock(n), truth), later).attitude is None


def test_what_lacks_a_position_is_refused():
    truth = walk(3)
    attitude_only = Solution(t=clock(3), q_nb=np.tile([1.0, 0, 0, 0], (3, 1)),
                             status=np.zeros(3, np.int64), filter="test")  # fmt: skip
    position = Reference(position=PositionReference(t=clock(3), lla=truth))
    with pytest.raises(MissingStream, match="need a solution with position"):
        navigation_errors(attitude_only, position)
    with pytest.raises(MissingStream, match="need a reference with position"):
        navigation_errors(solution(clock(3), truth), Reference())


def test_no_overlap_is_refused_with_the_reason():
    position = PositionReference(t=clock(3) + 50, lla=walk(3))
    with pytest.raises(DataGap, match="no reference sample counts of 3: 3 outside the span"):
        navigation_errors(solution(clock(3), walk(3)), Reference(position=position))


def test_statistics_of_nothing_are_refused():
    with pytest.raises(ValueError, match="at least one sample"):
        ErrorStatistics.of([])
    assert ErrorStatistics.of([-3.0, 4.0]).rmse == pytest.approx(np.sqrt(12.5), rel=1e-15)
