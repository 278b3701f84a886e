"""A client that goes on commanding while motion is rejected moves nothing until it begins anew.

Every state that rejects motion, with every kind of client, in simulated time.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from structlog.testing import capture_logs
from tests.core.control.harness import PERIOD_S, Harness, arm

from robotd.clock import NANOSECONDS
from robotd.control.groups.joint_stream import JointStream
from robotd.control.groups.problem import ProblemKind
from robotd.control.groups.streams import StreamClient
from robotd.control.loop.rearming import SILENCE_S, CommandSource, Reception
from robotd.control.loop.setpoint_source import Completion, Outcome
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode
from robotd.errors import NotReady, RobotdError
from robotd_ros.nodes.axis_motion import AxisJog, AxisMotion

RATE_HZ = 50.0
SPEED = 0.2  # rad/s, of the commanded motion
TIMEOUT_S = 0.1
WAY = 0.02  # rad, that joint1 may move at most by coming to rest


class Client(ABC):
    """Client that commands joint1 at ``RATE_HZ``: ``target`` is where it is to be now."""

    def __init__(self, harness: Harness) -> None:
        self.harness = harness
        self.reception = Reception(harness.robot.rearming)
        self.sequence = 0  # of its publisher
        self.target = float(harness.image.position[0])
        self.rejections: list[str] = []
        self._is_on = False
        harness.robot.control_loop.every(RATE_HZ, "client", self._send_on)

    @contextmanager
    def commanding(self) -> Iterator[None]:
        """Command on in the block, whatever makes time pass: all of it is to be rejected."""
        self._is_on = True
        yield
        self._is_on = False

    def _send_on(self, image: ProcessImage) -> None:
        if self._is_on:
            self.try_to_send(SPEED)

    def try_to_send(self, speed: float) -> None:
        self.target += speed / RATE_HZ
        self.sequence += 1
        try:
            with self.reception.message(self.sequence):
                self.send(speed)
        except RobotdError as error:
            self.rejections.append(str(error))

    @abstractmethod
    def send(self, speed: float) -> None:
        """Command ``target``, or ``speed``; raises what rejects it."""

    @abstractmethod
    def stand(self) -> None:
        """Command no motion."""

    def go(self, seconds: float, speed: float = SPEED) -> float:
        """Send for ``seconds``; return the travel of joint1 meanwhile."""
        start = self.harness.image.position[0]
        farthest = 0.0
        for _ in range(round(seconds * RATE_HZ)):
            self.try_to_send(speed)
            self.harness.run(1.0 / RATE_HZ)
            farthest = max(farthest, abs(self.harness.image.position[0] - start))
        return float(farthest)

    def begin_at_the_present_position(self) -> None:
        self.target = float(self.harness.image.position_command[0])


class TopicClient(Client):
    """Client that opens a stream when there is none, as ``TopicStream`` does, in one thread."""

    def __init__(self, harness: Harness) -> None:
        super().__init__(harness)
        client: StreamClient[JointStream] = harness.robot.stream.client("topic", TIMEOUT_S)
        self.client, self.stream = client, None
        self.opened = 0

    stream: JointStream | None

    def command(self, make: Callable[[Any], Any]) -> None:
        if self.stream is not None and not self.stream.open:
            self.stream.close()
            self.stream = None
        command = make(self.client.commands)
        if self.stream is None:
            self.stream = self.client.open()
            self.opened += 1
        self.stream.put(command)


class Positions(TopicClient):
    def send(self, speed: float) -> None:
        self.command(lambda commands: commands.position([self.target, 0.0, 0.0]))

    def stand(self) -> None:
        self.begin_at_the_present_position()
        self.send(0.0)


class MovingPositions(Positions):
    def send(self, speed: float) -> None:
        velocity = [speed, 0.0, 0.0] if speed else None
        self.command(lambda commands: commands.position([self.target, 0.0, 0.0], velocity))


class Velocities(TopicClient):
    def send(self, speed: float) -> None:
        self.command(lambda commands: commands.velocity([speed, 0.0, 0.0]))

    def stand(self) -> None:
        self.send(0.0)


class Windows(Positions):
    """MoveIt Servo: points of the near past and future in each message."""

    def send(self, speed: float) -> None:
        now_ns, times_s = self.harness.clock.now_ns(), np.arange(-0.1, 0.095, 0.01)
        position, velocity = np.zeros((2, len(times_s), 3))
        position[:, 0], velocity[:, 0] = self.target + speed * times_s, speed
        times_ns = [now_ns + round(time_s * NANOSECONDS) for time_s in times_s]
        self.command(lambda commands: commands.points(times_ns, position, velocity))


class Program(Client):
    """Python program that opens its stream again in a loop."""

    stream: JointStream | None = None

    def send(self, speed: float) -> None:
        if self.stream is not None and not self.stream.open:
            with suppress(NotReady):
                self.stream.send([self.target, 0.0, 0.0])
            self.stream.close()
            self.stream = None
        if self.stream is None:
            self.stream = self.harness.robot.stream(owner="policy", timeout_s=TIMEOUT_S)
        self.stream.send([self.target, 0.0, 0.0])

    def stand(self) -> None:
        self.begin_at_the_present_position()
        self.send(0.0)


class WmxTopics(Client):
    """Topics of single axes, without ROS."""

    def __init__(self, harness: Harness) -> None:
        super().__init__(harness)
        self.motion = AxisMotion(harness.robot)
        host: Any = SimpleNamespace(
            submit=lambda function, *args, **_: function(*args), on_rejection=lambda *_: None
        )
        self.jog = AxisJog(harness.robot, host, "wmx/axis/jog", 0.2)

    def message(self, **fields: float) -> Any:
        columns = {name: [value] for name, value in fields.items()}
        return SimpleNamespace(index=[0], acc=[5.0], dec=[5.0], **columns)


class AxisJogs(WmxTopics):
    """``wmx/axis/jog`` on an axis in velocity mode."""

    def __init__(self, harness: Harness) -> None:
        super().__init__(harness)
        harness.robot.axes.set_command_mode(0, CommandMode.VELOCITY)

    def send(self, speed: float) -> None:
        self.jog.take(self.message(velocity=speed), self.harness.clock.now_ns())

    def stand(self) -> None:
        self.send(0.0)


class AxisVelocities(AxisJogs):
    """``wmx/axis/velocity``."""

    def send(self, speed: float) -> None:
        self.motion.jog(self.message(velocity=speed), 0)


class AxisPositions(WmxTopics):
    """``wmx/axis/position``."""

    def send(self, speed: float) -> None:
        self.motion.move(self.message(target=self.target, velocity=1.0), 0)

    def stand(self) -> None:
        self.begin_at_the_present_position()
        self.send(0.0)


class AxisDistances(WmxTopics):
    """``wmx/axis/position/relative``."""

    def send(self, speed: float) -> None:
        distance = speed / RATE_HZ
        self.motion.move_relative(self.message(target=distance, velocity=1.0), 0)

    def stand(self) -> None:
        self.send(0.0)


def lose(harness: Harness) -> None:
    harness.faults.drop_communication()
    harness.until(lambda: not harness.connection.ready)


def set_inactive(harness: Harness) -> None:  # as ``RobotLifecycle`` does
    harness.robot.axes.stop_latch.inactive = "inactive"
    harness.robot.servos.disable()


def set_active(harness: Harness) -> None:
    harness.robot.servos.enable()
    harness.robot.axes.stop_latch.inactive = ""


def change_mode(harness: Harness) -> None:
    axes = harness.robot.axes
    axes.stop_and_wait([0], 1.0)
    harness.until(lambda: not axes.owner(0))
    mode = CommandMode(int(harness.image.mode[0]))
    other = CommandMode.VELOCITY if mode is CommandMode.POSITION else CommandMode.POSITION
    axes.set_command_mode(0, other)


State = tuple[Callable[[Harness], object], Callable[[Harness], object]]
RECOVERED: Callable[[Harness], object] = lambda harness: harness.robot.recover()  # noqa: E731
STATES: dict[str, State] = {
    "stop": (lambda harness: harness.robot.stop(), lambda harness: harness.robot.reset()),
    "alarm": (lambda harness: harness.faults.trip(0, 17), RECOVERED),
    "servo off": (
        lambda harness: harness.robot.axes.servo(0, False),
        lambda harness: harness.robot.axes.servo(0, True),
    ),
    "device lost": (lose, RECOVERED),
    "pause": (lambda harness: harness.robot.pause(), lambda harness: harness.robot.resume()),
    "speed 0": (
        lambda harness: harness.robot.set_speed(0.0),
        lambda harness: harness.robot.set_speed(1.0),
    ),
    "inactive": (set_inactive, set_active),
}
CLIENTS = [
    Positions,
    MovingPositions,
    Velocities,
    Windows,
    Program,
    AxisJogs,
    AxisVelocities,
    AxisPositions,
    AxisDistances,
]


def rest(harness: Harness) -> None:
    """Wait for standstill; a pause leaves velocity commands of single axes alone."""
    harness.robot.axes.stop([0])
    harness.until(lambda: not abs(harness.image.velocity[0]) > 1e-3)  # unknown where it is lost


def problems(harness: Harness) -> list[str]:
    found = harness.robot.find_problems()
    return [problem.text for problem in found if problem.kind is ProblemKind.SOURCE]


@pytest.fixture(params=CLIENTS, ids=lambda client: client.__name__)
def client(request: pytest.FixtureRequest, harness: Harness) -> Client:
    made: Client = request.param(harness)
    return made


@pytest.mark.parametrize("held_s", [0.1, 0.8], ids=["short", "long"])  # than the silence
@pytest.mark.parametrize("state", STATES)
def test_nothing_moves_after_a_state_until_the_client_begins_anew(
    harness: Harness, client: Client, state: str, held_s: float
) -> None:
    begin, end = STATES[state]
    assert client.go(0.5) > 0.05
    begin(harness)
    client.go(held_s)
    rest(harness)
    with client.commanding():
        end(harness)
    client.rejections.clear()
    assert client.go(0.5) < 1e-4
    (text,) = problems(harness)
    assert "kept commanding while motion was rejected" in text
    assert "send nothing for 0.5 s" in text
    assert set(client.rejections) == {text}

    harness.run(SILENCE_S + PERIOD_S)
    assert problems(harness) == []
    client.begin_at_the_present_position()
    speeds = len(harness.setpoints.rows)
    assert 0.05 < client.go(0.5) < 0.15
    assert np.abs(harness.setpoints.velocity[speeds:]).max(initial=0.0) < 2.0 * SPEED
    assert problems(harness) == []


@pytest.mark.parametrize("state", STATES)
def test_a_command_without_motion_is_a_beginning_too(
    harness: Harness, client: Client, state: str
) -> None:
    begin, end = STATES[state]
    client.go(0.5)
    begin(harness)
    client.go(1.0)
    rest(harness)
    client.rejections.clear()
    target = client.target
    with suppress(RobotdError):
        client.stand()  # too early: motion is still rejected
    client.target = target
    with client.commanding():
        end(harness)
    rejected = len(client.rejections)
    assert client.go(0.5) < 1e-4
    assert client.rejections
    with capture_logs() as logs:
        client.stand()
    (told,) = [log for log in logs if log["event"] == "source is armed again"]
    assert told["rejected"] >= len(client.rejections) - rejected
    client.rejections.clear()
    assert client.go(0.5) > 0.05
    assert client.rejections == []


@pytest.mark.parametrize("first", [20, 5000, None])  # at 2 Hz it would have sent 20
def test_a_client_that_was_commanding_before_the_start_moves_nothing(
    harness: Harness, client: Client, first: int | None
) -> None:
    if isinstance(client, Program):
        pytest.skip("it belongs to the same process, and ends with it")
    harness.run(10.0)  # it was not discovered before
    client.target += 0.5
    with client.reception.message(first), pytest.raises(NotReady) as rejection:
        client.send(SPEED)
    text = str(rejection.value)
    assert "was commanding before robotd received it" in text
    assert "send nothing for 0.5 s" in text
    client.sequence = 5000
    assert client.go(1.0) < 1e-4
    assert problems(harness) == [text]

    harness.run(SILENCE_S + PERIOD_S)
    client.begin_at_the_present_position()
    assert client.go(0.5) > 0.05
    assert problems(harness) == []


def test_a_client_that_was_commanding_before_the_start_may_ask_for_no_motion(
    harness: Harness, client: Client
) -> None:
    client.sequence = 5000
    with client.reception.message(client.sequence):
        client.stand()
    assert client.go(0.5) > 0.05
    assert client.rejections == []


def test_a_client_whose_first_messages_were_lost_moves_at_once(
    harness: Harness, client: Client
) -> None:
    if isinstance(client, Program):
        pytest.skip("it belongs to the same process, and nothing gets lost")
    harness.run(10.0)
    client.sequence = 17  # lost: in 10 s a client that was never silent would have sent 20
    assert client.go(0.5) > 0.05
    assert client.rejections == []


def test_few_messages_show_no_silence_while_motion_was_rejected(
    harness: Harness, client: Client
) -> None:
    if isinstance(client, Program):
        pytest.skip("it belongs to the same process, and nothing gets lost")
    harness.robot.stop()
    harness.run(10.0)
    harness.robot.reset()
    client.sequence = 5
    client.target += 0.5  # far from no motion
    assert client.go(0.5) < 1e-4
    assert "was commanding before robotd received it" in client.rejections[-1]


def test_a_new_client_moves_at_once(harness: Harness, client: Client) -> None:
    assert client.go(0.5) > 0.05
    assert client.rejections == []


def test_an_axis_of_a_topic_that_is_received_is_known_to_be_silent(harness: Harness) -> None:
    motion, reception = AxisMotion(harness.robot), Reception(harness.robot.rearming)

    def send(axis: int, velocity: float, sequence: int) -> None:
        message = SimpleNamespace(index=[axis], velocity=[velocity], acc=[5.0], dec=[5.0])
        with reception.message(sequence):
            motion.jog(message, 0)

    for axis in (0, 1):
        harness.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
    send(0, 0.0, 5000)
    with pytest.raises(NotReady, match="was commanding before robotd received it"):
        send(1, SPEED, 5001)
    harness.run(SILENCE_S + PERIOD_S)
    send(1, SPEED, 5002)


@pytest.mark.parametrize("late", [False, True])
def test_a_client_whose_messages_are_dropped_is_not_silent(
    harness: Harness, client: Client, late: bool
) -> None:
    """Beyond the rate limit they are not decoded; late ones are, and rejected."""
    if isinstance(client, Program):
        pytest.skip("it belongs to the same process, and nothing gets lost")
    client.go(0.5)
    harness.robot.stop()
    harness.robot.reset()
    for _ in range(2):
        for _ in range(round(2 * SILENCE_S * RATE_HZ)):
            client.sequence += 1
            if late:
                with client.reception.message(client.sequence):
                    client.reception.drop()
            harness.run(1.0 / RATE_HZ)
        client.target += 0.5
        client.rejections.clear()
        assert client.go(0.5) < 1e-4
        assert "kept commanding while motion was rejected" in client.rejections[-1]


def test_a_publisher_that_is_discovered_late_may_have_been_commanding(harness: Harness) -> None:
    motion, reception = AxisMotion(harness.robot), Reception(harness.robot.rearming)

    def send(axis: int, velocity: float, sequence: int) -> None:
        message = SimpleNamespace(index=[axis], velocity=[velocity], acc=[5.0], dec=[5.0])
        with reception.message(sequence):
            motion.jog(message, 0)

    for axis in (0, 1):
        harness.robot.axes.set_command_mode(axis, CommandMode.VELOCITY)
    for sequence in range(100):  # nothing to be said against this one
        send(0, SPEED, sequence + 1)
        harness.run(1.0 / RATE_HZ)
    with pytest.raises(NotReady, match="was commanding before robotd received it"):
        send(1, SPEED, 5000)
    harness.run(SILENCE_S + PERIOD_S)
    send(1, SPEED, 5001)
    send(0, SPEED, 101)  # armed, and silent for a while


def test_a_stop_after_a_start_is_named_as_the_reason(harness: Harness) -> None:
    client = Positions(harness)
    client.sequence, client.target = 5000, 0.5
    client.go(0.1)
    assert "was commanding" in client.rejections[-1]
    client.stand()
    harness.robot.stop()
    client.go(0.1)
    harness.robot.reset()
    client.rejections.clear()
    client.go(0.1)
    assert "kept commanding while motion was rejected (stopped" in client.rejections[-1]


@pytest.mark.parametrize("peak", ["position", "velocity"])
def test_a_window_that_ends_where_it_began_asks_for_motion(harness: Harness, peak: str) -> None:
    client = Windows(harness)
    client.go(0.5)
    harness.robot.stop()
    client.go(0.1)
    harness.robot.reset()
    now_ns, present = harness.clock.now_ns(), harness.image.position_command.copy()
    times_ns = [now_ns + round(time_ms * 1e6) for time_ms in (0, 30, 60)]
    position, velocity = np.tile(present, (3, 1)), np.zeros((3, 3))
    (position if peak == "position" else velocity)[1, 0] += 0.2
    for _ in range(60):
        with pytest.raises(NotReady, match="kept commanding"):
            client.command(lambda commands: commands.points(times_ns, position, velocity))
    position[:], velocity[:] = present, 0.0
    client.command(lambda commands: commands.points(times_ns, position, velocity))


def test_another_command_mode_rejects_motion_as_well(harness: Harness, client: Client) -> None:
    client.go(0.5)
    if isinstance(client, (TopicClient, Program)):
        assert client.stream is not None
        client.stream.close()
    change_mode(harness)
    if isinstance(client, AxisJogs) and type(client) is AxisJogs:
        pytest.skip("in position mode its messages are streamed, and move the axis")
    client.go(1.0)
    assert "mode" in client.rejections[-1]
    change_mode(harness)
    assert client.go(0.5) < 1e-4
    assert problems(harness)


def test_a_rejected_topic_claims_no_joints(harness: Harness) -> None:
    client = Positions(harness)
    client.go(0.5)
    harness.robot.stop()
    client.go(0.5)
    harness.robot.reset()
    client.go(0.5)
    assert client.opened == 1
    assert harness.robot.axes.owner(0) == ""
    with harness.goal([0.0] * 3):  # a goal is a new command
        harness.run(0.5)
        assert harness.robot.axes.owner(0) == "trajectory"


def test_a_stream_that_a_fault_has_ended_does_not_go_on_by_itself(harness: Harness) -> None:
    client = Positions(harness)
    client.go(0.5)
    harness.robot.axes.stop([0])  # another client
    assert client.go(1.0) < WAY
    (text,) = problems(harness)
    assert "stopped by the device or another command" in text


def test_a_takeover_rejects_nothing(harness: Harness) -> None:
    first, second = Positions(harness), Program(harness)
    first.go(0.5)
    with harness.robot.stream(owner="policy", takeover=True) as stream:
        stream.send([first.target, 0.0, 0.0])
        harness.run(0.2)
    second.begin_at_the_present_position()
    first.begin_at_the_present_position()
    assert first.go(0.5) > 0.05
    assert problems(harness) == []


def test_a_command_that_waited_for_its_stream_is_rejected_when_motion_was_stopped_meanwhile(
    harness: Harness,
) -> None:
    client = harness.robot.stream.client("topic", TIMEOUT_S)
    client.commands.position([1.0, 0.0, 0.0])  # type: ignore[attr-defined]
    harness.robot.stop()
    harness.robot.reset()
    with client.open() as stream, pytest.raises(NotReady, match="kept commanding"):
        stream.send([1.0, 0.0, 0.0])
    assert harness.image.position[0] == pytest.approx(0.0, abs=1e-6)


def test_a_client_with_jitter_is_not_taken_for_a_silent_one(harness: Harness) -> None:
    client = Positions(harness)
    client.go(0.5)
    harness.robot.stop()
    client.go(0.5)
    harness.robot.reset()
    for _ in range(10):
        harness.run(2.5 * TIMEOUT_S)
        assert client.go(1.0 / RATE_HZ) < 1e-4


def test_a_stall_of_the_computer_is_no_silence(harness: Harness) -> None:
    client = Positions(harness)
    client.go(0.5)
    harness.robot.axes.stop_latch.engage("by the operator")
    client.go(1.0)
    with client.commanding():
        harness.robot.axes.stop_latch.release(1)
    for _ in range(3):
        harness.stall(2.0)
        assert client.go(0.1) < 1e-4
    assert problems(harness)


def test_a_source_of_a_long_time_out_has_to_be_silent_for_it(harness: Harness) -> None:
    source = CommandSource(
        harness.robot.rearming, "slow", [0], [CommandMode.POSITION], timeout_s=3.0, neutral="none"
    )
    source.admit(moves=True)
    harness.robot.stop()
    harness.robot.reset()
    for _ in range(2):
        harness.run(2.9)
        with pytest.raises(NotReady, match="send nothing for 3 s"):
            source.admit(moves=True)
    harness.run(3.1)
    source.admit(moves=True)


def test_an_admission_holds_until_motion_is_rejected(harness: Harness) -> None:
    source = CommandSource(harness.robot.rearming, "any", [0], (), timeout_s=0.1, neutral="none")
    admission = source.admit(moves=True)
    harness.robot.axes.servo(2, False)  # another axis
    assert admission.holds
    harness.robot.axes.servo(0, False)
    harness.robot.axes.servo(0, True)
    assert not admission.holds
    assert source.admit(moves=False).only_arms
    assert source.admit(moves=True).holds


def test_names_of_clients_that_have_gone_are_forgotten() -> None:
    harness = Harness(arm()).up()
    rearming = harness.robot.rearming
    for number in range(1000):
        source = CommandSource(rearming, str(number), [0], (), timeout_s=0.1, neutral="none")
        rearming.find(source).admit(moves=True)
        if number % 50 == 49:
            harness.run(1.0)
    assert len(rearming._known) < 200


@pytest.mark.parametrize("asked", [Outcome.CANCELED, Outcome.PREEMPTED])
def test_a_canceled_motion_that_ends_with_a_fault_interrupts_its_sources(
    harness: Harness, asked: Outcome
) -> None:
    rearming, completion = harness.robot.rearming, Completion()
    source = CommandSource(rearming, "any", [0], (), timeout_s=0.1, neutral="none")
    admission = source.admit(moves=True)
    rearming.interruptions.watch(completion, [0])
    completion.request(asked, "by the client")
    assert admission.holds
    completion.finish(Outcome.FAULT, "it does not come to rest")
    assert not admission.holds
    with pytest.raises(NotReady, match="it does not come to rest"):
        source.admit(moves=True)
