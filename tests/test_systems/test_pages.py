"""The pages of the systems say what the command says."""

from pathlib import Path

import pytest
from test_systems.shown import rows, shown

from strapdown.systems import Verdict, parts

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.parametrize("system", ["platform", "indoor", "uav"])
def test_page_counts_the_verdicts_of_every_part(system):
    lines = (DOCS / f"system-{system}.md").read_text("utf-8").splitlines()
    table = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in lines
        if line.startswith("| `")
    ]
    assert [cells[0].strip("`") for cells in table] == [part.name for part in parts(system)]
    for name, _, *counts in table:
        found = [row.verdict for row in shown(system, name.strip("`")).rows]
        assert [int(c) for c in counts] == [found.count(verdict) for verdict in Verdict]


def test_figures_in_the_text_of_the_platform():
    frequency, k = rows("platform", "frequency"), rows("platform", "mag-factor")
    at = "9.1, {}, frequency at which RMS of q3 is 3 sigma"
    assert round(frequency[at.format("space")].here) == 69
    assert round(frequency[at.format("terrestrial")].here) == 91
    averaged = "9.1, space, 20 Hz, gyroscope averaging over its steps, RMS of q3"
    plain = "figures 9.3, 9.4, space, 20 Hz, RMS of q3"
    assert frequency[averaged].here < 0.1 * frequency[plain].here
    slow = "8.1.1, terrestrial, 5 Hz, v2 against v1, RMS of q3, relative"
    assert f"{frequency[slow].here:.1e}" == "3.5e-04"
    (drop,) = (row.here for item, row in k.items() if "drops drastically" in item)
    assert float(drop.split("factor of ")[1].split()[0]) > 10.0


def test_figures_in_the_text_of_the_indoor_unit():
    servo = rows("indoor", "servo")
    assert round(servo["6.3.1, swings of 0.7 s, slope of yaw"].here, 2) == 3.13
    assert round(servo["6.3.1, swings of 0.7 s, yaw 15 s later"].here) == 157
    left = servo["6.2.3, swings of 0.7 s, slope after compensation of the zero-rate"].here
    assert abs(float(left.split()[0])) < 0.015
    assert round(servo["6.3.1, swings of 0.3 s, size of the swings"].here) == 53
    assert round(servo["6.3.1, swings of 0.3 s, slope of yaw"].here, 1) == 2.2


def test_figures_in_the_text_of_the_uav():
    found = rows("uav", "ahrs")
    worst = [row.here for item, row in found.items() if "multi-mode corrected, largest" in item]
    assert max(worst) < 0.8
    roll, yaw = (found[f"S3, figure 4.{k}, corrected, {what}"].here for k, what in
                 ((7, "roll in turns"), (9, "yaw")))  # fmt: skip
    assert roll.startswith("mean errors 2.6 ")
    assert yaw.startswith("mean errors 2.4 ")
    better = found["S3, 4.2.1, corrected, improvement, mean of the three angles"].here
    assert round(better) == 92
    printed = found["S1, 4.2.1, multi-mode as printed, largest error of yaw after 30 s"].here
    assert f"{printed:.1f}" == "1.3"
    assert (
        round(found["S1, 4.2.1, multi-mode corrected, largest error of yaw after 30 s"].here, 1)
        == 0.5
    )
    lost = [row.here for item, row in rows("uav", "outages").items()
            if "multi-mode corrected, largest" in item]  # fmt: skip
    assert (round(min(lost), 1), round(max(lost), 1)) == (1.3, 2.4)
    helped = [
        row.here for item, row in rows("uav", "outages").items() if "manoeuvres in R" in item
    ]
    assert max(helped) < 1.0
