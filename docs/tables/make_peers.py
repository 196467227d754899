"""Write docs/tables/peers.md: calibrations beside imucal and magyc's two-step."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "benchmarks"))

import calibration_peers as peers  # noqa: E402


def main() -> None:
    """Write the table; without the peers' environment, leave it as it is."""
    if not peers.PEERS.is_file():
        print("peers.md needs .venv/peers; `make tables` installs it")
        return
    lines = ["| Simulated samples, the same for both | Here | Peer | It |", "|---|---|---|---|"]
    lines += [f"| {' | '.join(row)} |" for row in peers.rows()]
    text = (
        f"\nMedian of {peers.DRAWS} draws and the largest; processor time of one call, medians.\n"
    )
    target = Path(__file__).with_name("peers.md")
    target.write_text("\n".join(lines) + "\n" + text, encoding="utf-8")
    print(target.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
