"""Feature host: opens the features of a robot, and leaves out those that fail."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pkgutil import resolve_name
from threading import Timer
from typing import Any

from robotd.call_timeout import interrupted_after
from robotd.descriptor import RobotDescriptor
from robotd.entry_points import OWN, module_of, owner_of
from robotd.errors import RobotdError, plugin_failure
from robotd.feature import Feature, feature_errors, feature_origin, installed_features
from robotd.log import get_logger
from robotd.observation.tap import Tap
from robotd.open_files import reserve_files
from robotd.plugin.manager import Backend
from robotd.robot import Robot

log = get_logger("feature")

SLOW_OPEN_S = 10.0
OPEN_LIMIT_S = 30.0  # of one of a third party
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


def prepared(descriptor: RobotDescriptor, backend: Backend) -> RobotDescriptor:
    """Return the descriptor as the features change it for a backend.

    One of a third party that fails changes nothing where the file has none of its keys.
    """
    for name, feature in installed_features().items():
        if not feature.prepare:
            continue
        try:
            with feature_errors(name, "prepare"), _limited(name):
                changed = resolve_name(feature.prepare)(descriptor, backend)
                if not isinstance(changed, RobotDescriptor):
                    raise TypeError(f"returned {type(changed).__name__}, not a RobotDescriptor")
        except RobotdError as error:
            _leave_out(name, feature, descriptor, error)
        else:
            descriptor = changed
    return descriptor


@contextmanager
def open_features(
    robot: Robot,
    node_names: Sequence[str] = (),
    namespace: str = "/",
    say: Callable[[str], None] = print,
) -> Iterator[FeatureHost]:
    """Run the features of a robot that is not started. Main thread.

    One of a third party that does not start within 30 s is left out where the robot's file has none
    of its keys. Raises RobotdError: a feature does not start; PluginError: it fails.
    """
    host = FeatureHost(robot, node_names, namespace, say)
    with ExitStack() as stack:
        for name, feature in installed_features().items():
            callbacks = [*host.on_served], [*host.on_ready]
            try:
                part = _enter(stack, name, feature, host)
            except RobotdError as error:
                _leave_out(name, feature, robot.descriptor, error)
                host.on_served, host.on_ready = callbacks
                continue
            if part is not None:
                host.parts[name] = part
        if host.is_observed:
            # Left first: what it sees at the end is still recorded.
            stack.enter_context(host.tap())
        yield host


def _leave_out(
    name: str, feature: Feature, descriptor: RobotDescriptor, error: RobotdError
) -> None:
    """Log what failed in a feature. Raises ``error`` where the robot is not to run without it."""
    if feature_origin(name).is_own or descriptor.names_any(feature.keys):
        raise error
    log.warning("a feature failed", feature=str(feature_origin(name)), reason=str(error))


def _enter(stack: ExitStack, name: str, feature: Feature, host: FeatureHost) -> Any:
    """Open a feature until ``stack`` ends, and return its part."""
    slow = Timer(SLOW_OPEN_S, _warn_slow, (name,))
    slow.daemon = True
    slow.start()
    with feature_errors(name, "open"):
        try:
            with _limited(name):
                manager = resolve_name(feature.open)(host)
                if not isinstance(manager, AbstractContextManager):
                    raise TypeError(f"returned {type(manager).__name__}, not a context manager")
                part = manager.__enter__()
        finally:
            slow.cancel()

    def leave(*error: Any) -> bool:
        try:
            with feature_errors(name, "open"):
                return bool(manager.__exit__(*error))
        except RobotdError as failure:
            _leave_out(name, feature, host.robot.descriptor, failure)
            return False

    stack.push(leave)
    with feature_errors(name, "open"):
        added: list[object] = [*host.on_served, *host.on_ready]
        if wrong := [task for task in added if not callable(task)]:
            raise TypeError(f"{wrong[0]!r:.60} cannot be called when the robot is served or ready")
    return part


def _limited(name: str) -> AbstractContextManager[None]:
    """Limit a feature of a third party, in this thread: its servers and signals belong to it."""
    return nullcontext() if feature_origin(name).is_own else interrupted_after(OPEN_LIMIT_S)


def _warn_slow(name: str) -> None:
    """Name a feature that is not open yet; until the limit, or where that does not end it."""
    log.warning("a feature takes long to open", feature=str(feature_origin(name)))


def call_each(callbacks: Iterable[Callable[[], None]]) -> None:
    """Call functions of features; what one of a third party raises is logged with its name.

    Raises RobotdError, and what robotd's own functions raise.
    """
    for callback in callbacks:
        module = module_of(callback)
        try:
            callback()
        except RobotdError:
            raise
        except Exception as error:
            owner = owner_of(module)
            if owner.partition(" ")[0] in ("", OWN):
                raise
            log.error(
                "a callback of a feature failed",
                plugin=owner,
                reason=plugin_failure(error, module),
            )
