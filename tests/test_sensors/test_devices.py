"""Whole sensors and devices: what they say of known motions, the way back, and the presets."""

from dataclasses import replace

import numpy as np
import pyproj
import pytest
from scipy.spatial.transform import Rotation

from strapdown import sensors
from strapdown.constants import G0
from strapdown.errors import InputError
from strapdown.sensors import (
    Accelerometer,
    AxisEncoder,
    Barometer,
    Device,
    Digital,
    GnssFix,
    Gyro,
    Linear,
    Magnetometer,
    Noise,
    Pitot,
    Sampling,
    StarTracker,
    Thermometer,
    Warmth,
)
from strapdown.sensors.datasheet import datasheet_names, si_value
from strapdown.sensors.scalars import height_from_pressure, pressure_from_height
from strapdown.simulation import truth
from strapdown.simulation.motions import HandMoved, Static, Turntable
from strapdown.simulation.vehicles import Drive
from strapdown.units import DEG, DPS, GAUSS, MG, UT

PLACE = (41.0 * DEG, 14.0 * DEG, 120.0)
FIELD_N = (24e-6, 1e-6, 39e-6)
HAND = HandMoved(north=((0.2, 2.1, 0.2),), rest=1.0, moving=18.0)


def moving(rate=200.0, duration=20.0, motion=HAND):
    return truth(motion, np.arange(round(duration * rate) + 1) / rate, PLACE, m_n=FIELD_N)


def rng(seed=1):
    return np.random.default_rng(seed)


CROOKED = Linear(
    matrix=((1.01, 0.02, 0.0), (-0.01, 0.98, 0.03), (0.0, -0.02, 1.03)),
    bias=(0.02, -0.01, 0.03),
    quadratic=((1e-3, 0, 0), (0, -1e-3, 0), (0, 0, 2e-3)),
)
WARM = dict(temp_bias=(1e-3, -2e-3, 3e-3), temp_scale=(1e-4, 2e-4, -3e-4), temp_reference=20.0)


def test_gyro_is_brought_back_to_the_truth():
    g = ((1e-3, 2e-4, 0.0), (0.0, -1e-3, 3e-4), (1e-4, 0.0, 2e-3))
    gyro = Gyro(linear=CROOKED, g_sensitivity=g, **WARM)
    true = moving()
    temp = np.linspace(10.0, 40.0, len(true.t))
    said = gyro.apply(true, rng(), temp_degc=temp)
    assert np.abs(said.value - true.omega_ib_b).max() > 0.02
    back = gyro.compensate(said.value, acc=true.f_b, temp_degc=temp)
    assert back == pytest.approx(true.omega_ib_b, abs=1e-14)


def test_g_sensitivity_is_a_bias_in_proportion_to_the_force():
    g = ((1e-3, 0, 0), (0, 2e-3, 0), (4e-3, 0, 3e-3))
    gyro = Gyro(g_sensitivity=g, linear=Linear(matrix=((2.0, 0, 0), (0, 2.0, 0), (0, 0, 2.0))))
    true = moving(motion=Static(rpy=(0.2, 0.3, 0.0)), duration=1.0)
    off = gyro.apply(true, rng()).value - 2.0 * true.omega_ib_b
    assert off == pytest.approx(true.f_b @ np.array(g).T, abs=1e-15)


def test_accelerometer_and_magnetometer_are_brought_back_to_the_truth():
    true = moving()
    acc = Accelerometer(linear=CROOKED, **WARM)
    said = acc.apply(true, rng(), temp_degc=35.0)
    assert acc.compensate(said.value, temp_degc=35.0) == pytest.approx(true.f_b, abs=1e-13)
    mag = Magnetometer(linear=Linear(matrix=CROOKED.matrix, bias=(5 * UT, -3 * UT, 8 * UT)))
    m_b = Rotation.from_quat(true.q_nb, scalar_first=True).inv().apply(true.m_n)
    assert mag.compensate(mag.apply(true, rng()).mag) == pytest.approx(m_b, abs=1e-19)


def test_what_is_clipped_is_not_brought_back():
    acc = Accelerometer(digital=Digital(lsb=0.01, full_scale=9.0))
    said = acc.apply(moving(motion=Static(), duration=1.0), rng()).value
    assert said[:, 2] == pytest.approx(np.full(len(said), -9.0), abs=1e-12)
    assert np.isnan(acc.compensate(said)).all()


def test_gyro_that_averages_gives_the_turn_of_each_interval():
    table = moving(rate=2000.0, duration=10.0, motion=Turntable(rest=1.0, turning=4.0))
    said = Gyro(sampling=Sampling(rate=100.0, average=True)).apply(table, rng())
    yaw = np.unwrap(Rotation.from_quat(table.q_nb, scalar_first=True).as_euler("ZYX")[:, 0])
    earth = -7.292115e-5 * np.sin(PLACE[0])
    turned = np.diff(yaw[::20]) * 100.0 + earth
    assert said.value[1:, 2] == pytest.approx(turned, abs=1e-9)


def test_filtered_noise_is_coloured_and_unfiltered_is_not():
    still = moving(rate=1000.0, duration=100.0, motion=Static())
    noise, low = Noise(white=0.01), Sampling(rate=200.0, bandwidth=20.0, filters_noise=True)
    coloured = Gyro(noise=noise, sampling=low).apply(still, rng()).value[200:, 0]
    white = Gyro(noise=noise, sampling=replace(low, filters_noise=False)).apply(still, rng())
    # one-sided noise bandwidth of a second-order Butterworth filter: pi / 2 / sqrt(2) * f
    expected = 0.01 * np.sqrt(2 * 20.0 * np.pi / 2 / np.sqrt(2))
    assert coloured.std() == pytest.approx(expected, rel=0.08)
    assert white.value[200:, 0].std() == pytest.approx(0.01 * np.sqrt(200.0), rel=0.03)
    assert np.corrcoef(coloured[1:], coloured[:-1])[0, 1] > 0.7


def test_device_records_each_sensor_at_its_own_rate():
    device = Device(
        gyr=Gyro(sampling=Sampling(rate=100.0)),
        acc=Accelerometer(sampling=Sampling(rate=50.0)),
        mag=Magnetometer(sampling=Sampling(rate=20.0)),
        baro=Barometer(sampling=Sampling(rate=10.0)),
    )
    true = moving()
    log = device.record(true)
    assert (len(log.imu), len(log.mag), len(log.baro)) == (2001, 401, 201)
    assert log.imu.acc_real.sum() == 1001
    assert log.imu.gyr_real is None
    assert log.imu.acc[::2] == pytest.approx(true.f_b[::4], abs=0)
    assert np.array_equal(log.imu.acc[1::2], log.imu.acc[:-1:2])
    swapped = replace(device, gyr=replace(device.gyr, sampling=Sampling(rate=25.0))).record(true)
    assert len(swapped.imu) == 1001
    assert swapped.imu.gyr_real.sum() == 501


def test_gyro_and_accelerometer_of_one_chip_share_stamps_and_losses():
    s = Sampling(rate=100.0, jitter=5e-4, dropout=0.1)
    log = Device(gyr=Gyro(sampling=s), acc=Accelerometer(sampling=s)).record(moving())
    assert 1600 < len(log.imu) < 1950
    assert np.diff(log.imu.t).min() > 0.0


def test_same_seed_same_recording_and_each_sensor_has_its_own_randomness():
    chip = sensors.preset("mpu9250")
    true = moving()
    a, b, c = chip.record(true, seed=3), chip.record(true, seed=3), chip.record(true, seed=4)
    assert np.array_equal(a.imu.gyr, b.imu.gyr)
    assert np.array_equal(a.mag.mag, b.mag.mag)
    assert not np.array_equal(a.imu.gyr, c.imu.gyr)
    blind = replace(chip, mag=None).record(true, seed=3)
    assert np.array_equal(a.imu.acc, blind.imu.acc)
    alone = Device(mag=chip.mag).record(true, seed=3)
    assert np.array_equal(a.mag.mag, alone.mag.mag)


def test_reference_is_the_truth():
    true = moving()
    log = sensors.preset("mpu6050").record(true, reference_every=5)
    assert np.array_equal(log.reference.attitude.q_nb, true.q_nb[::5])
    assert np.array_equal(log.reference.position.lla, true.lla[::5])


# --- scalars and fixes ------------------------------------------------------------------


def test_pressure_is_that_of_the_standard_atmosphere():
    # ISO 2533, table 5
    heights = np.array([0.0, 1000.0, 5000.0, 11000.0])
    assert pressure_from_height(heights) == pytest.approx(
        [101325.0, 89874.6, 54019.9, 22632.0], abs=0.1
    )
    assert height_from_pressure(pressure_from_height(heights)) == pytest.approx(heights, abs=1e-8)
    baro = Barometer(bias=50.0, scale=1.001, sea_level=100_000.0)
    said = baro.apply(moving(), rng())
    assert baro.height(said.pressure) == pytest.approx(moving().lla[:, 2], abs=1e-8)
    with pytest.raises(ValueError, match=r"`height` must lie in \[-2000, 11000\] m"):
        pressure_from_height(20e3)


def test_pitot_tube_feels_the_wind():
    drive = moving(duration=25.0, motion=Drive(rest=2.0))
    said = Pitot(wind_n=(-3.0, 0.0, 0.0)).apply(drive, rng()).airspeed
    assert said[0] == pytest.approx(3.0, abs=1e-9)
    assert said[-1] == pytest.approx(np.linalg.norm(drive.v_n[-1] + [3.0, 0.0, 0.0]), abs=1e-12)
    assert Pitot(lowest=4.0, wind_n=(-3.0, 0.0, 0.0)).apply(drive, rng()).airspeed[0] == 0.0


def test_encoder_counts_from_its_start_and_over_turns():
    table = moving(duration=20.0, motion=Turntable(rest=1.0, turning=10.0, tilt=(0.0, 0.0, 0.5)))
    encoder = AxisEncoder(digital=Digital(lsb=0.09 * DEG, bits=32))
    angle = encoder.apply(table, rng()).angle
    assert angle[0] == 0.0
    # 12 s at 200 deg/s
    assert angle[-1] / DEG == pytest.approx(2400.0, abs=0.05)
    count = angle / (0.09 * DEG)
    assert count == pytest.approx(np.rint(count), abs=1e-9)


def test_channels_of_an_encoder_run_through_the_states_of_table_8_2():
    encoder = AxisEncoder(digital=Digital(lsb=1.0))
    assert encoder.channels(np.arange(5.0)).tolist() == [0b11, 0b10, 0b00, 0b01, 0b11]
    assert encoder.channels(-np.arange(3.0)).tolist() == [0b11, 0b01, 0b00]


def test_thermometer_follows_the_warming_box():
    warmth = Warmth(start=20.0, settled=35.0, time_constant=10.0)
    still = moving(motion=Static())
    said = Thermometer(digital=Digital(lsb=0.14, zero=25.0)).apply(
        still, rng(), warmth.at(still.t)
    )
    expected = 35.0 - 15.0 * np.exp(-still.t / 10.0)
    assert said.temp_degc == pytest.approx(expected, abs=0.0701)


def test_gnss_gives_position_and_velocity_of_the_antenna():
    silent = dict(std_position=(0, 0, 0), std_velocity=(0, 0, 0))
    arm_b = (0.5, -0.3, -1.2)
    true = moving(motion=HandMoved(rest=0.0, moving=20.0, yaw=((2.0, 5.0, 0.3),)))
    fix = GnssFix(lever_arm_b=arm_b, sampling=Sampling(rate=200.0), **silent).apply(true, rng())
    to_ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)

    def ecef(lla):
        return np.stack(to_ecef.transform(lla[:, 1] / DEG, lla[:, 0] / DEG, lla[:, 2]), axis=1)

    offset = ecef(fix.lla) - ecef(true.lla)
    lat, lon = PLACE[:2]
    sp, cp, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    C_ne = np.array([[-sp * cl, -sp * sl, cp], [-sl, cl, 0], [-cp * cl, -cp * sl, -sp]])
    arm_n = Rotation.from_quat(true.q_nb, scalar_first=True).apply(arm_b)
    assert offset @ C_ne.T == pytest.approx(arm_n, abs=1e-7)
    # velocity against central differences of the antenna's path, 5 ms apart
    path = ecef(fix.lla) @ C_ne.T
    assert fix.v_n[1:-1] == pytest.approx((path[2:] - path[:-2]) * 100.0, abs=2e-4)


def test_gnss_errors_have_their_stated_size():
    still = moving(rate=10.0, duration=2000.0, motion=Static())
    receiver = GnssFix(
        sampling=Sampling(rate=1.0), std_position=(1.0, 2.0, 3.0), std_velocity=(0.1, 0.2, 0.3)
    )
    fix = receiver.apply(still, rng())
    north = (fix.lla[:, 0] - PLACE[0]) * 6.361e6
    assert north.std() == pytest.approx(1.0, rel=0.07)  # 2001 fixes: 1.6 %
    assert (fix.lla[:, 2] - PLACE[2]).std() == pytest.approx(3.0, rel=0.07)
    assert fix.v_n.std(axis=0) == pytest.approx([0.1, 0.2, 0.3], rel=0.07)
    assert fix.std_position_n[0] == pytest.approx([1.0, 2.0, 3.0])
    slow = replace(receiver, wander=(5.0, 5.0, 5.0), wander_time=1000.0).apply(still, rng())
    assert slow.std_position_n[0] == pytest.approx(np.sqrt([26.0, 29.0, 34.0]))


def test_gnss_loses_signal_repeats_its_heading_at_rest_and_may_be_late():
    drive = moving(rate=50.0, duration=60.0, motion=Drive(rest=5.0))
    receiver = GnssFix(
        sampling=Sampling(rate=5.0), outage=10.0, outage_every=30.0, first_outage=8.0, latency=0.2
    )
    fix = receiver.apply(drive, rng())
    valid = fix.t - 0.2
    for start in (8.0, 38.0):
        assert not ((valid >= start) & (valid < start + 10.0)).any()
    assert len(fix) == 301 - 100
    stand = valid > 58.0
    assert np.ptp(fix.heading[stand]) == 0.0


def test_star_tracker_turns_by_its_errors_about_the_axes_of_the_box():
    still = moving(rate=10.0, duration=2000.0, motion=Static(rpy=(0.5, -0.4, 2.0)))
    star = StarTracker(sampling=Sampling(rate=1.0), std=(1e-3, 2e-3, 5e-3)).apply(still, rng())
    q = Rotation.from_quat(still.q_nb[0], scalar_first=True)
    error_b = (q.inv() * Rotation.from_quat(star.q_nb, scalar_first=True)).as_rotvec()
    assert error_b.std(axis=0) == pytest.approx([1e-3, 2e-3, 5e-3], rel=0.07)


def test_star_tracker_without_errors_follows_the_truth():
    true = moving()
    star = StarTracker(sampling=Sampling(rate=20.0)).apply(true, rng())
    apart = (
        Rotation.from_quat(star.q_nb, scalar_first=True).inv()
        * Rotation.from_quat(true.q_nb[::10], scalar_first=True)
    ).magnitude()
    assert apart.max() < 1e-12


# --- presets ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", sensors.preset_names())
def test_every_preset_records_and_names_its_source(name):
    device = sensors.preset(name)
    true = moving(rate=400.0, duration=10.0)
    log = device.record(true)
    assert list(log.streams())
    assert device.individual(5).record(true, seed=2).meta["device"] == name
    assert device.datasheet.source.lower().count("thes") >= 1
    assert len(device.datasheet.figures) >= 3


def test_presets_and_datasheets_are_the_ten_of_the_theses():
    ten = {
        "mpu6050", "hmc5883l", "mpu9250", "lsm9ds1", "adis16350", "adis16405", "mnav100ca",
        "hedm5500", "star_tracker", "fastrax_up500",
    }  # fmt: skip
    assert set(sensors.preset_names()) == ten == set(datasheet_names())


def test_mpu6050_has_the_printed_coefficients_and_counts():
    chip = sensors.preset("mpu6050")
    assert np.array(chip.gyr.noise.white) / DPS == pytest.approx([7.867e-3, 9.281e-3, 7.389e-3])
    assert np.array(chip.gyr.noise.flicker) / DPS == pytest.approx([1.241e-3, 1.418e-3, 1.117e-3])
    assert np.array(chip.gyr.noise.random_walk) / DPS == pytest.approx(
        [1.111e-4, 1.389e-4, 1.111e-4]
    )
    assert np.array(chip.acc.noise.white) / G0 == pytest.approx([2.426e-4, 2.685e-4, 3.920e-4])
    assert chip.gyr.digital.counts([100.0 * DPS]).tolist() == [13100]
    assert chip.gyr.digital.from_counts([131]) == pytest.approx([1.0 * DPS])
    assert chip.acc.digital.counts([G0, 5 * G0]).tolist() == [16384, 32767]
    mag = sensors.preset("hmc5883l").mag
    assert mag.digital.counts([0.5 * GAUSS]).tolist() == [545]
    # derived there: 1.35, 1.28 and 1.33 mG at 75 Hz
    assert np.array(mag.noise.white) * np.sqrt(75.0) / (1e-3 * GAUSS) == pytest.approx(
        [1.35, 1.28, 1.33], abs=0.006
    )


def test_adis16405_has_the_printed_figures():
    box = sensors.preset("adis16405")
    assert box.gyr.noise.white == pytest.approx(2.0 * DEG / 60.0)
    assert box.acc.noise.white == pytest.approx(0.2 / 60.0)
    assert box.gyr.noise.flicker * 0.6643 == pytest.approx(0.007 * DPS, rel=1e-4)
    assert box.gyr.digital.counts([300.0 * DPS]).tolist() == [6000]
    assert box.gyr.temp_bias == pytest.approx((0.01 * DPS,) * 3)  # not the ADIS16400's 0.025
    assert box.acc.temp_bias == pytest.approx((0.3 * MG,) * 3)
    assert box.gyr.g_sensitivity[0][0] == pytest.approx(0.05 * DPS / G0)
    assert box.gyr.spread.bias == pytest.approx(3.0 * DPS)
    assert box.gyr.spread.misalignment == pytest.approx(0.5 * DEG)
    assert box.mag.digital.lsb == pytest.approx(0.5e-3 * GAUSS)
    assert box.temperature.digital.from_counts([100]) == pytest.approx([39.0])
    # ADIS16350: 6.88 counts per degree, zero at 25 degC (6.3.1)
    old = sensors.preset("adis16350").temperature.digital
    assert old.from_counts([0, 688]) == pytest.approx([25.0, 125.0])


def test_spread_of_individuals_keeps_to_the_datasheet():
    parts = [sensors.preset("adis16405").individual(k).gyr.linear for k in range(200)]
    biases = np.array([p.bias for p in parts]) / DPS
    assert biases.std() == pytest.approx(3.0, rel=0.12)
    scale = np.array([np.diag(p.matrix) for p in parts])
    assert 0.009 < np.abs(scale - 1.0).max() < 0.0101  # 0.0495 to 0.0505 of 0.05
    off = np.array([np.array(p.matrix)[0, 1] for p in parts])
    assert 0.47 * DEG < np.abs(off).max() < 0.5 * DEG * 1.01
    rows = np.array([p.matrix for p in parts])
    rows = rows / np.linalg.norm(rows, axis=2, keepdims=True)
    for i, j in ((0, 1), (1, 2), (2, 0)):  # 0.05 deg from axis to axis
        between = np.degrees(np.arccos(np.sum(rows[:, i] * rows[:, j], axis=1))) - 90.0
        assert 0.045 < np.abs(between).max() < 0.0501


def test_axes_that_are_turned_on_their_own_are_not_orthogonal():
    gyr = sensors.Gyro(spread=sensors.Spread(misalignment=0.01))
    rows = np.array([gyr.individual(np.random.default_rng(k)).linear.matrix for k in range(300)])
    between = np.abs(np.einsum("kj,kj->k", rows[:, 0], rows[:, 1]))
    assert 0.015 < between.max() < 0.0201  # both may turn by all of it


def test_axes_cannot_be_less_orthogonal_than_they_are_turned():
    with pytest.raises(ValueError, match=r"`non_orthogonality` must lie in \[0, 0.02\], got 0.03"):
        sensors.Spread(misalignment=0.01, non_orthogonality=0.03)


def test_noise_parameters_are_ready_for_an_estimator():
    noise = sensors.preset("mpu6050").noise_parameters()
    assert noise.gyr_noise == pytest.approx(9.281e-3 * DPS)  # the worst axis
    assert noise.known("gyr_noise", "mag_noise", drift="gyr_bias_walk") == pytest.approx(
        {"gyr_noise": 9.281e-3 * DPS, "drift": 1.389e-4 * DPS}
    )


def test_units_of_datasheets():
    assert si_value(1.0, "m_s_per_sqrt_hr") == pytest.approx(1 / 60.0)
    assert si_value(0.066, "mgauss_per_sqrt_hz") == pytest.approx(6.6e-9)
    assert si_value(250.0, "ppm/degc") == pytest.approx(2.5e-4)
    assert si_value(7e-5, "gauss^2") == pytest.approx(7e-13)
    assert si_value(6.88, "LSB/degc") == pytest.approx(1 / 6.88)


def test_wrong_names_and_halves_are_refused():
    with pytest.raises(ValueError, match="the nearest name is 'mpu6050'"):
        sensors.preset("mpu6500")
    sheet = sensors.datasheet("adis16405")
    with pytest.raises(InputError, match="the nearest name is 'misalignment'"):
        sheet.value("gyr", "misalignement")
    figure = sheet.find("device", "ADC")[0]
    with pytest.raises(InputError, match="has no number"):
        _ = figure.value
    with pytest.raises(ValueError, match="both `gyr` and `acc` or neither"):
        Device(gyr=Gyro())
    with pytest.raises(ValueError, match="`acc` must be given to undo a g-sensitivity"):
        sensors.preset("adis16405").gyr.compensate([[0.0, 0.0, 0.0]])
    with pytest.raises(ValueError, match=r"`temp_degc` must be one number or have shape \(3,\)"):
        Accelerometer().compensate(np.zeros((3, 3)), temp_degc=[1.0, 2.0])
    with pytest.raises(ValueError, match="`std_position` must be non-negative"):
        GnssFix(std_position=(1.0, -1.0, 1.0))
    with pytest.raises(ValueError, match="must have no low-pass and no mean"):
        StarTracker(sampling=Sampling(bandwidth=5.0))
