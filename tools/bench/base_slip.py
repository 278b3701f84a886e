"""``python -m tools.bench.base_slip``: odometry of bases on MuJoCo beside their true poses."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import click
import matplotlib as mpl
from tests.plugins.mujoco.driven_base import driven_base, errors

from robotd.api.bases import PlanarTwist
from robotd.motion.planar import Pose

mpl.use("svg")
from matplotlib import pyplot as plt

PAGE = Path("docs/_static/mujoco-bases.svg")
FRICTIONS = (0.8, 0.1)
AHEAD, TURN = PlanarTwist(0.8, 0.0), PlanarTwist(0.0, 1.5)
ASIDE = PlanarTwist(0.0, 0.0, 0.8)
SIDE_S, TURN_S = 1.5, math.pi / 2 / 1.5
SQUARE = [(AHEAD, SIDE_S), (TURN, TURN_S)] * 4
CRAB = [(AHEAD, SIDE_S), (ASIDE, SIDE_S), (TURN, TURN_S), (AHEAD, SIDE_S)]
COURSES = {"baymax": SQUARE, "mecanum_base": CRAB, "skid_steer_base": SQUARE}
Path_ = list[tuple[Pose, Pose]]


@click.command()
@click.option("--out", type=click.Path(path_type=Path), default=PAGE, show_default=True)
def main(out: Path) -> None:
    """Drive each base along a course in stepped time; draw the paths and print the errors.

    The bases are deterministic: the figures do not depend on the computer's load.
    """
    mpl.rcParams["svg.hashsalt"] = "robotd"  # the same file from the same paths
    figure, panels = plt.subplots(len(FRICTIONS), len(COURSES), figsize=(10, 7))
    print("| base | friction | distance m | error m | error of the heading ° |")
    print("|---|---:|---:|---:|---:|")
    for row, friction in enumerate(FRICTIONS):
        for column, (robot, course) in enumerate(COURSES.items()):
            path = _drive(robot, course, friction)
            distance, angle = errors(*path[-1])
            driven = _length([truth for _, truth in path])
            print(
                f"| {robot} | {friction} | {driven:.2f} | {distance:.3f}"
                f" | {math.degrees(angle):.1f} |"
            )
            _draw(panels[row][column], path, f"{robot}, friction {friction}")
    panels[0][0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(out, metadata={"Date": None})


def _drive(robot: str, course: list[tuple[PlanarTwist, float]], friction: float) -> Path_:
    with driven_base(robot, f"wheel_friction={friction}") as base:
        for twist, seconds in course:
            base.drive(twist, seconds)
        return base.path


def _length(path: list[Pose]) -> float:
    return sum(
        math.hypot(after.x - before.x, after.y - before.y) for before, after in pairwise(path)
    )


def _draw(panel: mpl.axes.Axes, path: Path_, title: str) -> None:
    for index, (label, style) in enumerate({"odometry": "--", "true": "-"}.items()):
        poses = [pose[index] for pose in path[::10]]  # 20 points a second are a smooth line
        panel.plot([pose.x for pose in poses], [pose.y for pose in poses], style, label=label)
    panel.set(title=title, xlabel="x (m)", ylabel="y (m)", aspect="equal")
    panel.title.set_fontsize(9)
    panel.grid(alpha=0.3)


if __name__ == "__main__":
    main()
