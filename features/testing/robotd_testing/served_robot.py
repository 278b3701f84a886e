"""Whole robot for a test: on the simulation, with ROS nodes in the test's process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

from robotd.api import NANOSECONDS, InvalidArgument
from robotd.api.models import load_robot_descriptor
from robotd.api.robots import PacedClock, Robot, load_backend
from robotd_ros.client.motion_client import Arm, Ending, move
from robotd_ros.client.ros_client import RosClient
from robotd_ros.group_parameters import ACTION_PARAMETER, default_action, group_prefixes
from robotd_ros.host import RosHost
from robotd_ros.middleware import use_profiles
from robotd_ros.plugin import built_in_nodes
from robotd_ros.run_nodes import run_nodes
from robotd_scenario import FaultSchedule, Scenario, load_scenario, validate_fault
from robotd_scenario.program import standing

_POLL_S = 0.002
_FOLLOWER = "follow_joint_trajectory_server"


class RobotUnderTest:
    """A simulated robot with its ROS nodes, for one test thread.

    Attributes:
        robot: the robot below ROS: axes, connection, I/O, process image.
        domain_id: its ROS domain, also set in ``ROS_DOMAIN_ID``.
        timeout_s: default time-out of every wait, in real time.
    """

    def __init__(
        self, robot: Robot, clock: PacedClock, faults: FaultSchedule, domain_id: int
    ) -> None:
        self.robot = robot
        self.domain_id = domain_id
        self.timeout_s = 20.0
        self._clock, self._faults = clock, faults

    @property
    def time_s(self) -> float:
        """Simulated time in seconds, as on /clock."""
        return self._clock.now_ns() / NANOSECONDS

    @property
    def joint_positions(self) -> dict[str, float]:
        """Measured positions by joint, rad or m."""
        robot = self.robot
        values = robot.image.position[list(robot.joint_axes)].tolist()
        return dict(zip(robot.joint_names, values, strict=True))

    @property
    def gripper_closed(self) -> bool:
        """Commanded state of the gripper. Raises InvalidArgument without a gripper."""
        gripper = self.robot.descriptor.gripper
        if gripper is None:
            raise InvalidArgument(f"{self.robot.descriptor.name} has no gripper")
        return self.robot.io.output_bit(gripper.output_byte, gripper.output_bit)

    def fail(self, axis: int, *, at_s: float = 0.0, code: int | None = None) -> None:
        """Inject the alarm ``code`` into a drive, ``at_s`` simulated seconds from now."""
        keys: dict[str, Any] = {} if code is None else {"code": code}
        self.inject("amp_alarm", axis=axis, at_s=at_s, **keys)

    def inject(
        self, fault: str, *, at_s: float = 0.0, when: Mapping[str, Any] | None = None, **keys: Any
    ) -> None:
        """Inject a fault; ``docs/reference/scenario.md`` lists kinds and keys.

        Raises DescriptorError or InvalidArgument: unknown fault, or it does not fit the robot.
        """
        self._faults.add(validate_fault({"at_s": at_s, "when": when, fault: keys}))

    def move(self, targets: Mapping[str, float], time_s: float = 1.0) -> tuple[bool, str]:
        """Move joints over ROS, as a client does, and wait for the result.

        Args:
            targets: rad or m by joint, of one joint group; its others hold their position.
            time_s: duration, in simulated time.

        Returns:
            True when the goal was reached, and the text of the result.
        """
        descriptor, group = self.robot.descriptor, self.robot.groups.of(targets)
        parameters = descriptor.ros_parameters.get(_FOLLOWER, {})
        parameter = f"{group_prefixes(descriptor)[group.name]}{ACTION_PARAMETER}"
        name = parameters.get(parameter) or default_action(descriptor, group.name)
        positions = self.joint_positions
        arm = Arm(
            self.node.resolve_topic_name(str(name)),
            self.node.get_namespace(),
            {joint: positions[joint] for joint in group.joint_names},
            {},
        )
        ending, text = move(self.client, arm, targets, time_s, lambda: False, lambda *_: None)
        return ending is Ending.REACHED, text

    def wait_until(
        self, condition: Callable[[], Any], what: str = "", timeout_s: float | None = None
    ) -> Any:
        """Poll ``condition`` in real time and return its first true value.

        Callbacks of ``node`` are executed meanwhile. Raises AssertionError on time-out.
        """
        timeout_s = self.timeout_s if timeout_s is None else timeout_s
        deadline_s = time.monotonic() + timeout_s
        while not (answer := condition()):
            if time.monotonic() > deadline_s:
                raise AssertionError(f"not within {timeout_s:g} s: {what or condition}")
            if "client" in self.__dict__:
                self.client.spin()
            else:
                time.sleep(_POLL_S)
        return answer

    def wait_standstill(self, timeout_s: float | None = None) -> None:
        """Wait until all axes are idle and at rest. Raises the errors of ``wait_until``."""
        self.wait_until(lambda: standing(self.robot), "all axes stand", timeout_s)

    def pause(self) -> None:
        """Pause simulated time."""
        self._clock.pause()

    def resume(self) -> None:
        """Resume simulated time."""
        self._clock.resume()

    def step(self, periods: int = 1) -> None:
        """Run control periods, then pause simulated time."""
        self.robot.step(periods)

    @cached_property
    def client(self) -> RosClient:
        """Client in the same domain: ``client.call``, ``client.listen``, ``client.wait``."""
        client = RosClient(timeout_s=self.timeout_s)
        client.start()
        return client

    @property
    def node(self) -> Any:
        """Node of the client, for additional clients; its callbacks run during waits."""
        return self.client.node

    def call(self, service_type: Any, name: str, /, **request: Any) -> Any:
        """Call a service and return its response. Raises the errors of ``RosClient.call``."""
        return self.client.call(service_type, name, **request)

    def close(self) -> None:
        """Close the client; the robot keeps running."""
        if "client" in self.__dict__:
            self.client.close()


@contextmanager
def robot_under_test(
    name_or_path: str | Path,
    domain_id: int,
    *,
    variant: str | None = None,
    nodes: Sequence[str] | None = None,
    scenario: Path | None = None,
    time_scale: float = 1.0,
) -> Iterator[RobotUnderTest]:
    """A robot on the simulation, ready; shut down when the block ends.

    Args:
        name_or_path, variant: as for ``build_robot``.
        domain_id: ROS domain; also what ``ROS_DOMAIN_ID`` says.
        nodes: None: those of the robot.
        scenario: a file whose options and faults are used.
        time_scale: simulated seconds per second; ``math.inf``: as fast as it goes.
    """
    plan = load_scenario(scenario) if scenario else Scenario(schema=1)
    descriptor = plan.lay_over(load_robot_descriptor(name_or_path, variant))
    clock = PacedClock(time_scale)
    robot = Robot(descriptor, load_backend(plan.backend), clock)
    faults = FaultSchedule(robot, plan.faults)
    names = descriptor.nodes if nodes is None else nodes
    enable = any(info.enables_servos for info in built_in_nodes().select(names).values())
    use_profiles()
    with (
        RosHost(domain_id=domain_id) as host,
        run_nodes(robot, names, host, parts={"scenario": faults}),
    ):
        under_test = RobotUnderTest(robot, clock, faults, domain_id)
        try:
            robot.start(enable=enable)
            faults.begin()
            yield under_test
        finally:
            under_test.close()
            robot.shutdown()
