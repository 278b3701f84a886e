"""Start-up summary of ``robotd run``: the robot, its ROS interfaces, missing privileges."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from getpass import getuser
from importlib.metadata import version

from robotd.cli.layout import columns, field, heading, warning
from robotd.cli.preflight import realtime_permitted
from robotd.clock.simulated import PacedClock
from robotd.descriptor import DriveSettings
from robotd.motion.limits import AxisLimits
from robotd.plugin.manager import PluginOrigin
from robotd.robot import Robot

SIMULATED = "simulated"  # the capability of a backend without hardware


@dataclass(frozen=True)
class Topic:
    """A topic that is published or subscribed; ``rate_hz`` None where there is no fixed rate."""

    name: str
    type: str
    rate_hz: float | None = None


@dataclass(frozen=True)
class ServeReport:
    """The surface of all nodes: resolved names, sorted, without what every node has."""

    nodes: tuple[str, ...]
    topics: tuple[Topic, ...]
    services: tuple[str, ...]
    actions: tuple[str, ...]


def start_summary(
    robot: Robot, origin: PluginOrigin, report: ServeReport, *, verbose: bool = False
) -> str:
    """Return the start-up summary: about ten lines, with ``verbose`` about sixty."""
    if verbose:
        fields = (*_robot(robot, origin), *_axes(robot), *_ros(report), *_missing(robot))
    else:
        fields = (*_short(robot), *_counts(report), *_missing(robot), *_commands(robot, report))
    title = heading(f"robotd {version('robotd')}: {robot.descriptor.name} on {robot.backend.name}")
    return "\n".join((title, *fields, ""))


def _short(robot: Robot) -> Iterator[str]:
    descriptor = robot.descriptor
    yield field("robot", descriptor.summary or descriptor.name)
    if descriptor.variant:
        yield field("variant", descriptor.variant)
    yield field("backend", f"{robot.backend.name}: {robot.backend.info.summary}")
    yield from _simulated(robot)


def _simulated(robot: Robot) -> Iterator[str]:
    if SIMULATED in robot.backend.capabilities:
        yield field("", [warning("SIMULATED: no hardware is connected, nothing real moves")])
    if isinstance(robot.clock, PacedClock):
        scale = robot.clock.scale
        speed = "as fast as it goes" if math.isinf(scale) else f"{scale:g} times real time"
        yield field("time", f"simulated, {speed}; on /clock")


def _counts(report: ServeReport) -> Iterator[str]:
    counts = [
        f"{len(found)} {what}"
        for found, what in (
            (report.nodes, "nodes"),
            (report.topics, "topics"),
            (report.services, "services"),
            (report.actions, "actions"),
        )
    ]
    yield field("ROS", f"{', '.join(counts)}; --verbose lists them")


def _commands(robot: Robot, report: ServeReport) -> Iterator[str]:
    """Yield what to type in a second terminal."""
    namespaces = {name.rpartition("/")[0] for name in report.nodes if name.endswith("/robotd")}
    namespace = next(iter(namespaces), "")
    where = f" --ros-args -r __ns:={namespace}" if namespace else ""
    joints = robot.descriptor.joints
    step = "0.01" if joints and joints[0].unit == "m" else "0.1"
    move = [f"robotd jog {joints[0].name} {step}{where}"] if joints else []
    yield field("try", [f"robotd status{where}", *move, f"robotd stop{where}"])


def _robot(robot: Robot, origin: PluginOrigin) -> Iterator[str]:
    descriptor, backend = robot.descriptor, robot.backend
    yield field("robot", descriptor.summary or descriptor.name)
    if descriptor.path:
        yield field("", [str(descriptor.path)])
    if descriptor.variants:
        others = [name for name in descriptor.variants if name != descriptor.variant]
        also = f" (available: {', '.join(others)})" if others else ""
        yield field("variant", f"{descriptor.variant or 'none'}{also}")
    origin_text = f"{origin.distribution} {origin.version}"
    yield field("backend", f"{backend.name}: {backend.info.summary} (from {origin_text})")
    yield from _simulated(robot)


def _axes(robot: Robot) -> Iterator[str]:
    descriptor = robot.descriptor
    yield field("cycle", f"{descriptor.cycle.rate_hz:g} Hz")
    joints = [
        (
            joint.name,
            f"axis {joint.axis}",
            _range(limits),
            f"{limits.velocity:.2f} {limits.unit}/s",
            f"{limits.acceleration:.2f} {limits.unit}/s²",
        )
        for joint in descriptor.joints
        for limits in [robot.axes.limits[joint.axis]]
    ]
    drive = descriptor.drive
    if joints or not drive:
        none = "none; no servo is switched on at start"
        yield field("joints", columns(joints) if joints else none)
    if groups := descriptor.groups:
        yield field("groups", [f"{name}: {', '.join(groups[name].joints)}" for name in groups])
    if drive:
        yield field("wheels", _wheels(drive))
    if len(joints) + len(drive.axes if drive else ()) < descriptor.axes:
        yield field("axes", f"{descriptor.axes}, 0 to {descriptor.axes - 1}")
    if gripper := descriptor.gripper:
        bit = f"output bit {gripper.output_byte}.{gripper.output_bit}"
        yield field("gripper", f"{bit} moves {', '.join(gripper.joints)}")
    if servos := descriptor.servo_grippers:
        yield field("grippers", [f"{name}: {gripper.joint}" for name, gripper in servos.items()])


def _range(limits: AxisLimits) -> str:
    if math.isinf(limits.lower) and math.isinf(limits.upper):
        return "no position limits"
    return f"{limits.lower:+.2f} to {limits.upper:+.2f} {limits.unit}"


def _wheels(drive: DriveSettings) -> Iterator[str]:
    names = (name.replace(" wheel", "") for name in drive.wheel_names)
    yield ", ".join(f"{name} axis {axis}" for name, axis in zip(names, drive.axes, strict=True))
    size = (drive.kind, f"radius {drive.wheel_radius_m:g} m", drive.dimensions)
    yield ", ".join(filter(None, size))
    yield f"at most {drive.velocity_m_s:g} m/s and {drive.angular_velocity_rad_s:g} rad/s"


def _ros(report: ServeReport) -> Iterator[str]:
    yield field("nodes", report.nodes)
    topics = [
        (topic.name, f"{topic.rate_hz:g} Hz" if topic.rate_hz else "", topic.type)
        for topic in report.topics
    ]
    yield field("topics", columns(topics) if topics else "none")
    yield field("services", f"{len(report.services)}")
    yield field("actions", report.actions or "none")


def _missing(robot: Robot) -> Iterator[str]:
    priority = robot.descriptor.cycle.realtime_priority
    if not priority or realtime_permitted(priority):
        return
    try:
        user = getuser()
    except (KeyError, OSError):  # a container with a uid that has no name
        user = f"#{os.getuid()}"
    lines = (
        "real-time priority: under load the control loop can start milliseconds late.",
        f"To grant it, put '{user} - rtprio {priority}' into /etc/security/limits.conf.",
    )
    yield field("missing", map(warning, lines))
