"""``strapdown reproduce``: the table, its JSON, its page, and what is refused."""

import json

KEYS = {"item", "thesis", "here", "unit", "tolerance", "verdict", "remark"}


def test_low_pass_study_can_be_reached_and_recommends_188_hz(command):
    done = command("reproduce", "platform", "--part", "low-pass")
    assert done.status == 0
    lines = done.out.splitlines()
    (chosen,) = (line for line in lines if line.startswith("5.3.1, cut-off chosen"))
    assert chosen.split()[3:7] == ["188", "188", "Hz", "+-1e-09"]
    assert " met " in chosen
    assert lines[-1] == "16 met, 0 missed, 7 recovered, 14 not given, 7 info"


def test_each_row_is_one_line_and_each_remark_stands_once_below(command):
    done = command("reproduce", "indoor", "--part", "rotations")
    lines = done.out.splitlines()
    assert lines[1].split() == [
        "item", "thesis", "here", "unit", "tolerance", "verdict", "remark",
    ]  # fmt: skip
    rows = lines[3:13]
    assert all(line.startswith("(4.") or line.startswith("quat2angle") for line in rows)
    notes = [line for line in lines if line.startswith("[")]
    assert [note.split("]")[0] for note in notes] == ["[1", "[2", "[3", "[4"]
    assert rows[0].endswith("met        [1]")


def test_json_holds_the_rows_and_the_same_seed_gives_the_same_figures(command):
    one, two, other = (
        json.loads(
            command("reproduce", "platform", "--part", "temperature", "--json", "--seed", seed).out
        )
        for seed in (0, 0, 1)
    )
    assert one == two
    assert one != other
    assert one["system"] == "platform"
    assert all(set(row) == KEYS for row in one["rows"])
    assert {row["verdict"] for row in one["rows"]} == {"recovered", "info"}


def test_report_holds_table_and_figures(command, tmp_path):
    done = command("reproduce", "platform", "--part", "temperature", "-o", "page.html")
    assert done.status == 0
    text = (tmp_path / "page.html").read_text("utf-8")
    assert "table 6.5, gyr y, test 1, p1" in text
    assert "Figures 6.12 and 6.13" in text
    assert done.out.splitlines()[-1].endswith("page.html")


def test_unknown_system_and_part_are_refused_in_one_line(command):
    for arguments, word in (
        (("reproduce", "plattform"), "platform"),
        (("reproduce", "platform", "--part", "lowpass"), "low-pass"),
    ):
        done = command(*arguments)
        assert done.status == 2
        assert done.out == ""
        assert len(done.err.strip().splitlines()) == 1
        assert word in done.err
