"""The indirect EKF as a whole: both scenarios of its source, both propagations, consistency."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from truth import hand, streams

from strapdown.attitude import IndirectEkf
from strapdown.recording import Imu, Mag, Recording, Star
from strapdown.solution import Status

G = 9.80665
DEG = np.pi / 180
FIELD_N = np.array([2.25e-5, 0.0, 4.18e-5])  # Padova, spec A 2.7.8
ACCELERATION = 0.1551  # rad/s^2, spec A 4.1
STEP = 0.09 * DEG


def platform(rate_hz, seed, bias=(0.0, 0.0, 0.0)):
    """Rest for 50 s, then 2.5 s of yaw acceleration and as long of braking; the gyro samples."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(55.0 * rate_hz)) / rate_hz
    u = np.clip(t - 50.0, 0.0, 5.0)
    rate = ACCELERATION * np.where(u < 2.5, u, 5.0 - u)
    yaw = ACCELERATION * np.where(u < 2.5, u**2 / 2, 6.25 - (5.0 - u) ** 2 / 2)
    r_nb = Rotation.from_euler("Z", yaw[:, None])
    white = np.sqrt(rate_hz) * rng.standard_normal((3, len(t), 3))
    gyr = np.outer(rate, [0, 0, 1]) + bias + 8.2e-3 * DEG * white[0]
    acc = r_nb.inv().apply([0, 0, -G]) + 3.0e-4 * G * white[1]
    mag = r_nb.inv().apply(FIELD_N) + 1.5e-8 * white[2]
    each = round(3.0 * rate_hz)
    seen = Rotation.from_euler("Z", STEP * np.round(yaw[::each, None] / STEP))
    return (
        Recording(
            imu=Imu(t=t, gyr=gyr, acc=acc),
            mag=Mag(t=t, mag=mag),
            star=Star(t=t[::each], q_nb=hand.scalar_first(seen)),
        ),
        r_nb,
    )


def error(sol, r_nb):
    """Rotation vector of the attitude error in b."""
    return (Rotation.from_quat(sol.q_nb[:, [1, 2, 3, 0]]).inv() * r_nb).as_rotvec()


def ground(**parameters):
    return IndirectEkf.terrestrial(
        mag_reference=(FIELD_N[0], FIELD_N[2]), mag_factor=1.0, **parameters
    )


@pytest.mark.parametrize("rate_hz", [10.0, 20.0, 50.0, 100.0])
@pytest.mark.parametrize("scenario", ["space", "terrestrial"])
def test_truncated_propagation_differs_by_less_than_2e_4(scenario, rate_hz):
    """In the RMS of the yaw error over the manoeuvre, relative."""
    rec, r_nb = platform(rate_hz, seed=1)
    if scenario == "terrestrial":
        rec = Recording(imu=rec.imu, mag=rec.mag)
    rms = []
    for propagation in ("exact", "truncated"):
        make = IndirectEkf.space if scenario == "space" else ground
        off = error(make(propagation=propagation).run(rec, diagnostics=False), r_nb)
        rms.append(np.sqrt(np.mean(off[rec.imu.t >= 50.0, 2] ** 2)))
    print(f"{scenario} {rate_hz} Hz: {rms[0]:.3e} rad, relative {abs(rms[1] / rms[0] - 1):.1e}")
    assert rms[0] != rms[1]
    assert abs(rms[1] / rms[0] - 1.0) < 2e-4


def test_space_scenario_keeps_half_a_degree_and_half_a_degree_per_second():
    """The requirement of the source, at 100 Hz with a star tracker every 3 s."""
    rec, r_nb = platform(100.0, seed=2)
    flt = IndirectEkf.space()
    sol = flt.run(rec)
    assert np.abs(error(sol, r_nb)).max() < 0.5 * DEG
    u = rec.imu.t - 50.0
    truth = ACCELERATION * np.where(u < 0, 0, np.where(u < 2.5, u, 5.0 - u))
    off = flt.rate(rec, sol) - np.outer(truth, [0, 0, 1])
    assert np.sqrt(np.mean(off**2, axis=0)).max() < 0.5 * DEG
    assert sol.heading_reference == "true"


def test_space_scenario_does_without_accelerometer_and_field():
    rec, _ = platform(10.0, seed=3)
    blind = Recording(
        imu=Imu(t=rec.imu.t, gyr=rec.imu.gyr, acc=np.full_like(rec.imu.acc, np.nan)), star=rec.star
    )
    whole, sol = IndirectEkf.space().run(rec), IndirectEkf.space().run(blind)
    assert np.array_equal(whole.q_nb, sol.q_nb)
    assert np.array_equal(whole.status, sol.status)
    without = IndirectEkf.space().run(Recording(imu=rec.imu))
    assert np.all(without.status & Status.ALIGNING)
    assert np.array_equal(without.q_nb[-1], [1, 0, 0, 0])
    assert without.heading_reference == "arbitrary"


def test_star_tracker_alone_finds_the_bias_and_the_first_bias_is_a_parameter():
    bias = np.array([2e-4, -3e-4, 1e-4])  # 0.01 deg/s, three sigma of the space scenario's start
    rec, _ = platform(50.0, seed=4, bias=bias)
    sol = IndirectEkf.space().run(rec)
    assert np.abs(sol.gyr_bias[-1] - bias).max() < 4 * sol.std_gyr_bias[-1].max()
    assert np.abs(sol.gyr_bias[-1] - bias).max() < 0.3 * np.abs(bias).max()
    told = IndirectEkf.space(gyr_bias=tuple(bias))
    assert np.array_equal(told.init().gyr_bias, bias)


def test_star_corrects_among_the_other_sensors_in_every_way_of_running():
    """Run, pieces and steps agree to the last bit with a star tracker too."""
    t = np.arange(1200) / 100
    r_nb, gyr, acc, mag = hand.sensors(t, rest=1.0)
    rec = Recording(
        imu=Imu(t=t, gyr=gyr + [0.01, 0.0, -0.01], acc=acc),
        mag=Mag(t=t[::4], mag=mag[::4]),
        star=Star(t=t[5::97] - 0.003, q_nb=hand.scalar_first(r_nb[5::97])),
    )
    flt = IndirectEkf()
    whole = flt.run(rec)
    without = flt.run(Recording(imu=rec.imu, mag=rec.mag))
    worst = hand.degrees_off(whole.q_nb, r_nb)[600:].max()
    assert worst < 0.5 * hand.degrees_off(without.q_nb, r_nb)[600:].max()
    state, parts = flt.init(), []
    for start, stop in ((0.0, 0.96), (0.96, 3.5), (3.5, 99.0)):
        sol, state = flt.advance(state, rec.between(start, stop))
        parts.append(sol.q_nb)
    assert np.array_equal(np.concatenate(parts), whole.q_nb)
    state, states, j = flt.init(), [], 0
    for i in range(len(t)):
        aiding = {}
        while j < len(rec.star) and rec.star.t[j] <= t[i]:
            aiding = {"star": rec.star.q_nb[j]}
            j += 1
        field = rec.mag.mag[i // 4] if i % 4 == 0 else None
        state = flt.step(state, t[i], rec.imu.gyr[i], acc[i], field, **aiding)
        states.append(state)
    streams.assert_same_bits(whole, streams.collect(states))


def nees(seed, seconds=10.0, rate_hz=50.0):
    """NEES at the end of a run on data that the model describes."""
    flt = IndirectEkf(
        gyr_noise=2e-3, gyr_bias_noise=2e-4, acc_noise=0.1, mag_noise=1e-6, mag_factor=1.0,
        star_resolution=0.02, std_tilt=0.03, std_gyr_bias=0.01, gate=np.inf,
        mag_reference=(FIELD_N[0], FIELD_N[2]),
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    n, dt = round(seconds * rate_hz), 1.0 / rate_hz
    t = dt * np.arange(n)
    omega = np.sin(2 * np.pi * np.outer(t, rng.uniform(0.1, 0.5, 3)) + rng.uniform(0, 6.28, 3))
    turns = [Rotation.random(random_state=rng)]
    for rate in omega[1:]:
        turns.append(turns[-1] * Rotation.from_rotvec(rate * dt))
    r_nb = Rotation.concatenate(turns)
    white = rng.standard_normal((4, n, 3)) / np.sqrt(dt)
    bias = 0.01 * rng.standard_normal(3) + np.cumsum(2e-4 * white[0], axis=0) * dt
    seen = r_nb[25::100]
    noise = 2 * 0.02 / np.sqrt(48) * rng.standard_normal((len(seen), 3))
    rec = Recording(
        imu=Imu(
            t=t, gyr=omega + bias + 2e-3 * white[1],
            acc=r_nb.inv().apply([0, 0, -G]) + 0.1 * white[2],
        ),
        mag=Mag(t=t, mag=r_nb.inv().apply(FIELD_N) + 1e-6 * white[3]),
        star=Star(t=t[25::100], q_nb=hand.scalar_first(seen * Rotation.from_rotvec(noise))),
    )  # fmt: skip
    start = r_nb[0] * Rotation.from_rotvec(0.03 * rng.standard_normal(3)).inv()
    _, state = flt.advance(
        flt.init(attitude=start.as_quat()[[3, 0, 1, 2]]), rec, diagnostics=False
    )
    off = (Rotation.from_quat(state.q_nb[[1, 2, 3, 0]]).inv() * r_nb[-1]).as_rotvec()
    e = np.r_[off, bias[-1] - state.gyr_bias]
    return e @ np.linalg.solve(state.P, e)


def test_mean_nees_of_a_hundred_runs_lies_in_its_chi_square_interval():
    runs = 100
    mean = np.mean([nees(seed) for seed in range(runs)])
    low, high = chi2.ppf([0.005, 0.995], 6 * runs) / runs  # 5.14 and 6.93
    assert low < mean < high


def test_configurations_of_the_source():
    space = IndirectEkf.space()
    assert space.std_tilt / DEG == pytest.approx(2.6, abs=0.1)  # spec A 2.7.9: about 2.5 deg
    assert space.std_gyr_bias / DEG == pytest.approx(0.0035, abs=0.0005)
    assert space.star_only
    assert np.array_equal(IndirectEkf.terrestrial()._memory()[1], np.eye(6))
    assert IndirectEkf.terrestrial(gate=3.0).gate == 3.0


def test_rate_refuses_the_solution_of_another_recording():
    rec, _ = platform(5.0, seed=5)
    flt = IndirectEkf()
    sol = flt.run(rec)
    with pytest.raises(ValueError, match=r"`sol` must hold the gyro bias at the 10 samples"):
        flt.rate(rec.between(0.0, 2.0), sol)


@pytest.mark.parametrize("seed", [1, 4, 6])
def test_without_a_gate_too_absurd_fields_leave_all_finite(seed):
    """Fields of up to 1e8 T, of which the first is the reference: noise of nothing beside it."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(10.0 ** rng.uniform(-6, 1, 3000))
    wild = [10.0 ** rng.uniform(-8, 8, (3000, 1)) * rng.standard_normal((3000, 3)) for _ in "gam"]
    for array in wild:
        array[rng.random(3000) < 0.1] = np.nan
        array[rng.random(3000) < 0.1] = 0.0
    rec = Recording(imu=Imu(t=t, gyr=wild[0], acc=wild[1]), mag=Mag(t=t, mag=wild[2]))
    for propagation in ("exact", "truncated"):
        sol = IndirectEkf.terrestrial(propagation=propagation).run(rec, diagnostics=False)
        for value in (sol.q_nb, sol.gyr_bias, sol.std_attitude_n, sol.std_gyr_bias):
            assert np.isfinite(value).all()


def test_parameters_out_of_range_are_refused():
    with pytest.raises(ValueError, match=r"`propagation` must be one of exact, truncated"):
        IndirectEkf(propagation="v1")
    with pytest.raises(TypeError, match="`star_only` must be True or False"):
        IndirectEkf(star_only=1)
    with pytest.raises(ValueError, match="`mag_factor` must be positive"):
        IndirectEkf(mag_factor=0.0)
    with pytest.raises(ValueError, match="`mag_reference` must be positive"):
        IndirectEkf(mag_reference=(0.0, 4e-5))
    with pytest.raises(ValueError, match="`gyr_bias` must"):
        IndirectEkf(gyr_bias=(0.0, 0.0))
