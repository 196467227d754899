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


def write(path, *, moving=False, mag=True):
    rng = np.random.default_rng(6)
    t = np.arange(COUNT) / FS

    def triad(level, mean):
        return np.column_stack([at_rest(rng, COUNT, FS, N=level, bias=m) for m in mean])

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
