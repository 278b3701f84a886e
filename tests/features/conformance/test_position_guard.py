"""Guard of the checks' commands: none leads out of the room of an axis, whatever gives it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest

from robotd.api import Capability, CommandMode, Profile
from robotd_conformance.checks.harness import Harness
from robotd_conformance.checks.kit_target import KitTarget
from robotd_conformance.checks.position_guard import Refused
from robotd_conformance.checks.start_pose import StartPose

START = "backends.sim.initial_position_rad=[2.99, 2.9, 0.0]"  # of the plain robot: -3 to 3 rad
UPPER = 2.98  # less the margin
GENTLE = Profile(0.5, 1.0, 1.0)
Make = Callable[..., Harness]


@pytest.fixture
def make() -> Iterator[Make]:
    """Function that makes a started harness of the simulation, near the upper limits."""
    made = list[Harness]()

    def build(pose: StartPose | None = None, overrides: Sequence[str] = (START,)) -> Harness:
        made.append(KitTarget("sim", None, overrides, pose).build())
        made[-1].start()
        return made[-1]

    yield build
    for harness in made:
        harness.stop()


def test_the_run_starts_a_little_inside_of_the_limits(make: Make) -> None:
    harness = make()
    assert harness.image.position == pytest.approx([2.94, 2.9, 0.0], abs=2e-3)
    assert harness.travel()[0] < 0.0
    assert not harness.guard.refused


@pytest.mark.parametrize("target", [2.985, -2.99])
def test_no_move_leaves_the_room(make: Make, target: float) -> None:
    harness = make()
    with pytest.raises(Refused, match=r"a move to .* outside of -2.98 to 2.98 rad"):
        harness.drivers.axes.move(0, target, GENTLE)
    harness.pass_time(0.5)
    assert harness.image.position[0] == pytest.approx(2.94, abs=2e-3)
    assert "joint1" in harness.guard.refused


def test_the_plugins_own_axes_are_guarded_too(make: Make) -> None:
    harness = make()
    with pytest.raises(Refused):
        harness.plugin_axes.move(0, 2.985, GENTLE)


def test_no_setpoint_leaves_the_room(make: Make) -> None:
    harness = make()
    driver, setpoint = harness.drivers.axes, harness.image.position_command.copy()
    driver.begin_stream(harness.all)

    def send(image: object) -> None:
        setpoint[0] += 0.001
        driver.stream(setpoint, np.array([0.1, 0.0, 0.0]), harness.due_ns)

    with pytest.raises(Refused, match="joint1"), harness.each_period(send):
        harness.pass_time(1.0)
    assert harness.image.position.max() <= UPPER + 1e-3


@pytest.mark.parametrize("streamed", [False, True], ids=["jog", "velocity stream"])
def test_no_velocity_leaves_the_room(make: Make, streamed: bool) -> None:
    """It has no target: the axis is stopped in time, and the check gets the error afterwards."""
    harness = make()
    driver = harness.drivers.axes
    harness.robot.axes.set_command_mode(0, CommandMode.VELOCITY)
    if streamed:
        driver.begin_stream([0])
        speeds = np.array([0.2, 0.0, 0.0])
        nothing = np.full(3, np.nan)
        send = lambda image: harness.stream(nothing, speeds)  # noqa: E731
        with pytest.raises(Refused), harness.each_period(send):
            harness.pass_time(1.0)
    else:
        driver.jog(0, Profile(0.05, 1.0, 1.0))
        harness.pass_time(2.0)
    assert "joint1" in harness.guard.refused
    assert harness.image.position[0] <= UPPER + 2e-3


def test_no_turn_leaves_the_room(make: Make) -> None:
    """A gentle command takes the axis on before it turns."""
    harness = make()
    harness.move([0], np.array([2.6, 0.0, 0.0]))
    harness.rest()
    harness.move([0], np.array([2.97, 0.0, 0.0]))
    harness.until(lambda: harness.image.velocity_command[0] > 0.5, "the axis moves")
    with pytest.raises(Refused, match="in motion"):
        harness.drivers.axes.move(0, 2.6, Profile(0.5, 0.2, 0.2))
    harness.rest()
    assert harness.image.position[0] <= UPPER


def test_a_range_is_kept_as_the_limits_are(make: Make) -> None:
    harness = make(StartPose(None, {"joint1": (-0.1, 0.5)}), ())
    with pytest.raises(Refused, match="its --range less a margin"):
        harness.drivers.axes.move(0, -0.085, GENTLE)


def test_positions_after_homing_count_from_where_they_were(make: Make) -> None:
    harness = make()
    harness.drivers.axes.home(0, 5.0)
    harness.periods(5)
    harness.drivers.axes.move(0, -0.1, GENTLE)
    harness.rest()
    with pytest.raises(Refused):
        harness.drivers.axes.move(0, 0.05, GENTLE)  # 2.99 rad as it was


def test_positions_in_another_scale_are_converted(make: Make) -> None:
    harness = make()
    assert harness.can(Capability.SCALING)
    harness.disable()
    harness.robot.axes.set_polarity(0, -1)
    harness.periods(5)
    harness.enable()
    harness.drivers.axes.move(0, -2.9, GENTLE)
    harness.rest()
    with pytest.raises(Refused):
        harness.drivers.axes.move(0, -2.99, GENTLE)


def test_a_homing_that_moves_is_not_commanded(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    harness = make()
    own = type(vars(harness.drivers.axes)["wrapped"])
    monkeypatch.setattr(own, "homing_speed", lambda self, axis: 0.1)
    harness = make()
    with pytest.raises(Refused, match="a homing that moves"):
        harness.drivers.axes.home(0, 5.0)
