"""The folder of results: whole or absent, its own replaced, a foreign one never."""

import os
from pathlib import Path

import pytest

from strapdown.cli import _output
from strapdown.errors import InputError


def put(folder: Path, *names: str, mark: str = "strapdown 0.1.0") -> None:
    """Write results as a command does."""
    from strapdown.cli._console import to_json

    with _output.made_aside(folder) as aside:
        for name in names:
            (aside / name).write_text(name)
        summary = {_output.MARK: mark, "outputs": {n: str(folder / n) for n in names}}
        _output.write_text(aside / _output.SUMMARY, to_json(summary))


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


@pytest.mark.parametrize(
    ("log", "folder"),
    [
        ("a/log.csv", "log.strapdown"),
        ("log.csv.gz", "log.strapdown"),
        ("02_slow.v2.mat", "02_slow.v2.strapdown"),
        ("plain", "plain.strapdown"),
    ],
)
def test_default_folder_has_the_stem_of_the_log(log, folder):
    assert _output.default_folder(Path(log)) == Path(folder)


def test_default_folder_of_a_folder_keeps_its_whole_name(tmp_path):
    drive = tmp_path / "drive-2026.03"
    drive.mkdir()
    assert _output.default_folder(drive) == Path("drive-2026.03.strapdown")


def test_results_appear_only_when_all_went_well(tmp_path):
    def half() -> None:
        with _output.made_aside(tmp_path / "out") as aside:
            (aside / "solution.parquet").write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        half()
    assert names(tmp_path) == []


def test_own_results_are_replaced_and_older_files_do_not_stay(tmp_path):
    put(tmp_path / "out", "report.html", "solution.parquet")
    put(tmp_path / "out", "solution.parquet")
    assert names(tmp_path) == ["out"]
    assert names(tmp_path / "out") == ["solution.parquet", "summary.json"]


def test_own_results_stay_when_the_new_ones_fail(tmp_path):
    put(tmp_path / "out", "solution.parquet")
    with pytest.raises(RuntimeError), _output.made_aside(tmp_path / "out"):
        raise RuntimeError
    assert names(tmp_path / "out") == ["solution.parquet", "summary.json"]
    assert names(tmp_path) == ["out"]


def test_empty_folder_is_taken(tmp_path):
    (tmp_path / "out").mkdir()
    put(tmp_path / "out", "solution.parquet")
    assert names(tmp_path / "out") == ["solution.parquet", "summary.json"]


def test_missing_parents_are_made(tmp_path):
    put(tmp_path / "a" / "b" / "out", "solution.parquet")
    assert names(tmp_path / "a" / "b") == ["out"]


def test_link_to_own_results_stays_a_link(tmp_path):
    put(tmp_path / "out", "solution.parquet")
    (tmp_path / "link").symlink_to("out")
    put(tmp_path / "link", "report.html")
    assert (tmp_path / "link").is_symlink()
    assert names(tmp_path / "out") == ["report.html", "summary.json"]


@pytest.mark.parametrize("content", ["{}", "[]", "not json", '{"made_by": "another program"}'])
def test_folder_with_another_summary_is_refused(tmp_path, content):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "summary.json").write_text(content)
    with pytest.raises(InputError, match=r"not made by strapdown, so it is not replaced; .* -o"):
        put(tmp_path / "out")
    assert (tmp_path / "out" / "summary.json").read_text() == content


def test_foreign_folder_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="not made by strapdown"):
        put(tmp_path)
    assert names(tmp_path) == ["thesis.tex"]


def test_foreign_file_among_own_results_is_kept(tmp_path):
    put(tmp_path / "out", "solution.parquet")
    (tmp_path / "out" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"holds 'notes\.txt', which strapdown did not write"):
        put(tmp_path / "out", "solution.parquet")
    assert (tmp_path / "out" / "notes.txt").read_text() == "mine"


def test_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(InputError, match=r"-o must name a folder, .*out is a file"):
        put(tmp_path / "out")
    assert (tmp_path / "out").read_text() == "a file"


def test_results_may_be_read_by_whom_the_umask_allows(tmp_path):
    mask = os.umask(0o022)
    try:
        put(tmp_path / "out", "solution.parquet")
    finally:
        os.umask(mask)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o755
