"""State of a robot from its topics, beside other robots, and when it dies or is replaced."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any

import pytest
from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Bool
from wmx_ros2_message.msg import AxisState

from robotd.errors import OperationError
from robotd_ros.client import live_status, ros_client
from robotd_ros.client.fleet import SILENCE_S
from robotd_ros.client.live_status import LiveStatus
from robotd_ros.client.ros_client import Listener
from robotd_ros.client.status_client import AXIS_STATE, AxisIdentity

READY, FEEDBACK = "wmx/engine/ready", "/follow/_action/feedback"


class Robot:
    """Client in the namespace /left, to which the test delivers messages."""

    def __init__(self) -> None:
        self.node = self
        self.receivers: dict[str, Callable[[Any], None]] = {}
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s

    def get_namespace(self) -> str:
        return "/left"

    def create_subscription(self, kind: Any, topic: str, receive: Any, qos: Any) -> Any:
        self.receivers[topic] = receive
        return SimpleNamespace(topic_name=topic)

    def destroy_subscription(self, subscription: Any) -> None:
        """The test is over."""

    def listen(self, kind: Any, topic: str, qos: Any = 1) -> Listener:
        return Listener(self, kind, topic, qos)  # type: ignore[arg-type]

    def wait(self, condition: Callable[[], Any], what: str) -> Any:
        self.receivers[READY](Bool(data=True))
        return condition()

    def diagnose(self, robot: str, part: str) -> None:
        status = DiagnosticStatus(name=f"{robot}: {part}", hardware_id=robot.partition("/")[2])
        self.receivers["/diagnostics"](DiagnosticArray(status=[status]))

    def send_axes(self, count: int) -> None:
        kinds = AxisState.get_fields_and_field_types().items()
        lists = [name for name, kind in kinds if kind.startswith("sequence")]
        self.receivers[AXIS_STATE](AxisState(**{name: [0] * count for name in lists}))


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Robot:
    robot = Robot()
    for module in (live_status, ros_client):
        monkeypatch.setattr(module, "time", robot)
    axes = (AxisIdentity("joint1", "rad"),)
    monkeypatch.setattr(live_status, "published_axes", lambda client: axes)
    monkeypatch.setattr(live_status, "action_servers", lambda node: [("/follow", "node")])
    return robot


@pytest.fixture
def status(robot: Robot) -> Iterator[LiveStatus]:
    with ExitStack() as stack:
        yield LiveStatus(robot, stack)  # type: ignore[arg-type]


def test_diagnostics_of_other_robots_and_programs_are_not_shown(
    robot: Robot, status: LiveStatus
) -> None:
    robot.diagnose("robotd/left/cr3a", "engine")
    others = ("robotd/right/cr3a", "robotd/cr3a", "robotd/left/inner/cr3a", "camera/left/front")
    for other in others:
        robot.diagnose(other, "another")
    robot.receivers["/diagnostics"](DiagnosticArray())
    assert [part.name for part in status.report().parts] == ["engine"]


def test_a_robot_that_has_died_is_not_shown_as_ready(robot: Robot, status: LiveStatus) -> None:
    robot.send_axes(1)
    robot.receivers[FEEDBACK](FollowJointTrajectory.Impl.FeedbackMessage())
    assert status.report().goals_s == {"/follow": 0.0}
    robot.now_s += SILENCE_S - 0.1
    robot.diagnose("robotd/left/cr3a", "engine")
    report = status.report()
    assert (report.ready, len(report.axes or ()), report.goals_s) == (True, 1, {})
    robot.now_s += SILENCE_S + 0.1
    robot.diagnose("robotd/right/cr3a", "engine")
    report = status.report()
    assert (report.ready, report.axes, report.takes_motion) == (None, None, False)
    robot.diagnose("robotd/left/cr3a", "engine")  # it answers again
    assert status.report().ready


def test_a_robot_with_other_axes_ends_the_view_by_an_error(
    robot: Robot, status: LiveStatus
) -> None:
    robot.send_axes(2)
    with pytest.raises(OperationError, match="2 axes now, 1 when this command was started"):
        status.report()
