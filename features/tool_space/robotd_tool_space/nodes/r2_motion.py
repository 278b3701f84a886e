"""Motion of an arm as WMX R2 has it: one at a time, begun by a call and judged by its state."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from enum import IntEnum
from typing import Any, NamedTuple

from robotd.api import (
    InvalidArgument,
    NotReady,
    Operation,
    ProcessImage,
    RobotdError,
    get_logger,
    wait_until,
)
from robotd.api.robots import Outcome, Robot, TrajectoryExecution
from robotd_tool_space.paths.segments import MIN_SPEED
from robotd_tool_space.paths.tool_motion import ToolMotion
from robotd_tool_space.robot_tool import RobotTool
from robotd_tool_space.sequences.planned_tool import Arrival

log = get_logger("tool")

END_TIMEOUT_S = 2.0  # of a motion, to be known after an e-stop
E_STOP = "by the service wmx/robot/e_stop"  # reason of the stop that release_e_stop resets
FAILED = frozenset({Outcome.FAULT, Outcome.PATH_TOLERANCE, Outcome.GOAL_TOLERANCE})


class R2State(IntEnum):
    """``motion_state`` of RobotStatus."""

    IDLE = 0
    STOPPING_LINE = 2
    STOPPING_JOINTS = 3
    LINE = 6
    JOINTS = 7  # joints move together, or by commands of another node
    ERROR_STOP_LINE = 8
    ERROR_STOP_JOINTS = 9
    ERROR = 10
    PAUSED_LINE = 13
    PAUSED_JOINTS = 14
    E_STOPPING = 17
    E_STOPPED = 18


class R2Error(IntEnum):
    """``motion_error_code`` of RobotStatus."""

    NONE = 0
    SYSTEM_E_STOP = 1  # a stop that was not commanded by the service e_stop
    AMPLIFIER = 8
    SERVO_OFF = 10
    USER_E_STOP = 11
    FOLLOWING = 12
    OFFLINE = 13


class R2Fault(NamedTuple):
    """Reason why a robot does not move.

    Attributes:
        code: of the reason.
        joint: index of the joint that it is about; -1: none.
        text: for people.
    """

    code: R2Error = R2Error.NONE
    joint: int = -1
    text: str = ""


NO_FAULT = R2Fault()


def drive_fault(image: ProcessImage, axes: Sequence[int]) -> R2Fault | None:
    """Return the first fault of the drives of ``axes``."""
    for joint, axis in enumerate(axes):
        if text := image.fault(axis):
            code = R2Error.OFFLINE if image.offline[axis] else R2Error.AMPLIFIER
            return R2Fault(code, joint, text)
    return None


def motion_fault(
    execution: TrajectoryExecution, image: ProcessImage, axes: Sequence[int], names: Sequence[str]
) -> R2Fault | None:
    """Return the fault that has ended a motion; None: it ended without one.

    Args:
        execution: has ended.
        image: a copy of the time of the end.
    """
    if execution.outcome not in FAILED:
        return None
    if fault := drive_fault(image, axes):
        return fault._replace(text=execution.message)
    for joint, axis in enumerate(axes):
        if not image.servo_on[axis]:
            return R2Fault(R2Error.SERVO_OFF, joint, execution.message)
    first_word = execution.message.partition(" ")[0]
    joint = names.index(first_word) if first_word in names else -1
    return R2Fault(R2Error.FOLLOWING, joint, execution.message)


def moving_state(execution: TrajectoryExecution, *, is_line: bool) -> R2State:
    """Return the state of a motion that has not ended."""
    ending = execution.completion.requested
    if ending is None:
        if execution.rate == 0.0:
            return R2State.PAUSED_LINE if is_line else R2State.PAUSED_JOINTS
        return R2State.LINE if is_line else R2State.JOINTS
    if ending[0] in FAILED:
        return R2State.ERROR_STOP_LINE if is_line else R2State.ERROR_STOP_JOINTS
    return R2State.STOPPING_LINE if is_line else R2State.STOPPING_JOINTS


def is_moved(image: ProcessImage, axes: Sequence[int]) -> bool:
    """Return True while something commands one of ``axes``."""
    return any(image.operation[axis] != Operation.IDLE for axis in axes)


class R2Request(NamedTuple):
    """Request with its arrival; a later stop keeps it from moving anything."""

    request: Any
    arrival: Arrival


class _Running(NamedTuple):
    execution: TrajectoryExecution
    is_line: bool


class R2Motion:
    """Starts, stops and overrides the motion of an arm, and has its state.

    Any worker thread may call; ``arrive`` and ``state`` are for the executor thread.

    Args:
        submit: of the host, whose workers wait for the ends of motions.
    """

    def __init__(self, robot: Robot, tool: RobotTool, submit: Callable[..., None]) -> None:
        self._robot, self._tool, self._submit = robot, tool, submit
        self._axes, self._names = tool.group.joint_axes, tool.group.joint_names
        self._interruptions = robot.rearming.interruptions
        self._running: _Running | None = None
        self._fault: R2Fault | None = None  # of the last motion, until it is cleared
        self._lock = threading.Lock()

    @property
    def moves(self) -> bool:
        """Something commands the joints."""
        return self._running is not None or is_moved(self._robot.image, self._axes)

    def arrive(self, request: Any) -> R2Request:
        """Note that a request for motion has arrived."""
        return R2Request(request, self._tool.arrive())

    def start(self, plan: Callable[[], ToolMotion], request: R2Request, *, is_line: bool) -> str:
        """Plan a motion and begin it; return its duration as text.

        Raises NotReady: motion is stopped, the last motion ended with a fault, or as
            ``RobotTool.follow``; and what ``plan`` raises. Nothing moves.
        """
        self._robot.axes.stop_latch.check()
        if self._fault is not None:
            raise NotReady(f"the last motion failed ({self._fault.text}): clear_motion_error first")
        motion = plan()
        stack = ExitStack()
        with self._tool.group.motion.lock:
            self._tool.start()  # no other motion has begun meanwhile: it would be taken over
            execution = stack.enter_context(self._tool.follow(motion, request.arrival))
        running = _Running(execution, is_line)
        try:
            with self._lock:
                self._running = running
            self._submit(self._attend, running, stack, until_rest=True)
        except RobotdError:
            stack.close()
            self._forget(running)
            raise
        return f"begun; it takes {motion.duration_s:.2f} s at full speed"

    def stop(self) -> None:
        """Bring the joints to rest, whatever moves them; on the path where they have one."""
        self._interruptions.add(self._axes, "stopped by wmx/robot/stop_motion")
        if not self._tool.group.motion.cancel():
            self._robot.axes.stop(self._axes)

    def e_stop(self) -> None:
        """Stop all motion of the robot, these joints by the quick stop of their drives."""
        latch = self._robot.axes.stop_latch
        latch.check_commandable()
        latch.engage(E_STOP)
        self._robot.axes.quick_stop(self._axes)

    def release_e_stop(self) -> str:
        """Allow motion after ``e_stop``; nothing moves.

        Raises NotReady: something else has stopped the robot; DeviceTimeout: axes still move.
        """
        latch = self._robot.axes.stop_latch
        if not latch.reason:
            return "no e-stop is active"
        if latch.reason != E_STOP:
            raise NotReady(latch.rejection)
        # Its end is no error: it has to be known before motion is allowed again.
        wait_until(lambda: self._running is None, END_TIMEOUT_S, self._robot.clock)
        return self._robot.reset()

    def clear_error(self) -> str:
        """Forget the fault of the last motion.

        Raises NotReady: the robot is stopped, or a drive has a fault.
        """
        if rejection := self._robot.axes.stop_latch.rejection:
            raise NotReady(rejection)
        if fault := drive_fault(self._robot.image.copy(), self._axes):
            name = self._names[fault.joint]
            raise NotReady(f"{name}: {fault.text}; clear it by wmx/axis/clear_alarm")
        self._fault = None
        return "no error"

    def override(self, **ratios: float) -> None:
        """Scale the speed of the motion that runs by ``vel_ratio``, see ``override_speed``.

        Raises InvalidArgument: a ratio is outside 0.01 to 1; NotReady: none runs; Unsupported.
        """
        for name, ratio in ratios.items():
            if not MIN_SPEED <= ratio <= 1.0:
                raise InvalidArgument(f"{name} is {ratio:g}, must be {MIN_SPEED:g} to 1")
        if (running := self._running) is None:
            raise NotReady("no motion of wmx/robot/start_motion runs")
        running.execution.override_speed(ratios["vel_ratio"])

    def state(self, image: ProcessImage) -> tuple[R2State, R2Fault]:
        """Return the state of motion and the reason of an error; ``image`` is a copy."""
        running = self._running
        moved = running is not None or is_moved(image, self._axes)
        if reason := self._robot.axes.stop_latch.reason:
            code = R2Error.USER_E_STOP if reason == E_STOP else R2Error.SYSTEM_E_STOP
            return R2State.E_STOPPING if moved else R2State.E_STOPPED, R2Fault(code, -1, reason)
        fault = self._fault or drive_fault(image, self._axes)
        if running is not None:
            state = moving_state(running.execution, is_line=running.is_line)
        elif moved:
            state = R2State.JOINTS
        else:
            state = R2State.ERROR if fault else R2State.IDLE
        return state, fault or NO_FAULT

    def _attend(self, running: _Running, stack: ExitStack) -> None:
        """Worker thread: wait for the end of a motion, and release the joints."""
        with stack:
            running.execution.wait()
            image = self._robot.image.copy()
            if not self._robot.axes.stop_latch.reason:
                self._fault = motion_fault(running.execution, image, self._axes, self._names)
        self._forget(running)
        word = running.execution.outcome.name.lower() if running.execution.outcome else "unknown"
        log.info("motion ended", outcome=word, reason=running.execution.message)

    def _forget(self, running: _Running) -> None:
        with self._lock:  # a newer one may have begun
            if self._running is running:
                self._running = None
