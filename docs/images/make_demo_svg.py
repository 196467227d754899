"""Draw docs/images/demo.svg: the demo's attitude, and its error beside the stated 3 sigma."""

from pathlib import Path

import numpy as np

import strapdown as sd
from strapdown.units import DEG

WIDTH, HEIGHT, LEFT, RIGHT, TOP, GAP = 860, 470, 62, 96, 30, 46
COLORS = {"roll": "#c0392b", "pitch": "#2471a3", "yaw": "#b7950b"}
INK, GRID = "#444", "#ddd"


class Panel:
    """Axes of one plot: data to pixels, grid, lines."""

    def __init__(self, top: int, height: int, span: tuple[float, float], unit: str) -> None:
        self.top, self.height, self.span = top, height, span
        self.parts: list[str] = []
        for y in np.linspace(*span, 5):
            v = self.v(y)
            self.parts.append(
                f'<path d="M{LEFT} {v:.1f}H{WIDTH - RIGHT}" stroke="{GRID}"/>'
                f'<text x="{LEFT - 8}" y="{v + 4:.1f}" text-anchor="end">{y:g}</text>'
            )
        self.parts.append(f'<text x="{LEFT}" y="{top - 10}">{unit}</text>')

    def u(self, t: np.ndarray) -> np.ndarray:
        """Return pixels across for times from 0 to 60 s."""
        return LEFT + t / 60.0 * (WIDTH - LEFT - RIGHT)

    def v(self, y: np.ndarray | float) -> np.ndarray | float:
        """Return pixels down, kept inside the panel."""
        low, high = self.span
        return self.top + (high - np.clip(y, low, high)) / (high - low) * self.height

    def points(self, t: np.ndarray, y: np.ndarray) -> str:
        """Return the text of a polyline."""
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(self.u(t), self.v(y), strict=True))

    def line(self, t: np.ndarray, y: np.ndarray, color: str, more: str = "") -> None:
        """Draw a line."""
        line = f'<polyline points="{self.points(t, y)}" fill="none" stroke="{color}" {more}/>'
        self.parts.append(line)

    def band(self, t: np.ndarray, half: np.ndarray, color: str) -> None:
        """Shade from -half to +half."""
        outline = self.points(t, half) + " " + self.points(t[::-1], -half[::-1])
        self.parts.append(f'<polygon points="{outline}" fill="{color}" opacity="0.15"/>')

    def label(self, row: int, text: str, color: str) -> None:
        """Write into the margin on the right."""
        y = self.top + 14 + 18 * row
        self.parts.append(f'<text x="{WIDTH - RIGHT + 10}" y="{y}" fill="{color}">{text}</text>')


def main() -> None:
    """Run the demo, draw it."""
    rec = sd.simulation.demo.recording()
    best = sd.estimators.preferred(rec)
    sol = sd.estimators.create(best, declination=sd.attitude.declination(rec)).run(rec)
    errors = sd.evaluation.attitude_errors(sol, rec.reference)
    shown = slice(None, None, 12)

    height = (HEIGHT - TOP - 2 * GAP) // 2
    attitude = Panel(TOP, height, (-180.0, 180.0), "estimated attitude [deg]")
    for row, (name, color) in enumerate(COLORS.items()):
        angle = sol.rpy[:, row] / DEG
        pieces = np.flatnonzero(np.abs(np.diff(angle)) > 180.0) + 1  # yaw passes south
        for part in np.split(np.arange(len(sol)), pieces):
            attitude.line(sol.t[part][shown], angle[part][shown], color, 'stroke-width="1.6"')
        attitude.label(row, name, color)

    below = Panel(TOP + height + GAP, height, (-3.0, 3.0), "error about north and down [deg]")
    for row, (name, error, sigma, color) in enumerate(
        (
            ("north", errors.tilt_n[:, 0], errors.std_n[:, 0], COLORS["pitch"]),
            ("down", errors.heading, errors.std_n[:, 2], COLORS["yaw"]),
        )
    ):
        below.band(errors.t[shown], 3.0 * sigma[shown] / DEG, color)
        below.line(errors.t[shown], error[shown] / DEG, color, 'stroke-width="1.2"')
        below.label(row, name, color)
    below.label(2, "band: 3 sigma", INK)

    foot = "".join(
        f'<text x="{below.u(np.float64(t)):.0f}" y="{HEIGHT - GAP + 22}" text-anchor="middle">'
        f"{t:g}{' s' if t == 60 else ''}</text>"
        for t in range(0, 61, 10)
    )
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'font-family="sans-serif" font-size="13" fill="{INK}">'
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>'
        f"{''.join(attitude.parts + below.parts)}{foot}</svg>\n"
    )
    Path(__file__).with_name("demo.svg").write_text(svg, encoding="utf-8")


if __name__ == "__main__":
    main()
