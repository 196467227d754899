"""The outage study against drives whose errors are known on paper."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from strapdown.evaluation import outages
from strapdown.recording import (
    Gnss,
    Imu,
    MountReference,
    PositionReference,
    Recording,
    Reference,
)
from strapdown.solution import Solution, Status

LAT, LON = math.radians(46.0), math.radians(11.0)
END = 500.0
DRIFT = 0.1  # metres north per second without fixes, of the made-up estimator
METRE = 1.0 / 6.366e6  # of latitude, near enough for 0.2 % of an error


def drive(speed=10.0, mount_from=0.0, bad=None):
    """Due east at constant speed; reference at 10 Hz, fixes at 2 Hz, inertial samples at 10 Hz."""
    t = np.arange(0.0, END, 0.1)
    east = 1.0 / (6.3885e6 * math.cos(LAT))
    lla = np.stack((np.full_like(t, LAT), LON + speed * east * t, np.full_like(t, 200.0)), axis=1)
    v_n = np.tile((0.0, speed, 0.0), (len(t), 1))
    valid = np.ones(len(t), np.bool_)
    if bad is not None:
        valid &= ~((t >= bad[0]) & (t <= bad[1]))
    q = np.tile((1.0, 0.0, 0.0, 0.0), (len(t), 1))
    return Recording(
        imu=Imu(t=t, gyr=np.zeros((len(t), 3)), acc=np.tile((0.0, 0.0, -9.8), (len(t), 1))),
        gnss=Gnss(t=t[::5], lla=lla[::5], v_n=v_n[::5]),
        reference=Reference(
            position=PositionReference(t=t, lla=lla, v_n=v_n, valid=valid),
            mount=MountReference(t=t, q_vb=q, valid=t >= mount_from),
        ),
    )


@dataclass(frozen=True)
class Drifting:
    """Follows the truth while there are fixes, and goes north at DRIFT without."""

    NAME = "drifting"
    ready: float = 0.0

    def run(self, rec, diagnostics=True):
        t = rec.imu.t
        truth = drive().reference.position
        last = rec.gnss.t[np.maximum(np.searchsorted(rec.gnss.t, t, side="right") - 1, 0)]
        lla = truth.lla.copy()
        without = np.where(t - last > 1.0, t - last - 0.5, 0.0)
        lla[:, 0] += DRIFT * without * METRE
        status = np.where(t < self.ready, int(Status.ALIGNING), 0)
        return Solution(
            t=t, q_nb=np.tile((1.0, 0, 0, 0), (len(t), 1)), status=status, filter=self.NAME,
            heading_reference="true", lla=lla, v_n=truth.v_n,
        )  # fmt: skip


def test_windows_begin_every_120_s_from_their_phase():
    rec = drive()
    for phase, expected in ((120.0, [120, 240, 360]), (180.0, [180, 300, 420])):
        found = outages.windows(rec.reference.position, rec.reference.mount, 60.0, phase)
        np.testing.assert_array_equal(found, expected)


def test_the_reference_alone_fixes_the_windows():
    slow = drive(speed=1.9)
    assert not len(outages.windows(slow.reference.position, slow.reference.mount, 10.0, 120.0))
    late = drive(mount_from=200.0)
    found = outages.windows(late.reference.position, late.reference.mount, 10.0, 120.0)
    np.testing.assert_array_equal(found, [240, 360, 480])
    bad = drive(bad=(129.0, 131.0))  # the end of the first window
    found = outages.windows(bad.reference.position, bad.reference.mount, 10.0, 120.0)
    np.testing.assert_array_equal(found, [240, 360, 480])


def test_only_the_windows_lose_their_fixes():
    rec = drive()
    blanked = outages.blank(rec, [120.0, 240.0], 10.0)
    gone = np.setdiff1d(rec.gnss.t, blanked.gnss.t)
    inside = [t for t in rec.gnss.t if 120 <= t <= 130 or 240 <= t <= 250]
    np.testing.assert_array_equal(gone, inside)
    assert len(rec.gnss) == len(drive().gnss), "the recording is left as it was"


@pytest.mark.parametrize("length", [10.0, 30.0, 60.0])
def test_errors_are_those_at_the_end_of_the_window(length):
    study = outages.outage_study([("a", drive())], Drifting(), lengths=[length])
    # the last fix before a window is half a second old when the window begins
    expected = DRIFT * length
    for window in study.windows:
        assert window.horizontal_error_m == pytest.approx(expected, rel=5e-3)
        # in a tangent plane the ground falls away by d^2 / 2R, 3 um in 6 m
        assert window.vertical_error_m == pytest.approx(0.0, abs=1e-5)
        assert window.percent_of_distance == pytest.approx(
            100 * expected / (10 * length), rel=5e-3
        )
        assert window.heading_error_deg is None
    assert study.summary()[0]["n"] == len(study.windows)


def test_a_window_without_solution_counts_as_infinite():
    study = outages.outage_study([("a", drive())], Drifting(ready=200.0), lengths=[10.0])
    without = [w.start_s for w in study.windows if not w.solution]
    assert without == [120.0, 180.0]
    row = study.as_dict()["summary"][0]
    assert row["without_solution"] == 2
    assert row["p95_m"] is None, "infinite"
    assert row["median_m"] == pytest.approx(1.0, rel=5e-3)
    assert study.starts[0].first_solution_s == pytest.approx(200.0, abs=1e-9)


def test_quantiles_are_linear_and_know_infinity():
    values = np.array([4.0, 1.0, 3.0, 2.0])
    for share in (0.0, 0.3, 0.5, 0.95, 1.0):
        assert outages.quantile(values, share) == pytest.approx(np.quantile(values, share))
    assert outages.quantile(np.array([1.0, 2.0, math.inf]), 0.5) == 2.0
    assert outages.quantile(np.array([1.0, 2.0, math.inf]), 0.6) == math.inf


def test_refusals_say_what_is_missing():
    bare = replace(drive(), reference=None)
    with pytest.raises(ValueError, match="a must have a reference position"):
        outages.outage_study([("a", bare)], Drifting())
    with pytest.raises(ValueError, match="must have a smoother, drifting has none"):
        outages.outage_study([("a", drive())], Drifting(), smooth=True)
    with pytest.raises(ValueError, match="`lengths` must be positive"):
        outages.outage_study([("a", drive())], Drifting(), lengths=[0.0])
