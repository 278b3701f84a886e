"""Results of goals whose motion goes on after the last point."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
from control_msgs.action import FollowJointTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

from robotd.control.loop.setpoint_source import Outcome
from robotd.errors import OperationError
from robotd_ros import worker_action
from robotd_ros.nodes import follow_joint_trajectory_server as trajectory_action
from robotd_ros.request_log import RequestLog


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


def action_of(monkeypatch: pytest.MonkeyPatch, follower: Any, submit: Callable[..., None]) -> Any:
    """Return a trajectory action over stand-ins."""
    monkeypatch.setattr(worker_action, "worker_action_server", Goals)
    host: Any = SimpleNamespace(
        callback_guard=nullcontext,
        submit=submit,
        sent_by_request=lambda _: nullcontext(),
        request_log=RequestLog(),
    )
    group: Any = SimpleNamespace(
        name="", follower=follower, motion=SimpleNamespace(ticket=lambda: 1)
    )
    robot: Any = SimpleNamespace(clock=None, descriptor=SimpleNamespace(groups=()))
    node: Any = SimpleNamespace(get_clock=lambda: None)
    return trajectory_action.TrajectoryAction(node, robot, host, group, "follow")


def accepted_goal() -> Any:
    request = FollowJointTrajectory.Goal()
    request.trajectory.joint_names = ["joint1"]
    request.trajectory.points = [JointTrajectoryPoint(positions=[0.1])]
    return SimpleNamespace(
        request=request,
        requester=None,
        goal_id=SimpleNamespace(uuid=bytes(16)),
        is_cancel_requested=False,
        succeed=lambda: None,
        abort=lambda: None,
    )


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
    failures: list[Exception] = []

    def submit(function: Callable[..., None], *args: Any, until_rest: bool) -> None:
        try:
            function(*args)
        except OperationError as error:  # the host logs it
            failures.append(error)

    action, goal = action_of(monkeypatch, Follower(done=done), submit), accepted_goal()
    action._admit(goal.request)
    action._server.accepted(goal)

    assert [result.error_code for result in action._server.ends] == [code]
    assert action._live == 0
    assert len(failures) == (not done)


def test_a_goal_that_was_canceled_while_it_waited_for_a_worker_does_not_begin(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waiting: list[Callable[[], None]] = []
    begun: list[Any] = []
    states: list[str] = []
    follower = Follower(done=True)
    follower.follow = lambda *args: begun.append(args)  # type: ignore[assignment,method-assign]
    action = action_of(
        monkeypatch, follower, lambda function, *args, **_: waiting.append(partial(function, *args))
    )
    goal = accepted_goal()
    goal.canceled, goal.abort = partial(states.append, "canceled"), partial(states.append, "abort")
    action._server.accepted(goal)
    action._cancel(goal)
    goal.is_cancel_requested = True
    waiting[0]()
    assert not begun
    assert states == ["canceled"]
    assert [ended.error_code for ended in action._server.ends] == [0]
