"""The page of a characterisation shows what was found, and nothing that was not."""

import dataclasses

import numpy as np
import pytest
from truth.noise import at_rest

from strapdown.noise import Coefficient, Status, characterize
from strapdown.recording import Imu, Recording
from strapdown.report import noise as page
from strapdown.units import DPS


@pytest.fixture(scope="module")
def found():
    rng = np.random.default_rng(3)
    t = np.arange(30_000) / 50.0
    gyr = np.column_stack([at_rest(rng, t.size, 50.0, N=2e-4, K=1e-4) for _ in range(3)])
    acc = np.column_stack([at_rest(rng, t.size, 50.0, N=3e-3, bias=b) for b in (0, 0, -9.8)])
    return characterize(Recording(imu=Imu(t=t, gyr=gyr, acc=acc), meta={"name": "bench"}))


def test_every_sensor_has_a_section_and_all_have_one_together(found):
    composed = page.compose(found)
    assert [s.title for s in composed.sections][:3] == [
        "Gyroscope", "Accelerometer", "Between sensors",
    ]  # fmt: skip
    assert "bench" in composed.subtitle
    assert composed.title == "Noise: gyroscope, accelerometer"


def test_terms_that_were_not_seen_have_no_line(found):
    curve = found.curves["gyr"][0]
    c = found.record["gyr"].axes[0].coefficients
    assert c.K.observed
    panel = page._deviation_panel("x", curve, c, "deg/s", DPS)
    names = [item.name for item in panel.items]
    assert "N random walk" in names
    assert "K rate random walk" in names
    assert not any(name.startswith(("B ", "R ", "Q ")) for name in names)
    measured = panel.items[names.index("measured")]
    np.testing.assert_allclose(measured.y * DPS, curve.dev)
    fit = panel.items[names.index("fit")]
    np.testing.assert_allclose(fit.y * DPS, c.deviation(fit.x))


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (dict(status=Status.OBSERVED, value=0.02, std=0.001), "2 ± 0.1"),
        (dict(status=Status.DOUBTFUL, value=0.02, std=0.001), "2 ± 0.1 (doubtful)"),
        (dict(status=Status.NOT_OBSERVABLE, high=0.0456), "< 4.6"),
        (dict(status=Status.NOT_OBSERVABLE), "not observable"),
    ],
)
def test_cells_say_value_limit_or_doubt(given, text):
    assert page.cell(Coefficient(symbol="N", **given), 0.01) == text


def test_remarks_on_numbers_that_are_given_are_listed(found):
    gyr = found.record["gyr"]
    axis = gyr.axes[2]
    doubtful = dataclasses.replace(
        axis.coefficients.N, status=Status.DOUBTFUL, remark="the slope is -0.35"
    )
    axis = dataclasses.replace(
        axis, coefficients=dataclasses.replace(axis.coefficients, N=doubtful)
    )
    record = dataclasses.replace(
        found.record,
        sensors={"gyr": dataclasses.replace(gyr, axes=(*gyr.axes[:2], axis), remarks=("a gap",))},
    )
    notes = page._notes(dataclasses.replace(found, record=record))
    assert "gyr: a gap" in notes
    assert "gyr z, N (doubtful): the slope is -0.35" in notes
    assert not any("does not show" in note for note in notes)


def test_page_is_one_file_without_a_network(found, tmp_path):
    text = page.write(found, tmp_path / "noise.html").read_text(encoding="utf-8")
    for words in ("Allan deviation", "maximum likelihood", "Read off the slopes", "sqrt(2) N"):
        assert words in text, words
    assert "<script src" not in text
