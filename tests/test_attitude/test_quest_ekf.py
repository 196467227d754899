"""The filter of rates and quaternion as a whole: what it finds, and where its variants differ."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are
from scipy.spatial.transform import Rotation
from truth import hand, streams
from truth.matched import Sizes, draw

from strapdown.attitude import QuestEkf
from strapdown.recording import Imu, Mag, Recording
from strapdown.simulation import demo
from strapdown.solution import Status

G = 9.80665
DEG = np.pi / 180
DIP = np.arctan2(43.0, 21.0)  # of truth.hand


def still(seconds, rate=(0.0, 0.0, 0.0), acc_n=(0.0, 0.0, -G)):
    """A box at rest for a long time, as its sensors see it."""
    t = np.arange(round(100 * seconds)) / 100
    return Recording(
        imu=Imu(t=t, gyr=np.tile(rate, (len(t), 1)), acc=np.tile(acc_n, (len(t), 1))),
        mag=Mag(t=t, mag=np.tile(hand.FIELD_N, (len(t), 1))),
    )


@pytest.mark.parametrize("measurements", ["quest", "vectors"])
@pytest.mark.parametrize("dip", [None, DIP])
def test_a_bias_shows_as_the_steady_state_says(measurements, dip):
    """SciPy's Riccati equation of a random walk of three angles, seen in white noise."""
    bias = np.array([2e-4, -1e-4, 3e-4])
    flt = QuestEkf(measurements=measurements, dip=dip, rate_std=100.0)
    sol = flt.run(still(300.0, bias), diagnostics=False)
    off = Rotation.from_quat(sol.q_nb[-1, [1, 2, 3, 0]]).as_rotvec()
    rows = [[1, 0, 0], [0, 1, 0], [np.sin(DIP), 0, -np.cos(DIP)], [0, 1, 0]]
    H = np.array(rows[: 3 if dip is None else 4], dtype=float)
    r_d, r_m = (flt.acc_noise / G) ** 2, flt.mag_noise**2
    R = np.diag([r_d, r_d, r_m, r_m][: len(H)])
    P = solve_continuous_are(np.zeros((3, 3)), H.T, flt.gyr_noise**2 * np.eye(3), R)
    want = np.linalg.solve(P @ H.T @ np.linalg.solve(R, H), bias)
    # errors of heading live 28 s; the angles are 0.01, so that second orders are 1 % of them
    np.testing.assert_allclose(off, want, rtol=0.02)


def test_rates_are_found_better_than_they_are_measured():
    sizes = Sizes(gyr_noise=0.05, rate_time=1.0, seconds=20.0)
    rec, _, omega, _, _ = draw(sizes, 1)
    flt = QuestEkf(gyr_noise=0.05, rate_std=1.0, rate_time=1.0)
    state, found = flt.init(), []
    for t, gyr, acc in zip(rec.imu.t, rec.imu.gyr, rec.imu.acc, strict=True):
        state = flt.step(state, t, gyr, acc)
        found.append(flt.rate(state))
    measured = np.sqrt(np.mean((rec.imu.gyr - omega) ** 2))
    rms = np.sqrt(np.mean((np.array(found) - omega) ** 2))
    # scalar Riccati equation: prediction error p, gain p / (p + r)
    a2, r = np.exp(-2 / 50), 0.05**2 * 50
    p = 1.0
    for _ in range(1000):
        p = a2 * p * r / (p + r) + 1 - a2
    assert measured == pytest.approx(np.sqrt(r), rel=0.05)  # 3000 draws: 1.3 % are one sigma
    assert rms == pytest.approx(np.sqrt(p * r / (p + r)), rel=0.05)
    assert rms < 0.75 * measured


def test_seven_and_nine_measurements_agree_to_first_order():
    """The same noise makes both the same filter; what differs is of second order in its errors."""
    rec = demo.recording(duration=30.0)
    seven, nine = (
        QuestEkf(measurements=name, gate=np.inf).run(rec) for name in ("quest", "vectors")
    )
    apart = hand.degrees_off(seven.q_nb, Rotation.from_quat(nine.q_nb[:, [1, 2, 3, 0]]))
    off = hand.degrees_off(
        seven.q_nb, Rotation.from_quat(rec.reference.attitude.q_nb[:, [1, 2, 3, 0]])
    )
    print(f"apart by {apart.max():.3f} deg, off by up to {off.max():.2f} deg")
    assert 0.0 < apart.max() < 0.1 * off.max()


@pytest.mark.parametrize("measurements", ["quest", "vectors"])
def test_field_of_known_dip_holds_the_tilt_against_an_acceleration(measurements):
    """Ten seconds of 1 m/s^2 to the north are a tilt of 5.8 deg; the dip tells, if it is given."""
    rec = still(10.0, acc_n=(1.0, 0.0, -G))
    tilt = {}
    for dip in (None, DIP):
        flt = QuestEkf(measurements=measurements, dip=dip)
        sol, _ = flt.advance(flt.init(attitude=[1.0, 0, 0, 0]), rec, diagnostics=False)
        tilt[dip] = abs(sol.rpy[-1, 1])
    assert tilt[None] > 3.0 * DEG
    # shares of 1 / r: gravity (g / 1.5)^2, field (1 / 0.25)^2: the pull falls to 0.73
    share = (G / 1.5) ** 2 / ((G / 1.5) ** 2 + 16.0)
    assert tilt[DIP] == pytest.approx(share * 5.82 * DEG, rel=0.25)
    assert tilt[DIP] < tilt[None]


def test_vertical_field_is_said_and_gives_no_heading():
    rec = still(2.0)
    rec = Recording(imu=rec.imu, mag=Mag(t=rec.mag.t, mag=np.tile([0.0, 0.0, 5e-5], (200, 1))))
    flt = QuestEkf()
    sol, _ = flt.advance(flt.init(attitude=[1.0, 0, 0, 0]), rec)
    assert np.all(sol.status[1:] & Status.MAG_REJECTED)  # the first sample has no interval
    assert np.isfinite(sol.q_nb).all()
    assert sol.std_attitude_n[-1, 2] > sol.std_attitude_n[0, 2]


def test_printed_order_lags_by_one_interval():
    """A turn about down at 1 rad/s, 10 Hz, a sure gyroscope: 0.1 rad, and Euler's 1e-4 a turn."""
    t = np.arange(30) / 10
    rec = Recording(
        imu=Imu(t=t, gyr=np.outer(t > 0.95, [0, 0, 1.0]), acc=np.tile([0, 0, -G], (30, 1)))
    )
    sure = dict(gyr_noise=1e-5, rate_std=10.0)
    yaw = {
        name: QuestEkf(integration=name, **sure).run(rec).rpy[-1, 2]
        for name in ("corrected", "printed")
    }
    assert yaw["corrected"] == pytest.approx(2.0, abs=1e-6)
    assert yaw["printed"] == pytest.approx(1.9, abs=20 * 1e-3 / 12)  # a^3 / 12 short at each turn


VARIANTS = [
    {"measurements": "vectors"}, {"dip": DIP}, {"measurements": "vectors", "dip": DIP},
    {"integration": "printed"}, {"integration": "printed", "dip": DIP},
]  # fmt: skip


@pytest.mark.parametrize("parameters", VARIANTS, ids=str)
def test_variants_too_give_the_bits_of_run_sample_by_sample(parameters):
    flt, rec = QuestEkf(**parameters), streams.rough_log()
    state, states = flt.init(), []
    for sample in streams.samples(rec):
        state = flt.step(state, *sample)
        states.append(state)
    streams.assert_same_bits(flt.run(rec), streams.collect(states))


@pytest.mark.parametrize("parameters", VARIANTS, ids=str)
def test_variants_too_stay_finite_in_noise_without_sense(parameters):
    rng = np.random.default_rng(2)
    t = np.cumsum(10.0 ** rng.uniform(-6, 1, 3000))
    wild = [10.0 ** rng.uniform(-8, 8, (3000, 1)) * rng.standard_normal((3000, 3)) for _ in "gam"]
    for array in wild:
        array[rng.random(3000) < 0.1] = np.nan
        array[rng.random(3000) < 0.1] = 0.0
    rec = Recording(imu=Imu(t=t, gyr=wild[0], acc=wild[1]), mag=Mag(t=t, mag=wild[2]))
    flt = QuestEkf(**parameters)
    sol, state = flt.advance(flt.init(), rec)
    assert np.isfinite(sol.q_nb).all()
    assert np.isfinite(sol.std_attitude_n).all()
    np.testing.assert_allclose(np.linalg.norm(sol.q_nb, axis=1), 1.0, rtol=0, atol=1e-12)
    assert np.isfinite(state.x).sum() == len(state.x)
    assert np.isfinite(state.P).all()


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("gyr_noise", 0.0), ("acc_noise", -1.0), ("mag_noise", 0.0), ("rate_std", 0.0),
        ("rate_time", 0.0), ("std_tilt", 0.0), ("std_heading", 0.0), ("gravity", -9.8),
        ("gap_rate", -1.0), ("gate", 0.0),
    ],
)  # fmt: skip
def test_sizes_must_be_positive(name, bad):
    with pytest.raises(ValueError, match=rf"`{name}` must be (positive|non-negative)"):
        QuestEkf(**{name: bad})


def test_parameters_out_of_range_are_refused():
    with pytest.raises(ValueError, match=r"`measurements` must be one of quest, vectors"):
        QuestEkf(measurements="nine")
    with pytest.raises(ValueError, match=r"`integration` must be one of corrected, printed"):
        QuestEkf(integration="euler")
    with pytest.raises(ValueError, match=r"`dip` must lie in \[-1.5, 1.5\], got 1.57"):
        QuestEkf(dip=1.57)


def test_rate_is_that_of_its_own_states():
    flt = QuestEkf()
    assert np.array_equal(flt.rate(flt.init()), np.zeros(3))
    from strapdown.attitude import Mekf

    with pytest.raises(ValueError, match="`state` must belong to quest-ekf, got one of mekf"):
        flt.rate(Mekf().init())
