"""Tables of alarm, error and abort codes, offered by plugins for ``robotd explain CODE``.

A table is an entry point of the group ``robotd.codes`` that leads to a ``CodeTable``. It is
imported for that command and the live page, so it must not need hardware or a device library.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from robotd.entry_points import entry_points
from robotd.errors import PluginError

GROUP = "robotd.codes"


@dataclass(frozen=True)
class CodeTable:
    """Codes of one kind, such as the emergency codes of CANopen.

    Attributes:
        title: kind of the codes, for people: ``CANopen emergency``.
        texts: meaning of each known code, one line.
        digits: hexadecimal digits of a code; 0: they are written in decimal.
        other: meaning of a code that is not in ``texts``, such as the class that it belongs to,
            "" for none; None: there are no others.
        remedy: what to do about a code, "" where it is not known; None: it never is.
    """

    title: str
    texts: Mapping[int, str]
    digits: int = 4
    other: Callable[[int], str] | None = None
    remedy: Callable[[int], str] | None = None

    def line(self, code: int) -> str:
        """Return ``CANopen emergency 0x8611: following error``; "" for a code of another kind."""
        text = self.texts.get(code) or (self.other(code) if self.other else "")
        number = f"0x{code:0{self.digits}X}" if self.digits and code >= 0 else str(code)
        return f"{self.title} {number}: {text}" if text else ""

    def advice(self, code: int) -> str:
        """Return what to do about a code; "" where it is not known."""
        return self.remedy(code) if self.remedy else ""


def load_code_tables(package: str = "") -> tuple[list[CodeTable], dict[str, str]]:
    """Return the tables of all plugins, and why others failed, by entry point.

    ``package``: only those of this top-level package; "": all.
    """
    tables, failures = [], {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        if package and entry.module.partition(".")[0] != package:
            continue
        try:
            table = entry.load()
            if not isinstance(table, CodeTable):
                raise PluginError(f"{entry.value} is no CodeTable")  # noqa: TRY301
            tables.append(table)
        except Exception as error:  # noqa: BLE001 - of a plugin
            failures[entry.name] = f"{type(error).__name__}: {error}"
    return tables, failures


_REMEDIES = {
    -1: "Read the text of the result: it names joint, value and limit, or what stopped the goal",
    -2: "Compare the names with `robotd status` or the topic joint_states",
    -3: "Set header.stamp to 0 (now) or to a time to come, and compare the clocks of the computers",
    -4: "Look for a blocked or overloaded joint; drive slower, or set another path tolerance",
    -5: "Look for a blocked joint; set goal_time_s or the goal tolerance to what the drive reaches",
}

# control_msgs/action/FollowJointTrajectory, with what robotd means by each.
GOAL_RESULTS = CodeTable(
    "result of a trajectory goal",
    {
        0: "SUCCESSFUL: the goal was reached, or canceled by its client",
        -1: "INVALID_GOAL: rejected, preempted, stopped or ended by a fault; the text says which",
        -2: "INVALID_JOINTS: names of joints are unknown, missing or doubled",
        -3: "OLD_HEADER_TIMESTAMP: the start time is over",
        -4: "PATH_TOLERANCE_VIOLATED: a joint left its path; the text names joint and error",
        -5: "GOAL_TOLERANCE_VIOLATED: a joint was not at the goal within goal_time_s",
    },
    digits=0,
    remedy=lambda code: _REMEDIES.get(code, ""),
)
