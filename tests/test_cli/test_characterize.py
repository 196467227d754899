"""``strapdown characterize``: from a log at rest to a noise file and a page."""

import json

import numpy as np
import pytest
from truth.noise import at_rest

import strapdown as sd
from strapdown import noise
from strapdown.recording import Imu, Mag, Recording

FS, COUNT = 50.0, 6000
GYR, ACC, MAG = 2e-4, 3e-3, 2e-8


def write(path, *, moving=False, mag=True, fs=FS):
    rng = np.random.default_rng(6)
    t = np.arange(COUNT) / fs

    def triad(level, mean):
        return np.column_stack([at_rest(rng, COUNT, fs, N=level, bias=m) for m in mean])

    gyr = triad(GYR, (0.01, 0.0, -0.02))
    if moving:
        gyr[3000:3200, 2] += 0.3
    rec = Recording(
        imu=Imu(t=t, gyr=gyr, acc=triad(ACC, (0.1, -0.2, -9.8))),
        mag=Mag(t=t, mag=triad(MAG, (2e-5, 0.0, 4e-5))) if mag else None,
    )
    sd.write(rec, path)
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return write(tmp_path_factory.mktemp("logs") / "rest.parquet")


def test_file_page_and_table(command, log, tmp_path):
    done = command("characterize", log, "--sensor-id", "unit 7")
    assert done.status == 0, done.err
    record = noise.load(tmp_path / "noise.toml")
    assert record.sensor_id == "unit 7"
    for name, truth in (("gyr", GYR), ("acc", ACC), ("mag", MAG)):
        for axis in record[name].axes:
            assert axis.coefficients.N.value == pytest.approx(truth, rel=0.06)
    page = (tmp_path / "noise.html").read_text(encoding="utf-8")
    for words in ("Gyroscope", "Magnetometer", "Overlapping Allan deviation", "unit 7"):
        assert words in page
    assert "gyr x" in done.out
    assert "mag z" in done.out
    assert "noise.toml" in done.out
    assert "is the limit of the record" in done.err


def test_json_is_one_object_with_units_and_silence(command, log, tmp_path):
    done = command("characterize", log, "--sensors", "gyr", "--json", "--no-report")
    assert done.status == 0, done.err
    found = json.loads(done.out)
    assert list(found["sensors"]) == ["gyr"]
    x = found["sensors"]["gyr"]["x"]
    assert x["N"]["unit"] == "rad/s/sqrt(Hz)"
    assert x["N"]["value"] == pytest.approx(GYR, rel=0.06)
    assert x["K"]["status"] == "not observable"
    assert x["K"]["value"] is None
    assert x["K"]["high"] > 0.0
    assert found["filter_noise"]["gyr_noise"] == pytest.approx(GYR, rel=0.06)
    assert found["filter_noise"]["acc_noise"] is None
    assert any("record's limit" in note for note in found["notes"])
    assert found["outputs"] == {"noise": "noise.toml"}
    assert not (tmp_path / "noise.html").exists()


def test_part_of_a_log_can_be_taken(command, log, tmp_path):
    done = command("characterize", log, "--from", "20", "--to", "70", "-o", "part.toml", "--json")
    assert done.status == 0, done.err
    assert noise.load(tmp_path / "part.toml")["acc"].duration == pytest.approx(50.0, rel=0.01)
    assert (tmp_path / "part.html").exists()


def test_moving_log_is_refused_with_its_span(command, tmp_path):
    done = command("characterize", write(tmp_path / "moving.parquet", moving=True))
    assert done.status == 2
    assert len(done.err.strip().splitlines()) == 1
    assert "must be still throughout, it moves from 59.0 s to 65.0 s" in done.line
    assert "the longest still stretch is 0.0 s to 59.0 s" in done.line
    assert not (tmp_path / "noise.toml").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--sensors", "gyro"), "`sensors` must be one of gyr, acc, mag, got 'gyro'"),
        (("--sensors", "mag"), "must hold 'mag', it has gyr, acc"),
        (("--from", "0", "--to", "3"), "must have at least 256 samples in one piece, got 150"),
    ],
)
def test_bad_requests_end_with_status_2(command, tmp_path, arguments, message):
    done = command("characterize", write(tmp_path / "imu.parquet", mag=False), *arguments)
    assert done.status == 2
    assert message in done.line


def test_low_pass_of_the_mpu6050_is_chosen_as_in_the_source(command, tmp_path):
    """Thesis A, 5.3.1, at its rate of 100 Hz: 188 Hz is recommended, all under 42 Hz rejected."""
    log = write(tmp_path / "rest.parquet", fs=100.0, mag=False)
    printed = "256:0.98:.110,188:1.9:.083,98:2.8:.069,42:4.8:.055,20:8.3:.046,10:13.4:.045"
    for low_pass in ("mpu6050", printed):
        done = command("characterize", log, "--low-pass", low_pass, "--no-report", "--json")
        assert done.status == 0, done.err
        study = json.loads(done.out)["low_pass"]
        assert study["recommended_hz"] == 188.0
        assert study["rejected_hz"] == [f for f in study["cutoff_hz"] if f < 42.0]
        assert len(study["rejected_hz"]) >= 2


def test_low_pass_is_printed_with_its_verdicts(command, log):
    done = command("characterize", log, "--low-pass", "mpu6050", "--no-report")
    assert done.status == 0, done.err
    rows = [line.split() for line in done.out.splitlines()]
    assert [row[0] for row in rows if row[-1:] == ["recommended"]] == ["188"]
    assert [row[0] for row in rows if row[-1:] == ["rejected"]] == ["10", "5"]  # at 50 Hz


def test_low_pass_takes_the_noise_of_the_log_where_none_is_given(command, log):
    pairs = "256:0.98,20:8.3"
    done = command("characterize", log, "--low-pass", pairs, "--no-report", "--json")
    assert done.status == 0, done.err
    study = json.loads(done.out)["low_pass"]
    sigma = np.array(study["noise_error_rad"]) * FS
    np.testing.assert_allclose(sigma, GYR * np.sqrt(np.pi * np.array([256.0, 20.0])), rtol=0.1)
    assert "whose filter must be wide" in done.err


@pytest.mark.parametrize(
    "text", ["mpu6500", "188", "188:1.9,98", "188:1.9,98:2.8:0.07", "a:b", ""]
)
def test_low_pass_of_another_form_is_refused(command, log, text):
    done = command("characterize", log, "--low-pass", text)
    assert done.status == 2
    assert "--low-pass must be mpu6050, or cut-offs and delays" in done.line


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("188:1.9", "at least two cut-offs, got 1"),
        ("188:1.9,-98:2.8", "`cutoff_hz[1]` must be positive"),
    ],
)
def test_low_pass_without_choice_or_sense_is_refused(command, log, text, message):
    done = command("characterize", log, "--low-pass", text)
    assert done.status == 2
    assert message in done.line


def test_low_pass_needs_the_gyroscope(command, log):
    done = command("characterize", log, "--sensors", "acc", "--low-pass", "mpu6050")
    assert done.status == 2
    assert "must hold 'gyr', it has acc" in done.line
