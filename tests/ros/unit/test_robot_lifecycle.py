"""Life of a managed robot, on the simulation with a stepped clock."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from tests.core.control.harness import ACCELERATION, Harness, arm

from robotd.control.loop.setpoint_source import Outcome
from robotd.device.state import ConnectionState
from robotd.errors import ConnectError, InvalidArgument, NotReady
from robotd_ros.robot_lifecycle import GRAPH, LifecycleState, RobotLifecycle, Transition

FAR = (1.0, -0.6, 0.3)
INACTIVE = "the robot is inactive: its lifecycle manager has to activate it"


class Managed(Harness):
    """A managed robot with the transitions that have happened."""

    def __init__(self, **keys: object) -> None:
        super().__init__(arm(**keys))
        self.events: list[Transition] = []
        self.lifecycle = RobotLifecycle(self.robot, self.events.append)

    def go(self, *labels: str) -> Managed:
        for label in labels:
            assert self.lifecycle.change(0, label), label
        return self

    @property
    def labels(self) -> list[str]:
        return [transition.label for transition in self.events]


@pytest.fixture
def managed() -> Managed:
    return Managed()


def test_the_life_of_a_robot_twice(managed: Managed) -> None:
    for _ in range(2):
        assert managed.lifecycle.state is LifecycleState.UNCONFIGURED
        managed.go("configure")
        managed.run(0.01)
        assert managed.connection.ready
        assert not managed.image.servo_on.any()
        managed.go("activate")
        assert managed.image.servo_on.all()
        with managed.goal(FAR) as execution:
            managed.run(0.3)
            managed.go("deactivate")
            assert execution.outcome is Outcome.CANCELED
        managed.setpoints.assert_smooth_streams(ACCELERATION)
        assert not managed.simulation.states.servo_on.any()
        managed.go("cleanup")
        assert managed.connection.state is ConnectionState.IDLE
        managed.setpoints.rows.clear()
    managed.go("shutdown")
    assert managed.lifecycle.state is LifecycleState.FINALIZED
    assert managed.connection.state is ConnectionState.SHUTDOWN


def test_nothing_moves_and_no_servo_is_switched_on_while_inactive(managed: Managed) -> None:
    managed.go("configure")
    managed.run(0.01)
    commands: list[Callable[[], object]] = [
        lambda: managed.robot.axes.servo(0, True),
        lambda: managed.move(0, 1.0),
        lambda: managed.goal(FAR).__enter__(),
        lambda: managed.robot.stream().__enter__(),
    ]
    for command in commands:
        with pytest.raises(NotReady, match=INACTIVE):
            command()
    with pytest.raises(ConnectError, match=INACTIVE):
        managed.robot.recover()
    remedies = {problem.text: problem.remedy for problem in managed.robot.find_problems()}
    assert remedies["the robot is inactive"] == "Its lifecycle manager has to activate it"
    assert not managed.image.servo_on.any()


def test_a_stop_outlives_the_deactivation(managed: Managed) -> None:
    managed.go("configure", "activate")
    managed.robot.stop()
    managed.go("deactivate", "activate")
    with pytest.raises(NotReady, match="motion is stopped: by the operator"):
        managed.move(0, 1.0)
    managed.robot.reset()
    managed.move(0, 1.0)


def test_a_device_that_does_not_open_leaves_the_robot_unconfigured() -> None:
    managed = Managed(backends={"sim": {"fail_open": 7}})
    assert not managed.lifecycle.change(1)
    assert managed.lifecycle.state is LifecycleState.UNCONFIGURED
    assert managed.labels == ["configure", "transition_failure"]
    managed.go("configure")


def test_servos_that_fail_leave_the_robot_inactive_and_off(managed: Managed) -> None:
    managed.go("configure")
    enable = managed.robot.servos.enable_axis

    def fail(axis: int) -> None:
        if axis == 1:
            raise NotReady("the alarm stays")
        enable(axis)

    managed.robot.servos.enable_axis = fail  # type: ignore[method-assign]
    assert not managed.lifecycle.change(3)
    assert managed.lifecycle.state is LifecycleState.INACTIVE
    assert not managed.simulation.states.servo_on.any()
    managed.robot.servos.enable_axis = enable  # type: ignore[method-assign]
    managed.go("activate")


def test_an_error_closes_the_device(managed: Managed) -> None:
    managed.go("configure", "activate")
    managed.events.clear()

    def fail() -> None:
        raise ZeroDivisionError

    disable, managed.robot.servos.disable = managed.robot.servos.disable, fail  # type: ignore[method-assign]
    assert not managed.lifecycle.change(4)
    assert managed.lifecycle.state is LifecycleState.UNCONFIGURED
    assert managed.labels == ["deactivate", "transition_error", "transition_success"]
    assert managed.events[-1].start is LifecycleState.ERRORPROCESSING
    assert managed.connection.state is ConnectionState.IDLE
    assert not managed.simulation.states.servo_on.any(), "the connection switches off by itself"
    managed.robot.servos.disable = disable  # type: ignore[method-assign]
    managed.go("configure", "activate")


def test_a_device_that_cannot_be_closed_after_an_error_ends_the_life(managed: Managed) -> None:
    ended: list[bool] = []
    managed.lifecycle.on_finalized = lambda: ended.append(True)
    managed.go("configure")

    def fail() -> None:
        raise NotReady("bus off")

    managed.connection.close = fail  # type: ignore[method-assign]
    assert not managed.lifecycle.change(2)
    assert managed.lifecycle.state is LifecycleState.FINALIZED
    assert ended == [True]


def test_a_transition_that_does_not_start_here_is_rejected(managed: Managed) -> None:
    unknown = (
        r"the robot is unconfigured: no transition activate \(available: configure \(1\), shut"
    )
    with pytest.raises(InvalidArgument, match=unknown):
        managed.lifecycle.change(0, "activate")
    with pytest.raises(InvalidArgument, match="no transition 3 "):
        managed.lifecycle.change(3)
    assert managed.events == []


def test_a_second_transition_at_the_same_time_is_rejected(managed: Managed) -> None:
    with managed.lifecycle._lock, pytest.raises(NotReady, match="unconfigured has not ended"):
        managed.lifecycle.change(1)


def test_every_transition_has_an_id_of_its_own() -> None:
    assert len({transition.id for transition in GRAPH}) == len(GRAPH) == 25
