"""Explanation of a recording: root cause, who commanded it, and the events in order."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robotd.api import NANOSECONDS
from robotd.api.features import VALUES, Event, EventKind, Level
from robotd_recording.recording_reader import Recording
from robotd_recording.recording_writer import RecordingInfo

CAUSE_WINDOW_S = 1.0  # before the symptom: its cause is the first bad event in it
SHOWN_BEFORE_S, SHOWN_AFTER_S = 10.0, 5.0
LATE_US = 1000.0  # lateness of the control loop that is worth a line
MOTION_CALLS = frozenset({"move", "jog", "command"})


@dataclass(frozen=True)
class Incident:
    """Root cause of a recording, its command and the events around it.

    Attributes:
        cause: first bad event; None where there is none.
        command: goal or motion command of its axis in force at that time; None: none is recorded.
        events: around the cause, in the order of time; all of them without a cause.
    """

    cause: Event | None
    command: Event | None
    events: tuple[Event, ...]


def find_incident(recording: Recording) -> Incident:
    """Find the root cause: the first bad event shortly before the symptom."""
    events = recording.events
    bad = [event for event in events if event.is_bad]
    # The same text may be of an earlier one, too.
    saved_for = (recording.info.cause_ns, recording.info.cause)
    symptom = next((event for event in events if (event.time_ns, event.text) == saved_for), None)
    symptom = symptom or next(iter(bad), None)
    if symptom is None:
        return Incident(None, None, events)
    earliest_ns = symptom.time_ns - CAUSE_WINDOW_S * NANOSECONDS
    cause = next((event for event in bad if earliest_ns <= event.time_ns), symptom)
    cause = cause if cause.time_ns <= symptom.time_ns else symptom
    first_ns = cause.time_ns - SHOWN_BEFORE_S * NANOSECONDS
    last_ns = cause.time_ns + SHOWN_AFTER_S * NANOSECONDS
    shown = tuple(event for event in events if first_ns <= event.time_ns <= last_ns)
    return Incident(cause, _command(recording.info, events, cause), shown)


def explain(recording: Recording, meanings: Sequence[str] = ()) -> Iterator[str]:
    """Yield lines for people, the root cause first.

    Args:
        recording: read whole.
        meanings: of the alarm code of the root cause, from the tables of the backends.
    """
    incident = find_incident(recording)
    yield _title(recording)
    if incident.cause is None:
        yield "nothing went wrong in it"
    else:
        yield ""
        yield "Root cause"
        yield from _cause_lines(recording, incident, incident.cause, meanings)
    yield ""
    yield "Events"
    zero_ns = incident.cause.time_ns if incident.cause else recording.start_ns
    for event in incident.events:
        if event.level is not Level.DEBUG:
            sender = f"  [{event.sender}]" if event.sender not in ("", "robotd") else ""
            mark = "*" if event is incident.cause else " "
            at_s = (event.time_ns - zero_ns) / NANOSECONDS
            yield f"{mark} {at_s:+9.3f} s  {event.kind:<8}{event.text}{sender}"


def joint_values(recording: Recording, axis: int, time_ns: int) -> dict[str, float]:
    """Return measured and commanded values of an axis in the period of ``time_ns``."""
    frames = recording.frames
    index = int(np.searchsorted(frames["start_ns"], time_ns, side="right")) - 1
    if index < 0:
        return {}
    values = dict(zip(VALUES, frames["values"][index, :, axis].tolist(), strict=True))
    return {name: value for name, value in values.items() if not np.isnan(value)}


def _title(recording: Recording) -> str:
    info = recording.info
    start_s = (recording.start_ns + info.offset_ns) / NANOSECONDS
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(start_s))
    variant = f" ({info.variant})" if info.variant else ""
    return (
        f"{info.robot}{variant} on {info.backend}, {began}, {recording.duration_s:.1f} s"
        f" at {info.rate_hz:g} Hz"
    )


def _cause_lines(
    recording: Recording, incident: Incident, cause: Event, meanings: Sequence[str]
) -> Iterator[str]:
    yield f"  {cause.text}"
    for meaning in meanings:
        yield f"  {meaning}"
    if cause.subject in recording.info.axes:
        yield from _value_lines(recording, cause)
    if (command := incident.command) is not None:
        age_s = (cause.time_ns - command.time_ns) / NANOSECONDS
        who = command.sender or "unknown client"
        yield f"  commanded by {who}, {age_s:.3f} s before: {command.text}"
    yield from _loop_lines(recording, cause)


def _value_lines(recording: Recording, cause: Event) -> Iterator[str]:
    """Yield the values of the axis, each against its limit where it has one."""
    axis = recording.info.axes.index(cause.subject)
    # One period before: a drive in alarm may have lost its values.
    period_ns = round(NANOSECONDS / recording.info.rate_hz)
    values = joint_values(recording, axis, cause.time_ns - period_ns)
    unit = recording.info.unit(cause.subject)
    lower, upper, velocity, _ = recording.info.limits.get(cause.subject, (np.nan,) * 4)
    if "position" in values:
        limits = f", limits {lower:g} to {upper:g} {unit}" if np.isfinite(lower) else ""
        yield f"  position {values['position']:+z.4f} {unit}{limits}"
    if "position_command" in values and "position" in values:
        error = values["position_command"] - values["position"]
        command = values["position_command"]
        yield f"  following error {error:+z.5f} {unit}, command {command:+z.4f} {unit}"
    if "velocity" in values:
        limit = f", limit {velocity:g} {unit}/s" if np.isfinite(velocity) else ""
        yield f"  velocity {values['velocity']:+z.4f} {unit}/s{limit}"
    if "torque" in values:
        effort = "force" if unit == "m" else "torque"
        yield f"  {effort} {values['torque']:+z.3f} {'N' if unit == 'm' else 'N·m'}"


def _loop_lines(recording: Recording, cause: Event) -> Iterator[str]:
    """Yield the lateness of the control loop where it is large."""
    frames = recording.frames
    first_ns = cause.time_ns - CAUSE_WINDOW_S * NANOSECONDS
    near = frames[(frames["start_ns"] >= first_ns) & (frames["start_ns"] <= cause.time_ns)]
    if len(near):
        late_us = float(near["late_ns"].max()) / 1000
        missed = int(near["missed"][-1] - near["missed"][0])
        if late_us > LATE_US or missed:
            yield (
                f"  control loop in the second before: up to {late_us / 1000:.1f} ms late,"
                f" {missed} deadlines missed"
            )


def _command(info: RecordingInfo, events: Sequence[Event], cause: Event) -> Event | None:
    """Return the last goal or motion command of its axis before the cause, unless it had ended."""
    found = None
    for event in events:
        if event.time_ns > cause.time_ns:
            break
        is_motion = event.kind is EventKind.COMMAND and event.subject in MOTION_CALLS
        is_motion |= event.kind is EventKind.GOAL
        is_motion = is_motion and event.data.get("outcome") == "accepted"
        if is_motion and _may_move(event, cause.subject, info):
            found = event
        is_end = event.kind is EventKind.RESULT and event is not cause
        if is_end and found is not None and event.data.get("id") == found.data.get("id"):
            found = None
    return found


def _may_move(command: Event, subject: str, info: RecordingInfo) -> bool:
    """Return False for a command of other axes than ``subject``; True where that is not an axis."""
    if subject not in info.axes:
        return True
    if command.kind is EventKind.GOAL:
        return subject in command.data["joints"]
    if command.subject == "command":  # of a base
        return info.axes.index(subject) not in info.joints
    return re.search(rf"\b{re.escape(subject)}\b", command.text) is not None
