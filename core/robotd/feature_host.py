"""Opens the features of a robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pkgutil import resolve_name
from typing import Any

from robotd.errors import PluginError, RobotdError, plugin_failure
from robotd.feature import installed_features
from robotd.observation.tap import Tap
from robotd.open_files import reserve_files
from robotd.robot import Robot

DEFAULT_FRAME_MEMORY_S = 30.0  # of the frames of the tap, where nothing else is asked for


class FeatureHost:
    """Argument of a feature: the robot, its tap, and the parts opened before.

    Main thread.

    Attributes:
        robot: not started.
        node_names: ROS nodes that will be served.
        namespace: of the ROS nodes.
        parts: running part of each feature that was opened before, by the feature's name.
        offered: functions that a feature offers to those opened after it, by name. What they
            return is made only where it is used; None: not for this robot.
        requested: names of features whose part a feature that was opened before uses.
        on_served: called when the robot's nodes answer, before the device is opened, in this order.
            Append functions.
        on_ready: called when the robot has started, in this order. Append functions.
        say: prints a line for the person who started the robot.
    """

    def __init__(
        self, robot: Robot, node_names: Sequence[str], namespace: str, say: Callable[[str], None]
    ) -> None:
        self.robot = robot
        self.node_names = node_names
        self.namespace = namespace
        self.parts: dict[str, Any] = {}
        self.offered: dict[str, Callable[[], Any]] = {}
        self.requested: set[str] = set()
        self.on_served: list[Callable[[], None]] = []
        self.on_ready: list[Callable[[], None]] = []
        self.say = say
        self._tap: Tap | None = None

    def tap(self, seconds: float = DEFAULT_FRAME_MEMORY_S) -> Tap:
        """Return the tap of the robot, which starts when all features are opened.

        Args:
            seconds: time that its frames are held for; the first call decides.
        """
        if self._tap is None:
            reserve_files()
            self._tap = Tap(self.robot, seconds)
        return self._tap

    @property
    def is_observed(self) -> bool:
        """A feature that was opened before uses the tap."""
        return self._tap is not None


@contextmanager
def open_features(
    robot: Robot,
    node_names: Sequence[str] = (),
    namespace: str = "/",
    say: Callable[[str], None] = print,
) -> Iterator[FeatureHost]:
    """Run the features of a robot that is not started. Main thread.

    Raises RobotdError: a feature does not start; PluginError: it fails.
    """
    host = FeatureHost(robot, node_names, namespace, say)
    with ExitStack() as stack:
        for name, feature in installed_features().items():
            try:
                part = stack.enter_context(resolve_name(feature.open)(host))
            except RobotdError:
                raise
            except Exception as error:
                text = f"feature {name!r} does not start: {plugin_failure(error, feature.open)}"
                raise PluginError(text) from error
            if part is not None:
                host.parts[name] = part
        if host.is_observed:
            # Left first: what it sees at the end is still recorded.
            stack.enter_context(host.tap())
        yield host
