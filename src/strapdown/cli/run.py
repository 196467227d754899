"""``strapdown run``: the main job."""

from strapdown.cli import _job, _options, _output


@_options.reads_log
def run(
    source: _options.Source,
    filter: _options.Filter = None,
    set_: _options.Set = None,
    sensor: _options.Sensor = None,
    calibration: _options.Calibration = None,
    smooth: _options.Smooth = False,
    folder: _options.Folder = None,
    json: _options.Json = False,
    no_report: _options.NoReport = False,
    debug: _options.Debug = False,
) -> None:
    """Find out what a log holds, estimate, compare with its reference, and report.

    Writes solution.parquet, summary.json and report.html.
    """
    job = _job.Job(
        filter=filter,
        settings=tuple(set_ or ()),
        sensor=sensor,
        calibration=calibration,
        smooth=smooth,
        folder=folder or _output.default_folder(source.main),
        report=not no_report,
        json=json,
    )
    _job.do(job, str(source.main), source.read)
