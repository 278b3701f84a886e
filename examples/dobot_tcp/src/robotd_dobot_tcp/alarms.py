"""Alarms of the controller in words, for ``robotd explain`` and for the process image."""

from __future__ import annotations

from robotd.api import CodeTable

# An excerpt. The vendor publishes the whole list with its client libraries.
ALARMS = CodeTable(
    "alarm of a Dobot CR controller",
    {
        16: "path close to the shoulder singularity",
        17: "inverse kinematics without a solution",
        18: "inverse kinematics out of the working area",
        48: "joint 1 too fast",
    },
    digits=0,
)


def alarm_text(code: int) -> str:
    """Return the text of ``code``; it always has one."""
    return ALARMS.texts.get(code, "see the alarm list of the controller")
