"""Recorded paths: their points, their file, the limits of their motion, and a robot that plays."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from robotd import DescriptorError, InvalidArgument, NotReady, OperationError, Robot, open_robot
from robotd.api import FloatArray, wait_until
from robotd.api.robots import JointLimits, SteppedClock
from robotd_shared.pose_file import write_poses
from robotd_teach.path_curve import interpolated, thinned, tolerances
from robotd_teach.path_file import PathFile, read_path, write_path
from robotd_teach.path_motion import PathMotion, PathTiming, curve_of, plan_path
from robotd_teach.paths import Paths, Playback
from robotd_teach.poses import Poses
from robotd_teach.program_code import Program
from robotd_teach.programs import Programs

LIMITS = JointLimits(
    ("a", "b", "c"),
    np.array([-3.0, -3.0, -1.0]),
    np.array([3.0, 3.0, 1.0]),
    np.array([2.0, 3.0, 0.5]),
    np.array([8.0, 10.0, 2.0]),
    units=("rad", "rad", "m"),
)
TOLERANCE = tolerances(LIMITS.units)
PERIOD_S = 0.01
STEP_S = 0.001  # of the finite differences
LEFT = {"joint1": 0.4, "joint2": -0.3, "joint3": 0.5, "joint4": 0.0, "joint5": 0.1, "joint6": 0.0}
RIGHT = LEFT | {"joint1": -0.3, "joint3": 0.9}


@st.composite
def recordings(draw: st.DrawFn) -> tuple[FloatArray, FloatArray]:
    """Times and positions: joints that are jogged, alone or together, guided, stopped and noisy."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rows, scale = [np.zeros((30, 3))], np.array([1.0, 1.0, 0.15])
    for kind in draw(st.lists(st.sampled_from(["jog", "guide", "rest"]), min_size=1, max_size=5)):
        count = int(rng.integers(20, 250))
        ramp = np.sin(np.linspace(0.0, np.pi, count))[:, None]
        speed = np.zeros((count, 3))
        if kind == "jog":
            joint = rng.integers(3)
            speed[:, joint] = rng.uniform(-0.8, 0.8) * np.minimum(8.0 * ramp[:, 0], 1.0)
        elif kind == "guide":
            times_s = np.arange(count)[:, None] * PERIOD_S
            turns = np.sin(times_s * rng.uniform(0.5, 8.0, 3) + rng.uniform(0.0, 6.0, 3))
            speed = ramp * rng.uniform(0.0, 0.8, 3) * turns
        rows.append(speed * scale)
    rows += [np.full((1, 3), 0.05) * scale, np.zeros((30, 3))]
    positions = np.cumsum(np.vstack(rows), axis=0) * PERIOD_S * 2.0
    positions[-30:] += 0.02 * scale  # it has moved, whatever was drawn
    noise = draw(st.sampled_from([0.0, 0.1, 0.3]))
    positions += rng.uniform(-noise, noise, positions.shape) * TOLERANCE
    return np.arange(len(positions), dtype=np.float64) * PERIOD_S, positions


def sampled(motion: PathMotion) -> FloatArray:
    """Positions of a motion each ``STEP_S``, by other code than that which plans."""
    points = motion.motion
    spline = CubicHermiteSpline(points.times_s, points.positions, points.velocities)
    return np.asarray(spline(np.arange(0.0, points.duration_s, STEP_S)))


def assert_within(rows: FloatArray, limits: JointLimits, part: float = 1.0) -> None:
    velocity = np.abs(np.diff(rows, axis=0)).max(axis=0) / STEP_S
    acceleration = np.abs(np.diff(rows, n=2, axis=0)).max(axis=0) / STEP_S**2
    assert (velocity <= part * limits.velocity * 1.001).all()
    assert (acceleration <= part * limits.acceleration * 1.001).all()


@settings(max_examples=30)
@given(recordings(), st.booleans(), st.sampled_from([*PathTiming]), st.sampled_from([0.2, 1.0]))
def test_any_recording_is_played_within_the_limits_and_near_to_it(
    recording: tuple[FloatArray, FloatArray], reverse: bool, timing: PathTiming, speed: float
) -> None:
    times_s, positions = recording
    knots_s, points, deviation = thinned(times_s, positions, TOLERANCE)
    assert (deviation <= TOLERANCE).all()
    curve = curve_of(knots_s, points, LIMITS, reverse=reverse)
    motion = plan_path(curve, LIMITS, curve.positions[0], speed, timing)
    rows = sampled(motion)
    # Of the limits, a part of each of them; the slower of the recorded speed and the limits.
    assert_within(rows, LIMITS, speed if timing is PathTiming.LIMITS else 1.0)
    assert (motion.deviation <= TOLERANCE).all()
    ends = (points[-1], points[0]) if reverse else (points[0], points[-1])
    np.testing.assert_allclose(motion.motion.positions[[0, -1]], ends, atol=1e-9)
    if timing is PathTiming.RECORDED and speed == 1.0:
        assert motion.motion.duration_s > 0.8 * knots_s[-1] - 0.5
    # Each place of the motion is near to a recorded one.
    dense = PchipInterpolator(times_s, positions)(np.linspace(0.0, times_s[-1], 20 * len(times_s)))
    for row in rows[:: max(len(rows) // 40, 1)]:
        assert (np.abs(dense - row) / TOLERANCE).max(axis=1).min() <= 2.0


def test_the_curve_is_the_one_of_the_paper() -> None:
    rng = np.random.default_rng(3)
    times_s, points = np.cumsum(rng.uniform(0.1, 1.0, 12)), rng.uniform(-1.0, 1.0, (12, 3))
    at_s = np.linspace(times_s[1], times_s[-2], 500)  # at the ends ours rests
    expected = PchipInterpolator(times_s, points)(at_s)
    np.testing.assert_allclose(interpolated(times_s, points, at_s), expected, atol=1e-12)


def test_standing_still_is_left_out_at_both_ends_and_kept_between() -> None:
    still = np.zeros((200, 3))
    travel = np.zeros((101, 3))
    travel[:, 0] = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 101)))
    up = np.vstack([still, travel, np.tile(travel[-1], (300, 1)), travel[::-1], still])
    times_s = np.arange(len(up)) * PERIOD_S
    knots_s, points, _ = thinned(times_s, up, TOLERANCE)
    assert knots_s[-1] == pytest.approx(5.0, abs=0.25)
    assert len(points) < 40
    np.testing.assert_allclose(points[[0, -1]], 0.0, atol=1e-12)  # where it rested
    curve = curve_of(knots_s, points, LIMITS)
    recorded = plan_path(curve, LIMITS, points[0], 1.0, PathTiming.RECORDED)
    assert recorded.motion.duration_s == pytest.approx(knots_s[-1], abs=0.7)
    fastest = plan_path(curve, LIMITS, points[0], 1.0, PathTiming.LIMITS)
    assert fastest.motion.duration_s < 3.0  # without the pause
    with pytest.raises(InvalidArgument, match="the joints have not moved"):
        thinned(times_s[:200], still, TOLERANCE)


def test_the_file_is_read_as_it_was_written_and_names_what_is_wrong(tmp_path: Path) -> None:
    file = tmp_path / "paths" / "wipe.yaml"
    path = PathFile(
        robot="arm", joints=["a", "b"], points=["0.000 0.50000 -0.25000", "1.250 0.00000 1.00000"]
    )
    write_path(file, path)
    assert read_path(file) == path
    text = file.read_text(encoding="utf-8")
    for old, new, reason in (
        ("- 1.250 0.00000 1.00000", "- 1.25 0.0", r"wipe\.yaml:6: .*needs 3 numbers"),
        ("1.250", "0.000", r"wipe\.yaml:6: points\.1: its time is not after that of the point"),
        ("- 0.000", "- 0.100", r"points\.0: must begin at time 0"),
        ("robot: arm", "robt: arm", r"robt: unknown key; did you mean 'robot'"),
        ("0.50000", "far", r"wipe\.yaml:5: points\.0: needs 3 numbers"),
        ("0.50000", "nan", r"wipe\.yaml:5: points\.0: needs 3 numbers"),
    ):
        assert old in text
        file.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(DescriptorError, match=reason):
            read_path(file)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "arm" / "robot.yaml"
    path.parent.mkdir()
    path.write_text("extends: cr3a\nname: arm\nposes: poses.yaml\n", encoding="utf-8")
    return path


@pytest.fixture
def robot(file: Path) -> Iterator[Robot]:
    with open_robot(file, "sim", clock=SteppedClock()) as robot:
        yield robot


@pytest.fixture
def paths(robot: Robot) -> Paths:
    """Paths of an arm that has recorded ``wipe``, from ``LEFT`` to ``RIGHT``, and rests there."""
    paths, poses = robot.feature(Paths), robot.feature(Poses)
    write_poses(poses.path, {"left": LEFT, "right": RIGHT})
    poses.go("left", 1.0)
    with paths.recording("wipe"):
        poses.go("right", 0.5)
    return paths


def positions(robot: Robot) -> list[float]:
    found: list[float] = robot.image.position[:6].tolist()
    return found


def near(pose: dict[str, float]) -> object:
    return pytest.approx(list(pose.values()), abs=3e-3)


def test_a_recorded_path_is_played_forwards_backwards_and_from_its_middle(
    file: Path, robot: Robot, paths: Paths
) -> None:
    assert (file.parent / "paths" / "wipe.yaml").exists()
    state = paths.all()["wipe"]
    assert (state.problem, state.joints) == ("", list(LEFT))
    paths.play("wipe", Playback(reverse=True))
    assert positions(robot) == near(LEFT)
    assert paths.plan("wipe").motion.motion.duration_s == pytest.approx(state.duration_s, rel=0.3)
    paths.play("wipe", Playback(1.0, PathTiming.LIMITS))
    assert positions(robot) == near(RIGHT)
    half = paths.plan("wipe", Playback(begin=0.5), approach=True).motion
    assert half.approach_s > 0.3
    joint1 = np.interp(half.approach_s, half.motion.times_s, half.motion.positions[:, 0])
    assert joint1 == pytest.approx(0.05, abs=0.05)  # half of the time is half of the travel
    paths.play("wipe", Playback(begin=0.5), approach=True)
    assert positions(robot) == near(RIGHT)


def test_the_way_to_its_start_has_to_be_asked_for(robot: Robot, paths: Paths) -> None:
    with pytest.raises(
        InvalidArgument, match=r"elsewhere: joint1 by \+0\.700 rad and 1 more .* s;"
    ):
        paths.play("wipe")
    assert positions(robot) == near(RIGHT)
    assert "; first to its start: joint1" in paths.plan("wipe", approach=True).text
    paths.play("wipe", approach=True)
    assert positions(robot) == near(RIGHT)


def test_a_path_that_a_changed_robot_has_made_invalid_says_so(robot: Robot, paths: Paths) -> None:
    path = paths.known("wipe")
    far = ["0.0 0 0 0 0 0 0", "1.0 0 3.5 0 0 0 0"]
    for changed, reason in (
        ({"robot": "other"}, "it was recorded on the robot other, this one is arm"),
        ({"joints": [*list(LEFT)[:5], "elbow"]}, "the robot has no joint elbow"),
        ({"points": far}, r"joint2 would be at 3\.5 rad, its limits are -3\.14 to 3\.14 rad"),
    ):
        write_path(paths.folder / "old.yaml", path.model_copy(update=changed))
        with pytest.raises(InvalidArgument, match=f"old cannot be played: {reason}"):
            paths.play("old", approach=True)
    assert positions(robot) == near(RIGHT)
    (paths.folder / "old.yaml").write_text("robot: arm\n", encoding="utf-8")
    assert "joints: missing" in paths.all()["old"].problem
    assert not paths.all()["wipe"].problem


def test_names_and_values_are_checked(robot: Robot, paths: Paths) -> None:
    with pytest.raises(InvalidArgument, match="there is a path 'wipe' already"):
        paths.begin("wipe")
    with pytest.raises(InvalidArgument, match="'a b' is not a valid name of a path"):
        paths.begin("a b")
    with pytest.raises(InvalidArgument, match=r"unknown path 'wip'; did you mean 'wipe'\?"):
        paths.play("wip")
    with pytest.raises(InvalidArgument, match=r"speed is 2, must be 0\.01 to 1"):
        Playback(2.0)
    with pytest.raises(InvalidArgument, match="begin is 1, must be 0 to less than 1"):
        Playback(begin=1.0)
    with pytest.raises(NotReady, match="no path is being recorded"):
        paths.end()
    paths.begin("other")
    with pytest.raises(NotReady, match="other is being recorded, 0 s of it: end that first"):
        paths.begin("third")
    wait_until(lambda: False, 0.2, robot.clock)
    with pytest.raises(InvalidArgument, match="the joints have not moved"):
        paths.end()
    paths.rename("wipe", "sweep")
    assert list(paths.all()) == ["sweep"]
    paths.delete("sweep")
    assert not paths.all()


def test_a_stop_ends_it_on_the_path(robot: Robot, paths: Paths) -> None:
    def stop(image: object) -> None:
        if positions(robot)[0] > 0.1 and not robot.axes.stop_latch.cause:
            robot.axes.stop_latch.engage("by the test")

    robot.control_loop.every(robot.descriptor.cycle.rate_hz, "test", stop)
    with pytest.raises(OperationError, match="the motion along wipe ended early"):
        paths.play("wipe", Playback(reverse=True))
    joint1, joint3 = positions(robot)[0], positions(robot)[2]
    assert 0.1 < joint1 < 0.35
    # Both joints move in the ratio of their travels, so that the path is a line.
    assert joint3 - 0.5 == pytest.approx(0.4 / 0.7 * (0.4 - joint1), abs=0.01)


def test_a_program_plays_a_path_and_goes_on_along_it(robot: Robot, paths: Paths) -> None:
    programs = robot.feature(Programs)
    program = Program.parse(
        "steps:\n"
        "  - path: {name: wipe, approach: true, timing: limits, speed: 1.0}\n"
        "  - path: {name: wipe, reverse: true, speed: 0.5}\n",
        "cell.yaml",
    )

    def stop() -> None:
        if programs.state.step == 2 and -0.1 < positions(robot)[0] < 0.1:
            raise InvalidArgument("that is enough")

    with pytest.raises(OperationError, match=r"cell\.yaml:3: steps\.1\.path: stopped at step 2"):
        programs.run(program, stop)
    assert -0.2 < positions(robot)[0] < 0.2
    programs.resume()
    assert programs.state.state == "done"
    assert positions(robot) == near(LEFT)


@pytest.mark.parametrize(
    ("step", "reason"),
    [
        ("{name: wip}", r"cell\.yaml:2: steps\.0\.path: unknown path 'wip'; did you mean 'wipe'"),
        ("{name: wipe}", r"cell\.yaml:2: steps\.0\.path: the path begins elsewhere: joint1 by"),
        ("{name: wipe, blend_m: 0.1}", r"steps\.0\.path\.blend_m: belongs to `through`"),
        ("{through: [{by: {z: 0.1}}], from: 0.1}", r"steps\.0\.path\.from: belongs to `name`"),
        ("{name: wipe, through: [{by: {z: 0.1}}]}", "needs exactly one of through, name"),
    ],
)
def test_a_step_that_is_wrong_names_line_and_key(
    robot: Robot, paths: Paths, step: str, reason: str
) -> None:
    with pytest.raises(DescriptorError, match=reason):
        robot.feature(Programs).check(Program.parse(f"steps:\n  - path: {step}\n", "cell.yaml"))
