"""Picture of the seconds around the root cause of a recording; needs matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from robotd.api import NANOSECONDS, OperationError
from robotd.api.features import EventKind, Frames
from robotd_recorder.explanation import Incident, find_incident
from robotd_recording.recording_reader import Recording

BEFORE_S, AFTER_S = 8.0, 2.0
SIZE_INCHES = (11.0, 9.0)
DOTS_PER_INCH = 110


def plot_incident(recording: Recording, path: Path) -> None:
    """Write a picture of the ten seconds around the root cause; of all without one.

    Raises OperationError: matplotlib is not installed, there is nothing to plot, or the file
    cannot be written.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise OperationError("--plot needs matplotlib: pip install 'robotd[plot]'") from error
    incident = find_incident(recording)
    frames, zero_ns = _window(recording, incident)
    if len(frames) == 0:
        raise OperationError(f"{recording.path}: it has no values to plot")
    figure = Figure(figsize=SIZE_INCHES, layout="constrained")
    panels = figure.subplots(4, 1, sharex=True)
    times_s = (frames["start_ns"] - zero_ns) / NANOSECONDS
    _plot_axes(recording, incident, frames, times_s, panels)
    panels[3].plot(times_s, frames["late_ns"] / 1e3, color="black", linewidth=0.7)
    panels[3].set_ylabel("lateness (µs)")
    panels[3].set_xlabel("time (s); 0 is the root cause" if incident.cause else "time (s)")
    for panel in panels:
        panel.grid(visible=True, linewidth=0.3)
        _mark_events(panel, incident, zero_ns, times_s)
    text = incident.cause.text if incident.cause else "no fault"
    figure.suptitle(f"{recording.info.robot} on {recording.info.backend}: {text}")
    try:
        figure.savefig(path, dpi=DOTS_PER_INCH)
    except OSError as error:
        raise OperationError(f"{path}: {error.strerror or error}") from error
    except ValueError as error:  # an ending that stands for no format
        raise OperationError(f"{path}: {error}") from error


def _window(recording: Recording, incident: Incident) -> tuple[Frames, int]:
    frames = recording.frames
    if incident.cause is None:
        return frames, recording.start_ns
    zero_ns = incident.cause.time_ns
    offsets = frames["start_ns"] - zero_ns
    near = (offsets >= -BEFORE_S * NANOSECONDS) & (offsets <= AFTER_S * NANOSECONDS)
    return frames[near], zero_ns


def _plot_axes(
    recording: Recording, incident: Incident, frames: Frames, times_s: Any, panels: Any
) -> None:
    """Plot position, following error and velocity; the axis of the root cause stands out."""
    cause = incident.cause.subject if incident.cause else ""
    command, _, position, velocity = (frames["values"][:, row] for row in range(4))
    for axis, name in enumerate(recording.info.axes):
        is_cause = name == cause or cause not in recording.info.axes
        style: dict[str, Any] = {"linewidth": 1.4 if is_cause else 0.7}
        style |= {"color": f"C{axis}", "alpha": 1.0 if is_cause else 0.45}
        panels[0].plot(times_s, position[:, axis], label=name, **style)
        panels[0].plot(times_s, command[:, axis], linestyle="--", **style)
        panels[1].plot(times_s, command[:, axis] - position[:, axis], **style)
        panels[2].plot(times_s, velocity[:, axis], **style)
    units = sorted({recording.info.unit(name) for name in recording.info.axes})
    panels[0].set_ylabel(f"position ({', '.join(units)})\n-- command")
    panels[1].set_ylabel(f"following error ({', '.join(units)})")
    panels[2].set_ylabel(f"velocity ({', '.join(f'{unit}/s' for unit in units)})")
    panels[0].legend(loc="upper left", ncols=8, fontsize="small")


def _mark_events(panel: Any, incident: Incident, zero_ns: int, times_s: Any) -> None:
    for event in incident.events:
        at_s = (event.time_ns - zero_ns) / NANOSECONDS
        if not np.min(times_s) <= at_s <= np.max(times_s):
            continue
        if event.is_bad:
            panel.axvline(at_s, color="red", linewidth=1.0)
        elif event.kind is EventKind.GOAL:
            panel.axvline(at_s, color="green", linewidth=1.0)
