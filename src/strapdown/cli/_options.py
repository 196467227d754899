"""Options that several verbs share, and reading a log as they say."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapdown.cli import _errors
from strapdown.errors import InputError

if TYPE_CHECKING:
    from strapdown.recording import Recording

Filter = Annotated[
    str | None,
    typer.Option("--filter", metavar="NAME", help="Estimator; see `strapdown filters`."),
]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="A parameter of the estimator; repeatable."),
]
Sensor = Annotated[
    str | None,
    typer.Option(
        "--sensor",
        metavar="PRESET|FILE",
        help="Its noise goes to the estimator: mpu6050, or the noise.toml of `characterize`.",
    ),
]
Calibration = Annotated[
    Path | None, typer.Option("--calibration", metavar="FILE", help="Calibration to apply first.")
]
Smooth = Annotated[bool, typer.Option("--smooth", help="Use the estimator's offline twin.")]
Folder = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Results; default LOG-STEM.strapdown."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")]
NoReport = Annotated[bool, typer.Option("--no-report", help="Leave out report.html.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show where in the code an error arose.")]

_READING = "How to read the log"
_FILES = "One file per sensor"


def _option(name: str, metavar: str, text: str, panel: str = _READING) -> Any:
    return typer.Option(name, metavar=metavar, help=text, rich_help_panel=panel)


def _file(name: str, text: str) -> Any:
    return Annotated[Path | None, _option(f"--{name}", "FILE", text, _FILES)]


# Sensors that may have a file of their own.
_SENSOR_FILES = {
    "imu": _file("imu", "Gyroscope and accelerometer."),
    "gyr": _file("gyr", "Gyroscope."),
    "acc": _file("acc", "Accelerometer."),
    "mag": _file("mag", "Magnetometer."),
    "gnss": _file("gnss", "GNSS fixes."),
    "baro": _file("baro", "Barometer."),
    "temperature": _file("temperature", "Thermometer."),
}
_READ_OPTIONS = {
    "format": Annotated[
        str | None, _option("--format", "NAME", "Format; found out from the content by default.")
    ],
    "columns": Annotated[
        str | None, _option("--columns", "gyr_x=w1,t=0", "Which column is what.")
    ],
    "units": Annotated[
        str | None, _option("--units", "gyr=dps,acc=g", "Units of columns that name none.")
    ],
    "rate": Annotated[
        float | None, _option("--rate", "HZ", "Samples per second of a log without times.")
    ],
    "axes": Annotated[
        str | None, _option("--axes", "x,-y,-z", "The box's axes in terms of the recorded ones.")
    ],
    "delimiter": Annotated[
        str | None, _option("--delimiter", "CHAR", "What separates columns of text.")
    ],
    "repair_time": Annotated[
        str | None,
        _option("--repair-time", "drop|sort", "What to do with times that do not increase."),
    ],
    "start": Annotated[
        float | None, _option("--from", "S", "Leave out what is earlier, in seconds.")
    ],
    "stop": Annotated[
        float | None, _option("--to", "S", "Leave out this time and what is later.")
    ],
    "reference": Annotated[
        Path | None, _option("--reference", "FILE", "What a better instrument said.")
    ],
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Which files to read, and how.

    Parameters
    ----------
    log : path, optional
        File or folder.
    files : mapping of str to path
        One file per sensor.
    options : mapping
        Options of `strapdown.io.read` that were given.
    """

    log: Path | None
    files: Mapping[str, Path] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def main(self) -> Path:
        """The path that names the results."""
        paths = [*([self.log] if self.log is not None else []), *self.files.values()]
        if not paths:
            raise InputError(
                "there is no log to read; give LOG, or a file per sensor such as --imu and --mag."
            )
        return paths[0]

    def read(self) -> "Recording":
        """Return the recording that the files hold."""
        from strapdown import io

        main = self.main
        with _errors.given(main):
            rec: Recording = io.read(self.log, **{**self.files, **self.options})
            return rec


Sources = tuple[Source, ...]


def reads_log(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb that takes a `Source` as ``source`` the options that make one up."""
    log = Annotated[
        Path | None,
        typer.Argument(metavar="LOG", help="File or folder.", show_default=False),
    ]
    return _with_reading_options(verb, "source", log, lambda sources: sources[0])


def reads_logs(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb that takes several of them as ``sources`` the options that make them up."""
    logs = Annotated[
        list[Path] | None,
        typer.Argument(metavar="LOG...", help="Files or folders.", show_default=False),
    ]
    return _with_reading_options(verb, "sources", logs, lambda sources: sources)


def _with_reading_options(
    verb: Callable[..., None],
    name: str,
    argument: Any,
    value: Callable[[Sources], "Source | Sources"],
) -> Callable[..., None]:
    """Return the command of a verb, whose parameter `name` is made from options."""
    own = inspect.signature(verb).parameters
    shared = {"log": argument, **_SENSOR_FILES, **_READ_OPTIONS}

    def command(**given: Any) -> None:
        files = {key: given.pop(key) for key in _SENSOR_FILES}
        options = {key: given.pop(key) for key in _READ_OPTIONS}
        logs = given.pop("log")
        sources = tuple(
            Source(
                log=log,
                files={key: path for key, path in files.items() if path is not None},
                options={key: option for key, option in options.items() if option is not None},
            )
            for log in (logs if isinstance(logs, list) and logs else [logs or None])
        )
        verb(**{name: value(sources)}, **given)

    def parameter(key: str, annotation: Any, default: Any = None) -> inspect.Parameter:
        kind = inspect.Parameter.KEYWORD_ONLY
        return inspect.Parameter(key, kind, annotation=annotation, default=default)

    own_parameters = [
        parameter(p.name, p.annotation, p.default) for p in own.values() if p.name != name
    ]
    first, *others = (parameter(key, annotation) for key, annotation in shared.items())
    parameters = [first, *own_parameters, *others]
    command.__name__, command.__doc__ = verb.__name__, verb.__doc__
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return command
