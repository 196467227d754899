"""Calibrations beside imucal and magyc's two-step, on the same samples."""

import statistics

import calibration_peers as peers
import pytest

pytestmark = pytest.mark.skipif(
    not peers.PEERS.is_file(), reason="needs .venv/peers, which `make bench` installs"
)


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    """Five draws: the table of the docs has more."""
    monkeypatch.setattr(peers, "DRAWS", 5)


def assert_no_worse(here, beside, *, by):
    """Medians over the draws at most `by` times the peer's."""
    assert not here.failed
    for name, values in here.errors.items():
        assert statistics.median(values) < by * statistics.median(beside.errors[name]), name


@pytest.mark.parametrize("placing", [0.0, 0.01])
def test_six_positions_and_three_turns_beside_imucal(placing):
    here, beside = peers.ferraris(placing)
    # Placed exactly, both average the same noise. Placed badly, both take the error of placing:
    # one spreads it over twelve parameters, the other over nine.
    assert_no_worse(here, beside, by=2.0)
    if placing == 0.0:
        assert max(here.errors["acc_mg"]) < 1.5  # 0.038 m/s^2 over 500 samples: 0.17 mg an axis


@pytest.mark.parametrize("n", [1000, 5000])
def test_ellipsoid_beside_the_two_step(n):
    here, beside = peers.magnetometer(n, -2.0)
    assert_no_worse(here, beside, by=1.3)
    assert max(here.errors["hard_ut"]) < 0.08
    assert statistics.median(here.seconds) < statistics.median(beside.seconds)


def test_one_hemisphere_beside_the_two_step():
    here, _ = peers.magnetometer(1000, 0.0)
    assert not here.errors or max(here.errors["hard_ut"]) < 0.5
    assert not here.errors or max(here.errors["direction_deg"]) < 1.0
