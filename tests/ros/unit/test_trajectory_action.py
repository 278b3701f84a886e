"""Results of goals whose motion goes on behind the last point."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace
from typing import Any

import pytest
from control_msgs.action import FollowJointTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from robotd.control.completion import Outcome
from robotd.errors import OperationError
from robotd_ros import worker_action
from robotd_ros.nodes import follow_joint_trajectory_server as trajectory_action


class Goals:
    """In place of the action server: keeps what ends a goal."""

    def __init__(self, *_: object, accepted: Callable[[Any], None], **__: object) -> None:
        self.accepted = accepted
        self.ends: list[Any] = []

    def notify_execute(self, goal: Any, execute: Callable[[Any], Any]) -> None:
        self.ends.append(execute(goal))


class Follower:
    """A goal that succeeds, and whose release fails."""

    def __init__(self, *, done: bool) -> None:
        self.execution = SimpleNamespace(
            outcome=Outcome.SUCCEEDED,
            message="passed",
            done=done,
            trajectory=SimpleNamespace(names=("joint1",), notes=()),
            ticks=lambda *_: nullcontext(()),
        )

    def tolerances(self, *_: object) -> Any:
        return SimpleNamespace(notes=())

    @contextmanager
    def follow(self, *_: object) -> Iterator[Any]:
        yield self.execution
        raise OperationError("the device does not answer")


@pytest.mark.parametrize(
    ("done", "code"),
    [
        (False, FollowJointTrajectory.Result.SUCCESSFUL),
        (True, FollowJointTrajectory.Result.INVALID_GOAL),
    ],
)
def test_a_goal_has_one_result_when_its_release_fails(
    monkeypatch: pytest.MonkeyPatch, done: bool, code: int
) -> None:
    monkeypatch.setattr(worker_action, "worker_action_server", Goals)
    failures: list[Exception] = []

    def submit(function: Callable[..., None], *args: Any) -> None:
        try:
            function(*args)
        except OperationError as error:  # the host logs it
            failures.append(error)

    host: Any = SimpleNamespace(
        callback_guard=nullcontext, submit=submit, sent_by_request=lambda _: nullcontext()
    )
    group: Any = SimpleNamespace(
        name="", follower=Follower(done=done), motion=SimpleNamespace(ticket=lambda: 1)
    )
    robot: Any = SimpleNamespace(clock=None, descriptor=SimpleNamespace(groups=()))
    node: Any = SimpleNamespace(get_clock=lambda: None)
    request = FollowJointTrajectory.Goal()
    request.trajectory.joint_names = ["joint1"]
    request.trajectory.points = [JointTrajectoryPoint(positions=[0.1])]
    goal = SimpleNamespace(
        request=request,
        requester=None,
        goal_id=SimpleNamespace(uuid=bytes(16)),
        is_cancel_requested=False,
        succeed=lambda: None,
        abort=lambda: None,
    )

    action: Any = trajectory_action.TrajectoryAction(node, robot, host, group, "follow")
    action._admit(request)
    action._server.accepted(goal)

    assert [result.error_code for result in action._server.ends] == [code]
    assert action._live == 0
    assert len(failures) == (not done)
