"""Calibrations beside imucal and magyc's two-step, on the same samples."""

import statistics
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import calibration_peers as peers

pytestmark = pytest.mark.skipif(
    not peers.PEERS.is_file(), reason="needs .venv/peers, which `make bench` installs"
)


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    """Ten draws: the table of the docs has more."""
    monkeypatch.setattr(peers, "DRAWS", 10)


def assert_no_worse(here, beside, *, by):
    """Means over the draws at most `by` times the peer's."""
    assert not here.failed
    for name, values in here.errors.items():
        assert statistics.fmean(values) < by * statistics.fmean(beside.errors[name]), name


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
    assert_no_worse(here, beside, by=1.5)  # ten draws of the same spread: 1.35 at two sigma
    assert max(here.errors["hard_ut"]) < 0.08
    assert statistics.median(here.seconds) < statistics.median(beside.seconds)


def test_one_hemisphere_beside_the_two_step():
    here, _ = peers.magnetometer(1000, 0.0)
    assert not here.errors or max(here.errors["hard_ut"]) < 0.5
    assert not here.errors or max(here.errors["direction_deg"]) < 1.0
