"""Renew what the pages show: run their code and commands, and put in what is printed.

A ``text`` block is renewed from the ``python`` blocks before it; in a ``console`` block, what
stands below ``$ strapdown ...`` is (``...`` at first). A test compares pages and output likewise.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "README.md", ROOT / "docs" / "quickstart.md", ROOT / "docs" / "mechanisations.md")
FENCE = re.compile(r"^```(python|text|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def output(arguments: list[str], folder: Path) -> str:
    """Return what a Python process prints."""
    done = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, cwd=folder, check=True
    )
    return "".join(line.rstrip() + "\n" for line in done.stdout.strip().splitlines())


def renewed(page: str, folder: Path) -> str:
    """Return the text of a page with its output renewed."""
    code, printed = "", ""

    def block(found: re.Match[str]) -> str:
        nonlocal code, printed
        kind, body = found.groups()
        if kind == "python":
            code += body
        elif kind == "text":
            whole = output(["-c", code], folder)
            body, printed = whole.removeprefix(printed), whole
        else:
            parts = re.split(r"^(?=\$ )", body, flags=re.MULTILINE)
            body = "".join(command(part) for part in parts if part)
        return f"```{kind}\n{body}```"

    def command(part: str) -> str:
        line, _, shown = part.partition("\n")
        words = line.removeprefix("$ ").split()
        if words[0] != "strapdown" or not shown.strip():
            return part
        output(["-m", *words], folder)  # compiles, so that the times are those of a second run
        return f"{line}\n{output(['-m', *words], folder)}"

    return FENCE.sub(block, page)


def main() -> None:
    """Renew all pages."""
    for page in PAGES:
        with tempfile.TemporaryDirectory() as top:
            folder = Path(top) / "project"
            folder.mkdir()
            (Path(top) / "shared").symlink_to(ROOT.parent / "shared")  # the real recordings
            page.write_text(renewed(page.read_text("utf-8"), folder), "utf-8")


if __name__ == "__main__":
    main()
