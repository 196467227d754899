"""From a recording to a noise file and to the parameters of a filter; what is refused."""

import dataclasses
import datetime as dt

import numpy as np
import pytest
from numpy.testing import assert_allclose
from truth.noise import at_rest

from strapdown import noise
from strapdown.errors import DataGap, FormatError, InputError, MissingStream
from strapdown.noise import Status, characterize, moving, require_still
from strapdown.recording import Imu, Mag, Recording, Temperature

FS = 50.0
GYR, ACC, MAG = 2e-4, 3e-3, 2e-8  # N of the simulated sensors
GRAVITY_B = np.array([1.0, -2.0, -9.5])


def triad(rng, n, N, mean, fs=FS, **slow):
    return np.column_stack([at_rest(rng, n, fs, N=N, bias=m, **slow) for m in mean])


def device(n=20_000, seed=1, **streams):
    rng = np.random.default_rng(seed)
    t = 100.0 + np.arange(n) / FS
    parts = dict(
        imu=Imu(
            t=t, gyr=triad(rng, n, GYR, (0.01, -0.02, 0.0)), acc=triad(rng, n, ACC, GRAVITY_B)
        ),
        mag=Mag(t=t[::2], mag=triad(rng, n // 2, MAG, (2e-5, 0.0, 4e-5), fs=FS / 2)),
        temperature=Temperature(t=t[::500], temp_degc=np.full(t[::500].size, 23.5)),
        meta={"name": "bench"},
    )
    return Recording(**(parts | streams))


@pytest.fixture(scope="module")
def found():
    return characterize(device(), sensor_id="unit 7")


def test_all_sensors_are_found_with_their_noise(found):
    assert list(found.record.sensors) == ["gyr", "acc", "mag"]
    for name, truth in (("gyr", GYR), ("acc", ACC), ("mag", MAG)):
        for axis in found.record[name].axes:
            assert axis.coefficients.N.value == pytest.approx(truth, rel=0.03)
            assert axis.coefficients.K.status is Status.NOT_OBSERVABLE
        assert len(found.curves[name]) == len(found.spectra[name]) == 3
        assert found.readings[name][0].N.value == pytest.approx(truth, rel=0.05)
    assert found.record["mag"].fs == pytest.approx(25.0)
    assert found.record["gyr"].start == 100.0
    assert_allclose(found.record["acc"].mean, GRAVITY_B, atol=2e-3)
    assert found.together.covariance.shape == (9, 9)
    assert found.record.temp_degc == pytest.approx(23.5)
    assert found.record.source == "bench"


def test_sensors_can_be_chosen(found):
    only = characterize(device(), sensors=["mag"])
    assert list(only.record.sensors) == ["mag"]
    assert only.together is None
    with pytest.raises(ValueError, match="`sensors` must be one of gyr, acc, mag, got 'gyro'"):
        characterize(device(), sensors=["gyro"])


def test_filter_noise_in_one_call(found):
    worst, mean, x = (found.record.filter_noise(a) for a in ("worst", "mean", "x"))
    axes = [a.coefficients.N.value for a in found.record["gyr"].axes]
    assert worst.gyr_noise == max(axes)
    assert mean.gyr_noise == pytest.approx(np.sqrt(np.mean(np.square(axes))))
    assert x.gyr_noise == axes[0]
    assert worst.acc_std == pytest.approx(ACC * np.sqrt(FS), rel=0.03)
    # No walk was there: the number is the limit, and a note says so.
    limits = [a.coefficients.K.high for a in found.record["gyr"].axes]
    assert worst.gyr_bias_noise == max(limits)
    assert sum("bias random walk is the record's limit" in note for note in worst.notes) == 9
    with pytest.raises(ValueError, match="`axis` must be one of worst, mean, x, y, z"):
        found.record.filter_noise("best")


def test_filter_noise_says_what_is_doubtful(found):
    gyr = found.record["gyr"]
    doubtful = dataclasses.replace(
        gyr.axes[1].coefficients.N, status=Status.DOUBTFUL, remark="the slope is -0.35"
    )
    y = dataclasses.replace(
        gyr.axes[1], coefficients=dataclasses.replace(gyr.axes[1].coefficients, N=doubtful)
    )
    record = dataclasses.replace(
        found.record,
        sensors={"gyr": dataclasses.replace(gyr, axes=(gyr.axes[0], y, gyr.axes[2]))},
    )
    assert "gyr y: N is doubtful, the slope is -0.35" in record.filter_noise("y").notes
    unseen = dataclasses.replace(doubtful, status=Status.NOT_OBSERVABLE, remark="too short")
    y = dataclasses.replace(y, coefficients=dataclasses.replace(y.coefficients, N=unseen))
    record = dataclasses.replace(
        record, sensors={"gyr": dataclasses.replace(gyr, axes=(gyr.axes[0], y, gyr.axes[2]))}
    )
    with pytest.raises(InputError, match="gyr y must show white noise for a filter to use, but"):
        record.filter_noise()


def test_gyro_and_accelerometer_of_different_rates_use_their_real_samples():
    rec = device(20_000)
    real = np.arange(20_000) % 4 == 0
    held = np.repeat(rec.imu.acc[::4], 4, axis=0)
    imu = dataclasses.replace(rec.imu, acc=held, acc_real=real)
    found = characterize(dataclasses.replace(rec, imu=imu), sensors=["acc"])
    assert found.record["acc"].fs == pytest.approx(FS / 4.0)
    # A quarter of the samples of the same deviation.
    assert found.record["acc"].axes[0].coefficients.N.value == pytest.approx(2.0 * ACC, rel=0.05)


# --- what is refused ----------------------------------------------------------------------


def test_moving_log_is_refused_with_the_span_and_the_still_part():
    rec = device()
    gyr = rec.imu.gyr.copy()
    gyr[5000:5500] += 0.2 * np.sin(np.arange(500) / 20.0)[:, np.newaxis]
    moved = dataclasses.replace(rec, imu=dataclasses.replace(rec.imu, gyr=gyr))
    with pytest.raises(
        InputError,
        match=r"`gyr` must be still throughout, it moves from 200\.0 s to 210\.0 s; the longest "
        r"still stretch is 210\.0 s to 500\.0 s, take that alone",
    ):
        characterize(moved)
    assert characterize(moved.between(210.0, 500.0), ["gyr"]).record["gyr"].duration < 291.0


@pytest.mark.parametrize("change", ["burst", "step", "turn"])
def test_each_kind_of_motion_is_seen(change):
    y = at_rest(np.random.default_rng(2), 6000, 100.0, N=1e-3)
    if change == "burst":
        y[3000:3120] += 0.2 * np.random.default_rng(3).standard_normal(120)
    elif change == "step":
        y[3000:] += 0.02
    else:
        y[3000:3400] += 0.05
    seen = moving(y, 100.0)
    assert seen[2900:3100].any()
    assert not seen[:2800].any()
    assert not seen[3600:].any()


def test_two_motions_are_both_named():
    y = at_rest(np.random.default_rng(2), 6000, 100.0, N=1e-3)
    y[1000:1200] += 0.1
    y[4000:4100] -= 0.1
    with pytest.raises(
        InputError, match=r"from 9\.0 s to 13\.0 s and 1 more times, last until 42"
    ):
        require_still("acc", y, 100.0)


def test_slow_noise_is_not_motion():
    for seed in range(5):
        y = at_rest(np.random.default_rng(seed), 400_000, 100.0, N=1e-3, B=1e-3, K=3e-4, R=1e-6)
        assert not moving(y, 100.0).any()


def test_coarse_channel_is_not_motion():
    y = np.round(at_rest(np.random.default_rng(0), 20_000, 50.0, N=0.02) / 0.5) * 0.5
    assert not moving(y, 50.0).any()


def test_log_that_shakes_from_end_to_end_has_no_still_part():
    y = np.tile(np.repeat([0.0, 5.0], 100), 30) + np.random.default_rng(0).standard_normal(6000)
    if moving(y, 100.0).all():
        with pytest.raises(InputError, match="record with the device lying still"):
            require_still("gyr", y, 100.0)
    else:
        with pytest.raises(InputError, match="must be still throughout"):
            require_still("gyr", y, 100.0)


def with_channel(values):
    rec = device(2000)
    gyr = rec.imu.gyr.copy()
    gyr[:, 1] = values(gyr[:, 1])
    return dataclasses.replace(rec, imu=dataclasses.replace(rec.imu, gyr=gyr))


def test_constant_and_clipped_channels_are_named():
    with pytest.raises(InputError, match=r"`gyr y` must vary, got 0\.5 in all 2000 samples"):
        characterize(with_channel(lambda y: np.full_like(y, 0.5)))
    with pytest.raises(InputError, match="`gyr y` must not be clipped"):
        characterize(with_channel(lambda y: np.minimum(y, -0.02)))


def test_missing_sensors_are_named():
    with pytest.raises(MissingStream, match="must hold 'mag', it has gyr, acc"):
        characterize(device(2000, mag=None), sensors=["mag"])
    with pytest.raises(MissingStream, match="must hold a gyroscope, an accelerometer or"):
        characterize(Recording())


def test_short_recording_is_refused():
    with pytest.raises(
        InputError, match="`gyr` must have at least 256 samples in one piece, got 200"
    ):
        characterize(device(200, temperature=None))


def test_longest_piece_between_gaps_is_used_and_said():
    rec = device(4000)
    keep = np.ones(4000, dtype=bool)
    keep[1000:1010] = False
    gappy = dataclasses.replace(rec, imu=rec.imu.rows(keep), mag=None)
    noises = characterize(gappy).record["gyr"]
    assert noises.start == pytest.approx(100.0 + 1010 / FS)
    assert "the longest unbroken piece, 120.2 s to 180.0 s, was used" in noises.remarks[0]


def test_nan_is_a_gap():
    rec = device(4000, mag=None)
    acc = rec.imu.acc.copy()
    acc[300] = np.nan
    found = characterize(dataclasses.replace(rec, imu=dataclasses.replace(rec.imu, acc=acc)))
    assert found.record["acc"].start == pytest.approx(100.0 + 301 / FS)
    assert found.record["gyr"].remarks == ()


def test_late_samples_are_not_gaps():
    rec = device(4000, mag=None)
    t = rec.imu.t.copy()
    t[::7] += 0.013  # of 0.02
    found = characterize(dataclasses.replace(rec, imu=dataclasses.replace(rec.imu, t=t)))
    assert found.record["gyr"].remarks == ()
    assert found.record["gyr"].fs == pytest.approx(FS, rel=1e-3)


def test_log_full_of_gaps_is_refused():
    rec = device(4000, mag=None)
    keep = np.arange(4000) % 100 != 0
    with pytest.raises(DataGap, match="`gyr` must be without gaps and NaN over half of the log"):
        characterize(dataclasses.replace(rec, imu=rec.imu.rows(keep)))


# --- the file ---------------------------------------------------------------------------


def test_record_is_the_same_after_the_file(found, tmp_path):
    path = tmp_path / "noise.toml"
    noise.save(found.record, path)
    loaded = noise.load(path)
    assert loaded.sensor_id == "unit 7"
    assert loaded.date == dt.date.today()
    assert loaded.temp_degc == found.record.temp_degc
    for name, sensor in found.record.sensors.items():
        assert loaded[name].axes == sensor.axes or all(
            repr(a) == repr(b) for a, b in zip(loaded[name].axes, sensor.axes, strict=True)
        )
        assert np.array_equal(loaded[name].covariance, sensor.covariance)
    assert repr(loaded.filter_noise()) == repr(found.record.filter_noise())


def test_file_says_its_units_and_what_was_not_seen(found, tmp_path):
    noise.save(found.record, tmp_path / "noise.toml")
    text = (tmp_path / "noise.toml").read_text()
    assert 'unit = "rad_s"' in text
    assert 'unit = "T/sqrt(Hz)"' in text
    assert 'status = "not observable"' in text
    assert "format_version = 1" in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("strapdown noise", "imu"), "must begin with `type = 'strapdown noise'`, got 'imu'"),
        (("format_version = 1", "format_version = 2"), "`format_version` must be 1, got 2"),
        (("[gyr]", "[gyro]"), "unknown key 'gyro' at the top; the nearest name is 'gyr'"),
        (
            ("rate_hz", "rate_khz"),
            r"unknown key 'rate_khz' in \[gyr\]; the nearest name is 'rate_hz'",
        ),
        (('unit = "rad_s"', 'unit = "dps"'), "`gyr.unit` must be 'rad_s', got 'dps'"),
        (
            ('unit = "rad/s/sqrt(Hz)"', 'unit = "deg/sqrt(h)"'),
            r"`gyr.x.N.unit` must be 'rad/s/sqrt\(Hz\)', got 'deg/sqrt\(h\)'",
        ),
        (('status = "observed"', 'status = "sure"'), "`gyr.x.N.status` must be one of observed"),
        (("start_s = 100.0", ""), "the key 'start_s' is missing"),
        (("date = ", "date = 5 #"), "`date` must be a date such as 2025-03-31, got 5"),
        (("rate_hz = 50.0", "rate_hz = -1.0"), "`fs` must be positive"),
        (("type = ", "type : "), "must be TOML"),
        (("date = ", "date = 2020-01-01\ndate = "), 'must be TOML, got Key "date" already exists'),
        (("start_s = 100.0", f"start_s = {'9' * 400}"), "`gyr.start_s` must be .* 64 bits"),
    ],
)
def test_file_with_faults_is_refused(found, tmp_path, change, message):
    path = tmp_path / "noise.toml"
    noise.save(found.record, path)
    text = path.read_text()
    if change[0] == "rate_hz = 50.0":
        change = (next(line for line in text.splitlines() if "rate_hz" in line), change[1])
    if change[0] == "[gyr]":
        text = text.replace("[gyr.", "[gyro.")
    assert change[0] in text
    path.write_text(text.replace(*change, 1))
    with pytest.raises(FormatError, match=message):
        noise.load(path)


def test_record_holds_each_sensor_under_its_name(found):
    with pytest.raises(ValueError, match=r"`sensors\['acc'\]` must be of acc, got gyr"):
        dataclasses.replace(found.record, sensors={"acc": found.record["gyr"]})
    with pytest.raises(MissingStream, match="must hold 'mag', it has gyr"):
        dataclasses.replace(found.record, sensors={"gyr": found.record["gyr"]})["mag"]
    with pytest.raises(ValueError, match=r"`covariance` must have shape \(3, 3\)"):
        dataclasses.replace(found.record["gyr"], covariance=np.ones((2, 3, 3)))
