"""What README, docs and examples show is what happens."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
PAGES = [ROOT / "README.md", *(ROOT / "docs" / p for p in ("quickstart.md", "mechanisations.md"))]
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def run(arguments: list[str], folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        cwd=folder,
        env={**os.environ, "PYTHONWARNINGS": "error"},
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def shown(text: str) -> list[str]:
    """Lines without what depends on the machine: times taken, trailing space, table rules."""
    lines = (line.rstrip() for line in text.strip().splitlines())
    return [line for line in lines if not line.startswith("took ") and set(line) - {"─"}]


def assert_same(printed: list[str], page: list[str]) -> None:
    """Compare words; a number may be off by one in its last digit, which processors differ in."""
    words, expected = " ".join(printed).split(), " ".join(page).split()
    hint = f"run `make pages` if the change is meant:\n{printed}\n{page}"
    assert len(words) == len(expected), hint
    for word, want in zip(words, expected, strict=True):
        number = re.fullmatch(r"-?\d+(?:\.(\d+))?(%?)", want)
        if number is None or word == want:
            assert word == want, hint
        else:
            unit = 10.0 ** -len(number[1] or "")
            assert abs(float(word.rstrip("%")) - float(want.rstrip("%"))) < 1.5 * unit, hint


def blocks(page: Path) -> list[tuple[str, str]]:
    return FENCE.findall(page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_short_and_runs(example, tmp_path):
    assert len(example.read_text(encoding="utf-8").splitlines()) <= 80
    assert run([str(example)], tmp_path).strip()
    assert list(tmp_path.iterdir()) == []


def test_examples_print_what_their_text_predicts(tmp_path):
    found = {path.stem: run([str(path)], tmp_path) for path in EXAMPLES}
    assert found["real_time_loop"].count("equal") == found["real_time_loop"].count("True") == 2
    figures = dict(
        re.findall(r"^(\w+) +inclination +([\d.]+)", found["attitude_from_arrays"], re.MULTILINE)
    )
    assert float(figures["mekf"]) < 1.0
    assert float(figures["gyro"]) > 2.0 * float(figures["mekf"])
    drive = re.findall(r"([\d.]+) m RMSE, in .* ([\d.]+) m", found["a_drive_with_an_outage"])
    alone, coupled, smoothed = ([float(part) for part in row] for row in drive)
    assert alone[1] > 100.0 * coupled[1] > 100.0 * smoothed[1]
    assert coupled[1] < 15.0
    assert "refused: 'g1', 'g2', 'g3' state no unit" in found["a_log_that_does_not_explain_itself"]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_code_on_the_page_prints_what_the_page_shows(page, tmp_path):
    """Each ``python`` block runs after those before it; a ``text`` block is what it prints."""
    pieces = blocks(page)
    code, compared = "", 0
    for (kind, body), (next_kind, output) in zip(pieces, [*pieces[1:], ("", "")], strict=True):
        if kind != "python":
            continue
        code += body
        if next_kind == "text":
            printed = run(["-c", code], tmp_path)
            assert_same(shown(printed)[-len(shown(output)) :], shown(output))
            compared += 1
    assert compared


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_commands_on_the_page_print_what_the_page_shows(page, tmp_path):
    """In ``console`` blocks, the lines after ``$ strapdown ...`` are what it prints."""
    folder, shared = tmp_path / "project", ROOT.parent / "shared"
    folder.mkdir()
    (tmp_path / "shared").symlink_to(shared)
    compared = 0
    for kind, body in blocks(page):
        if kind != "console":
            continue
        for part in re.split(r"^\$ ", body, flags=re.MULTILINE)[1:]:
            line, _, output = part.partition("\n")
            words = shlex.split(line, comments=True)
            if not output.strip() or ("../shared" in line and not shared.is_dir()):
                continue
            assert_same(shown(run(["-m", *words], folder)), shown(output))
            compared += 1
    assert compared
