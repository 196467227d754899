"""What has defaults works with them."""

import dataclasses

import numpy as np
import pytest

import strapdown as sd


@pytest.fixture(scope="module")
def rec():
    return sd.simulation.demo.recording(duration=12.0, rate=50.0)


@pytest.fixture(scope="module")
def sol(rec):
    return sd.attitude.Mekf().run(rec)


@pytest.mark.parametrize("entry", [e for e in sd.estimators.entries() if not e.needs])
def test_every_estimator_runs_with_its_defaults(entry, rec):
    flt = sd.estimators.create(entry.name)
    assert flt == entry.cls()
    sol = flt.run(rec)
    assert sol.filter == entry.name
    assert np.isfinite(sol.q_nb).all()
    assert np.linalg.norm(sol.q_nb, axis=1) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("entry", list(sd.estimators.entries()))
def test_every_parameter_of_an_estimator_has_a_default(entry):
    missing = dataclasses.MISSING
    for field in dataclasses.fields(entry.cls):
        assert field.default is not missing or field.default_factory is not missing


@pytest.mark.parametrize(
    "call",
    [
        lambda rec, sol, path: sd.simulation.demo.truth(),
        lambda rec, sol, path: sd.simulation.demo.SensorErrors(),
        lambda rec, sol, path: sd.evaluation.attitude_errors(sol, rec.reference).summary(),
        lambda rec, sol, path: sd.report.write(sol, rec, path / "report.html"),
        lambda rec, sol, path: sd.report.compose(sol, rec),
        lambda rec, sol, path: sd.write(rec, path / "log.parquet"),
        lambda rec, sol, path: sd.rotation.mean_rotation(sol.q_nb),
        lambda rec, sol, path: sd.earth.normal_gravity(0.8),
        lambda rec, sol, path: sd.units.parse_unit("dps"),
        lambda rec, sol, path: sd.attitude.declination(rec),
        lambda rec, sol, path: sd.attitude.Mekf().tracker(),
        lambda rec, sol, path: sd.estimators.preferred(rec),
    ],
)
def test_public_functions_run_with_their_defaults(call, rec, sol, tmp_path):
    call(rec, sol, tmp_path)


def test_what_is_written_is_read_with_defaults(rec, tmp_path):
    sd.write(rec, tmp_path / "log.parquet")
    again = sd.read(tmp_path / "log.parquet")
    assert np.array_equal(again.imu.acc, rec.imu.acc)
    assert sd.io.read_raw(tmp_path / "log.parquet").tables


@pytest.mark.parametrize(
    "call",
    [
        lambda: sd.attitude.Mekf().run("log.csv"),
        lambda: sd.attitude.RobustEskf().smooth("log.csv"),
        lambda: sd.attitude.declination("log.csv"),
        lambda: sd.doctor.examine("log.csv"),
        lambda: sd.noise.characterize("log.csv"),
        lambda: sd.estimators.preferred("log.csv"),
        lambda: sd.evaluation.blank("log.csv", []),
    ],
)
def test_a_path_in_place_of_a_recording_is_told_how_to_become_one(call):
    with pytest.raises(TypeError, match=r"must be a Recording, got str; strapdown\.read\(path\)"):
        call()


def test_a_recording_in_place_of_its_reference_is_told_where_that_is(rec, sol):
    with pytest.raises(TypeError, match=r"must be a Reference, got Recording; .*rec\.reference"):
        sd.evaluation.attitude_errors(sol, rec)
    with pytest.raises(TypeError, match=r"must be a Solution, got str"):
        sd.io.write_solution("sol", "x.csv")
