"""Diagnostic status of each part of a robot: pure functions, no ROS."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import IntEnum

from robotd.control.loop.period_timing import LoopReport
from robotd.device.bus_status import BusNode, BusState, BusStatus
from robotd.device.process_image import ProcessImage
from robotd.device.state import CommandMode, ConnectionState, Operation

SLOW = 0.95  # part of the control loop's rate below which it is too slow


class DiagnosticLevel(IntEnum):
    """The numbers of diagnostic_msgs/DiagnosticStatus."""

    OK = 0  # as it should be
    WARN = 1  # works, or would, but needs attention
    ERROR = 2  # does not work
    STALE = 3  # nothing is known now


@dataclass(frozen=True)
class PartStatus:
    """Status of one part: ``message`` explains its level, ``values`` give details."""

    part: str
    level: DiagnosticLevel
    message: str
    values: dict[str, str] = field(default_factory=dict)


def engine_status(
    state: ConnectionState, backend: str, fault: str = "", step: str = "", *, ready: bool
) -> PartStatus:
    """Status of the connection: OK when commandable, ERROR when lost, else WARN.

    Args:
        fault: why the device is not ready; "" where it was not started, or stopped on purpose.
        step: what a start-up is doing; it goes before the fault.
    """
    values = {"state": state.value, "ready": "yes" if ready else "no", "backend": backend}
    if ready and fault:
        return PartStatus("engine", DiagnosticLevel.ERROR, fault, values)
    if ready:
        return PartStatus("engine", DiagnosticLevel.OK, state.value, values)
    if step:
        return PartStatus("engine", DiagnosticLevel.WARN, f"{state.value}: {step}", values)
    text = f"{state.value}: axes cannot be commanded"
    if state is ConnectionState.UNKNOWN:
        text = "the device gives no fresh values"
    lost = bool(fault) or state is ConnectionState.UNKNOWN
    message = f"{text}: {fault}" if fault else text
    return PartStatus(
        "engine", DiagnosticLevel.ERROR if lost else DiagnosticLevel.WARN, message, values
    )


def axis_status(
    part: str,
    axis: int,
    image: ProcessImage,
    state: ConnectionState,
    outside: str = "",
    *,
    used: bool,
) -> PartStatus:
    """Status of one axis; a servo that should be on warns when off.

    Args:
        image: consistent copy.
        outside: its position where that is outside its limits, or "".
        used: it should be on.
    """
    if state is not ConnectionState.COMMUNICATING:
        return unknown_status(part, state)
    servo = "on" if image.servo_on[axis] else "off"
    level, message = next(
        _complaints(axis, image, outside, used=used), (DiagnosticLevel.OK, f"servo {servo}")
    )
    error = image.position_command[axis] - image.position[axis]
    values = {
        "axis": str(axis),
        "servo": servo,
        "alarm code": str(image.alarm_code[axis]),
        "mode": CommandMode(image.mode[axis]).name.lower(),
        "operation": Operation(image.operation[axis]).name.lower(),
        "position (rad or m)": _number(image.position[axis]),
        "velocity (rad/s or m/s)": _number(image.velocity[axis]),
        "torque (N·m or N)": _number(image.torque[axis]),
        "following error (rad or m)": _number(error),
    }
    if image.mode[axis] != CommandMode.POSITION:
        del values["following error (rad or m)"]
    return PartStatus(part, level, message, values)


def fieldbus_status(part: str, network: BusStatus, *, losing: bool) -> PartStatus:
    """Status of a bus: ERROR for a lost node, WARN for one not operational."""
    errors = [f"node {node.id} {fault}" for node in network.nodes if (fault := _node_fault(node))]
    warnings = [
        f"node {node.id} is {node.state.value}"
        for node in network.nodes
        if node.state is not BusState.OPERATIONAL and not node.offline
    ]
    if losing:
        warnings.append("packets are being lost")
    level = (
        DiagnosticLevel.ERROR
        if errors
        else DiagnosticLevel.WARN
        if warnings
        else DiagnosticLevel.OK
    )
    message = "; ".join([*errors, *warnings]) or f"{len(network.nodes)} nodes operational"
    values = {
        "bus state": network.state.value,
        "period (µs)": str(round(network.period_s * 1e6)),
        "packet loss": str(network.lost_frames),
        "packet timeout": str(network.timeouts),
        "over cycle": str(network.late_cycles),
        **network.details,
    }
    return PartStatus(part, level, message, values)


def control_loop_status(
    report: LoopReport, rate_hz: float, realtime: str, *, running: bool, missed: bool
) -> PartStatus:
    """Status of the control loop: ERROR when stopped, WARN for missed deadlines.

    Args:
        rate_hz: nominal rate.
        realtime: the scheduling that was granted, for people.
        running, missed: whether it ran, and missed deadlines, lately.
    """
    values = {
        "rate (Hz)": f"{report.rate_hz:.1f}",
        "wanted rate (Hz)": f"{rate_hz:g}",
        "lateness p50 (µs)": f"{report.lateness_p50_us:.0f}",
        "lateness p99 (µs)": f"{report.lateness_p99_us:.0f}",
        "lateness max (µs)": f"{report.lateness_max_us:.0f}",
        "execution p99 (µs)": f"{report.execution_p99_us:.0f}",
        "periods": str(report.cycles),
        "missed deadlines": str(report.missed),
        "late setpoints": str(report.late_setpoints),
        "real-time priority": realtime,
    }
    if report.cycles == 0:
        return PartStatus("cycle", DiagnosticLevel.STALE, "not started", values)
    if not running:
        return PartStatus("cycle", DiagnosticLevel.ERROR, "has stopped", values)
    if missed:
        return PartStatus("cycle", DiagnosticLevel.WARN, "deadlines are being missed", values)
    if report.rate_hz < SLOW * rate_hz:
        message = f"{report.rate_hz:.0f} Hz instead of {rate_hz:g} Hz"
        return PartStatus("cycle", DiagnosticLevel.WARN, message, values)
    return PartStatus("cycle", DiagnosticLevel.OK, f"{rate_hz:g} Hz", values)


def motion_status(stopped: str, speed: str, inactive: str = "") -> PartStatus:
    """Status of the motion of all axes.

    Args:
        stopped: reason of a stop, or "".
        speed: in words.
        inactive: state of a managed robot that is not active, or "".
    """
    values = {"speed": speed}
    if inactive:
        return PartStatus(
            "motion", DiagnosticLevel.WARN, f"not allowed: the robot is {inactive}", values
        )
    if stopped:
        return PartStatus("motion", DiagnosticLevel.WARN, f"stopped: {stopped}", values)
    return PartStatus("motion", DiagnosticLevel.OK, f"allowed, {speed}", values)


def gripper_status(state: ConnectionState, *, closed: bool) -> PartStatus:
    """Status of the gripper: its command; no sensor measures its position."""
    if state is not ConnectionState.COMMUNICATING:
        return unknown_status("gripper", state)
    return PartStatus(
        "gripper", DiagnosticLevel.OK, "commanded closed" if closed else "commanded open"
    )


def unknown_status(part: str, state: ConnectionState) -> PartStatus:
    """STALE, because the engine does not communicate."""
    text = f"not known: the device does not communicate (engine state {state.value})"
    return PartStatus(part, DiagnosticLevel.STALE, text)


def _node_fault(node: BusNode) -> str:
    what = "is offline" if node.offline else ""
    if node.error_code:
        what = what or f"has error code {node.error_code:#06x}"
    return f"{what or 'has a fault'}: {node.fault}" if node.fault else what


def _complaints(
    axis: int, image: ProcessImage, outside: str, *, used: bool
) -> Iterator[tuple[DiagnosticLevel, str]]:
    """Yield the problems of an axis, the worst first."""
    if fault := image.fault(axis):
        yield DiagnosticLevel.ERROR, fault
    if outside:
        yield DiagnosticLevel.WARN, outside
    if image.negative_limit[axis]:
        yield DiagnosticLevel.WARN, "on the negative limit switch"
    if image.positive_limit[axis]:
        yield DiagnosticLevel.WARN, "on the positive limit switch"
    if used and not image.servo_on[axis]:
        yield DiagnosticLevel.WARN, "servo off"


def _number(value: float) -> str:
    return "not known" if math.isnan(value) else f"{value:.6g}"
