"""How long a KUKA LWR takes for six straight lines, with its hand kept on them: five methods, four tip speeds.

    python benchmarks/lwr_hexagon.py            # print the table
    python benchmarks/lwr_hexagon.py --save     # and write results/lwr_hexagon.csv and docs/lwr-hexagon.png

Position task of three dimensions, a path clock where the method scales, so that the target waits for the hand. A line
is entered at full speed: with acceleration limits, too, the hand cannot be on its path at a corner, for the clock does
not look ahead. Published, for other positions with the same length (accelerations limited, corners cut): the rows
``published``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from harness import save_rows, setting, show
from hexagon_plot import draw
from hexagon_runs import DT, METHODS, SPEEDS, Race, race

RESULTS = Path(__file__).parent / "results" / "lwr_hexagon.csv"
PICTURE = Path(__file__).parent.parent / "docs" / "lwr-hexagon.png"
PUBLISHED = {
    "pinv": (9.139, 4.573, 2.289, 1.147),
    "task-scaling": (10.395, 5.234, 4.0, 4.0),
    "sns": (9.138, 4.656, 3.375, 3.361),
}


def row(method: str, limits: str, speed: float, found: Race) -> dict[str, str]:
    """One line of the table."""
    return {
        "method": method,
        "limits": limits,
        "V_m_s": f"{speed:g}",
        "completion_s": f"{found.completion:.3f}" if found.completion == found.completion else "not within 15 s",
        "off_path_mm": f"{1e3 * found.off_path:.1f}",
        "peak_speed": f"{found.speeds.max():.2f}",
        "peak_acceleration": f"{found.accelerations.max():.1f}",
        "median_us": f"{found.microseconds:.0f}",
    }


def published() -> list[dict[str, str]]:
    """What was measured on other positions."""
    rest = dict.fromkeys(("off_path_mm", "peak_speed", "peak_acceleration", "median_us"), "")
    return [
        {"method": method, "limits": "published", "V_m_s": f"{v:g}", "completion_s": f"{t:.3f}", **rest}
        for method, times in PUBLISHED.items()
        for v, t in zip(SPEEDS, times, strict=True)
    ]


def main() -> None:
    """Run, print and, if asked, save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help=f"write {RESULTS.name} and {PICTURE.name}")
    parser.add_argument("--dt", type=float, default=DT, help="s, the step")
    options = parser.parse_args()
    plan = [("none", "pinv"), *(("velocity", m) for m in METHODS[1:]), ("acceleration", "sns"), ("acceleration", "hqp")]
    races = {
        (limits, method, speed): race(method, speed, limits == "acceleration", options.dt)
        for limits, method in plan
        for speed in SPEEDS
    }
    rows = [row(method, limits, speed, found) for (limits, method, speed), found in races.items()] + published()
    show(f"KUKA LWR, 4.57 m in six lines, dt = {1e3 * options.dt:g} ms; speeds and accelerations per limit", rows)
    if options.save:
        save_rows(RESULTS, rows, {"dt_s": f"{options.dt:g}"} | setting())
        draw(races, PUBLISHED, options.dt, PICTURE)


if __name__ == "__main__":
    main()
