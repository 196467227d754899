"""Scenarios: tables, units, refusals, the shipped ones, and the command."""

import numpy as np
import pytest

import strapdown as sd
from strapdown.cli._app import main
from strapdown.errors import FormatError, InputError
from strapdown.simulation import load, names
from strapdown.simulation.scenario import MOTIONS, from_mapping
from strapdown.units import DEG, DPS, RPM

QUICK = """
description = "for a test"
[time]
duration_s = 2
rate_hz = 200
reference_rate_hz = 50
[place]
lat_deg = 60
[motion]
kind = "turntable"
rate_rpm = 45
rest_s = 0.5
spin_s = 0.5
tilt_deg = [10, 20, 30]
[mount]
rpy_deg = [0, 0, 90]
[sensors]
presets = ["mpu6050", "hmc5883l"]
[sensors.gyr.sampling]
rate_hz = 50
[sensors.gyr.noise]
white_dps_per_sqrt_hz = [0.01, 0.02, 0.03]
random_walk_dps_sqrt_hz = 1e-4
[sensors.star]
std_arcsec = [10, 10, 60]
"""


@pytest.fixture
def quick(tmp_path):
    path = tmp_path / "quick.toml"
    path.write_text(QUICK)
    return path


def test_table_sets_every_parameter_in_its_unit(quick):
    scenario = load(quick)
    assert (scenario.name, scenario.description) == ("quick", "for a test")
    assert scenario.motion.rate == pytest.approx(45 * RPM)
    assert scenario.motion.tilt == pytest.approx((10 * DEG, 20 * DEG, 30 * DEG))
    assert scenario.place.lat == pytest.approx(60 * DEG)
    gyr = scenario.device.gyr
    assert gyr.sampling.rate == 50.0
    assert gyr.noise.white == pytest.approx((0.01 * DPS, 0.02 * DPS, 0.03 * DPS))
    assert gyr.noise.random_walk == pytest.approx(1e-4 * DPS)
    assert gyr.noise.flicker[0] == pytest.approx(1.241e-3 * DPS)  # the preset's stays
    assert scenario.device.star.std == pytest.approx(np.array((10, 10, 60)) * DEG / 3600)


def test_recording_is_an_ordinary_one_with_its_reference(quick, tmp_path):
    log = load(quick).record(3)
    assert len(log.imu) == 201
    assert log.imu.gyr_real.sum() == 101
    assert len(log.reference.attitude) == 101
    assert log.reference.mount.q_vb[0] == pytest.approx(
        [np.sqrt(0.5), 0, 0, np.sqrt(0.5)], abs=1e-15
    )
    assert log.meta["lat_rad"] == pytest.approx(60 * DEG)
    sd.write(log, tmp_path / "log.parquet")
    again = sd.read(tmp_path / "log.parquet")
    assert np.array_equal(again.imu.acc, log.imu.acc)
    assert again.meta["device"] == "mpu6050 + hmc5883l"


@pytest.mark.parametrize("name", [name for name in names() if name != "static_4h"])
def test_every_shipped_scenario_records_the_same_for_the_same_seed(name):
    scenario = load(name)
    assert scenario.description
    first, second, other = scenario.record(5), scenario.record(5), scenario.record(6)
    assert np.array_equal(first.imu.gyr, second.imu.gyr)
    assert np.array_equal(first.imu.t, second.imu.t)
    if name not in ("coning", "sculling"):  # these are without noise
        assert not np.array_equal(first.imu.gyr, other.imu.gyr)
    assert first.reference.attitude is not None
    assert np.isfinite(first.imu.gyr).all()


def test_scenarios_are_shipped_for_every_motion():
    kinds = {type(load(name).motion) for name in names()}
    assert kinds == set(MOTIONS.values())
    four_hours = load("static_4h")
    assert four_hours.timing.duration == 4 * 3600.0
    assert four_hours.device.gyr.sampling.rate == 100.0


def test_individual_parts_differ_by_seed():
    table = {
        "time": {"duration_s": 1, "rate_hz": 100},
        "motion": {"kind": "static"},
        "sensors": {"presets": "adis16405", "individual": True},
    }
    scenario = from_mapping(table)
    a, b = (scenario.record(seed).imu.gyr.mean(axis=0) for seed in (1, 2))
    assert np.abs(a - b).max() > 0.2 * DPS  # 1 sigma is 3 deg/s


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rate_rpm", "rate_rmp", r"\[motion\]: unknown key 'rate_rmp'; .* is 'rate_rpm'"),
        ("rate_rpm = 45", "rate = 45", r"unknown key 'rate'; the nearest name is"),
        ('"turntable"', '"turntabel"', r"\[motion\], kind: .*nearest name is 'turntable'"),
        ("[place]", "[plase]", "unknown key 'plase'; the nearest name is 'place'"),
        ("lat_deg = 60", "lat_deg = 'x'", r"\[place\], lat_deg: must be a number, got 'x'"),
        ('"mpu6050"', '"mpu6500"', "presets: .*the nearest name is 'mpu6050'"),
        ("[sensors.star]", "[sensors.stars]", "unknown key 'stars'; the nearest name is 'star'"),
        ("white_dps_per", "wite_dps_per", r"\[sensors.gyr\].noise: unknown key 'wite_dps"),
        ("spin_s = 0.5", "spin_s = -1", r"\[motion\]: `spin` must be positive"),
        ("spin_s = 0.5", "spin_s = 1\nspin_ms = 5", "'spin_ms' is given twice"),
        ("= 50\n[place]", "= 70\n[place]", "`reference_rate` must be `rate` divided by a whole"),
        ("[sensors.star]", "[sensors.gyr.noise.white]\n[sensors.star]", "unknown key 'white'"),
        ("[mount]\nrpy_deg = [0, 0, 90]", "", None),
    ],
)  # fmt: skip
def test_what_a_file_has_wrong_is_named_with_the_way_out(quick, old, new, message):
    assert old in QUICK
    quick.write_text(QUICK.replace(old, new))
    if message is None:
        assert load(quick).record().reference.mount is None
        return
    with pytest.raises(InputError, match=message):
        load(quick)


def test_files_that_are_no_scenarios_are_refused(tmp_path):
    with pytest.raises(InputError, match="no such file, nor a scenario of this name; the nearest"):
        load("turntable33")
    broken = tmp_path / "broken.toml"
    broken.write_text("[motion\nkind = 1")
    with pytest.raises(FormatError, match="must be TOML"):
        load(broken)
    broken.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FormatError, match="must be text in UTF-8"):
        load(broken)
    with pytest.raises(InputError, match="`presets` must be a list of names, got 3"):
        from_mapping({"motion": {"kind": "static"}, "sensors": {"presets": 3}})
    with pytest.raises(InputError, match="must be a number of at most 64 bits"):
        from_mapping({"motion": {"kind": "turntable", "rate_rpm": 10**400}})
    with pytest.raises(InputError, match="'motion' must be a table, got 3"):
        from_mapping({"motion": 3})
    with pytest.raises(InputError, match="both `gyr` and `acc` or neither"):
        from_mapping({"motion": {"kind": "static"}, "sensors": {"gyr": {}}})


def test_command_lists_the_shipped_scenarios(capsys):
    assert main(["simulate", "--list"]) == 0
    out = capsys.readouterr().out
    assert [line.split()[0] for line in out.splitlines()] == list(names())


def test_command_writes_a_recording_by_path_or_name(quick, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", str(quick), "--seed", "7"]) == 0
    assert "quick.parquet: imu, mag, temperature, star" in capsys.readouterr().out
    assert np.array_equal(sd.read("quick.parquet").imu.gyr, load(quick).record(7).imu.gyr)
    assert main(["simulate", "static", "-o", "still.parquet"]) == 0
    assert sd.read("still.parquet").meta["name"] == "static"


def test_command_refuses_in_one_line(quick, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["simulate"]) == 2
    assert "see strapdown simulate --list" in capsys.readouterr().err
    assert main(["simulate", "flihgt"]) == 2
    assert "the nearest name is 'flight'" in capsys.readouterr().err
    assert main(["simulate", str(quick), "-o", "a.parquet"]) == 0
    assert main(["simulate", str(quick), "-o", "a.parquet"]) == 2
    assert "give --force to replace it" in capsys.readouterr().err
    assert main(["simulate", str(quick), "-o", "a.parquet", "--force"]) == 0
    assert main(["simulate", str(quick), "--seed", "-1"]) == 2
