"""The error tree: what catches what, and how a message reads."""

import pickle
from pathlib import Path

import pytest

from strapdown import errors


@pytest.mark.parametrize(
    "cls", [errors.InputError, errors.FormatError, errors.MissingStream, errors.DataGap]
)
def test_bad_input_is_also_a_value_error(cls):
    assert issubclass(cls, errors.StrapdownError)
    assert issubclass(cls, ValueError)


def test_failed_computation_is_not_bad_input():
    assert issubclass(errors.NotConverged, errors.ComputationError)
    assert not issubclass(errors.NotConverged, errors.InputError)


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({}, "`t` must increase, got 2 after 3."),
        ({"file": "a.csv"}, "a.csv: `t` must increase, got 2 after 3."),
        (
            {"file": Path("logs/a.csv"), "stream": "imu", "row": 7, "hint": "use --repair-time"},
            "logs/a.csv, stream imu, row 7: `t` must increase, got 2 after 3; use --repair-time.",
        ),
        ({"row": 0}, "row 0: `t` must increase, got 2 after 3."),
    ],
)
def test_format_error_is_one_sentence_with_its_place(fields, sentence):
    error = errors.FormatError("`t` must increase, got 2 after 3.", **fields)
    assert str(error) == sentence
    assert error.row == fields.get("row")


def test_not_converged_says_how_far_it_came():
    error = errors.NotConverged("ellipsoid fit", 30, 0.0123, "turn the sensor into more poses.")
    assert str(error) == (
        "ellipsoid fit did not converge in 30 iterations, residual 0.0123; "
        "turn the sensor into more poses."
    )


@pytest.mark.parametrize(
    "error",
    [
        errors.FormatError("no columns", file="a.csv", stream="imu", row=3, hint="name them"),
        errors.NotConverged("fit", 3, 0.5, "try again"),
        errors.DataGap("no samples"),
    ],
)
def test_errors_survive_the_way_to_another_process(error):
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is type(error)
    assert str(copy) == str(error)
    assert vars(copy) == vars(error)


def test_expired_model_is_a_warning_of_the_package():
    assert issubclass(errors.ModelExpiredWarning, errors.StrapdownWarning)
    assert issubclass(errors.StrapdownWarning, UserWarning)
