"""Injects faults at their time or position, at the start of a period."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from robotd.api import NANOSECONDS, InvalidArgument, ProcessImage, RobotdError, get_logger
from robotd.api.robots import Robot
from robotd_scenario.fault_kinds import FAULTS, Fault, LateCycles, validate_fault

FOREVER = 2**62  # ns

log = get_logger("scenario")


@dataclass(frozen=True)
class Happened:
    """A fault that was injected (``over`` False) or removed.

    Attributes:
        time_s: simulated seconds after ``FaultSchedule.begin``.
        failure: why it could not be injected or removed; None on success.
    """

    fault: Fault
    time_s: float
    over: bool
    failure: str | None = None


@dataclass(eq=False)  # equal entries are still separate faults
class _Entry:
    fault: Fault
    due_ns: int
    end_ns: int | None = None
    left: int = 0  # late periods still to be injected
    before: Any = None  # state of its target without faults


class FaultSchedule:
    """Faults of one robot, on a simulated backend.

    Any thread may call, before the control loop starts or while it runs.

    Args:
        robot: on a simulated backend.
        faults: those that ``begin`` adds.

    Attributes:
        happened: what began and ended, in order.
    """

    def __init__(self, robot: Robot, faults: Sequence[Fault] = ()) -> None:
        """Raises the errors of ``add``."""
        self.happened: list[Happened] = []
        self._planned = faults
        for number, fault in enumerate(faults):
            try:
                _check(fault, robot)
            except InvalidArgument as error:
                raise InvalidArgument(f"faults.{number}: {fault}: {error}") from None
        self._robot = robot
        self._clock = robot.clock
        self._origin_ns = robot.clock.now_ns()
        self._entries: list[_Entry] = []
        self._lasting: list[_Entry] = []  # that have begun and will end, the newest last
        self._lock = threading.Lock()
        robot.control_loop.every(robot.descriptor.cycle.rate_hz, "faults", self._look, first=True)

    def begin(self) -> None:
        """Start counting times; call when the robot is ready."""
        self._origin_ns = self._clock.now_ns()
        for fault in self._planned:
            self.add(fault)

    def add(self, fault: Fault) -> None:
        """Schedule ``fault``; its ``at_s`` counts from now.

        Raises InvalidArgument: it does not fit the robot; Unsupported: the backend offers none.
        """
        _check(fault, self._robot)
        due_ns = self._clock.now_ns() + round(fault.at_s * NANOSECONDS)
        with self._lock:
            self._entries.append(_Entry(fault, due_ns))

    @property
    def waiting(self) -> list[Fault]:
        """Faults that have not begun."""
        with self._lock:
            return [entry.fault for entry in self._entries if self._is_waiting(entry)]

    def failures(self) -> list[str]:
        """Describe the faults that failed, and those that have not begun."""
        failed = [f"{fault.fault}: {fault.failure}" for fault in self.happened if fault.failure]
        return failed + [f"{fault}: did not happen" for fault in self.waiting]

    def _look(self, image: ProcessImage) -> None:
        if not self._entries:
            return
        now_ns = self._clock.now_ns()
        with self._lock:
            entries = list(self._entries)
        gone = [entry for entry in entries if self._advance(entry, now_ns)]
        with self._lock:
            self._entries = [entry for entry in self._entries if entry not in gone]

    @staticmethod
    def _is_waiting(entry: _Entry) -> bool:
        return entry.end_ns is None and entry.left == 0

    def _advance(self, entry: _Entry, now_ns: int) -> bool:
        """Inject or remove the fault of ``entry``; True when it is finished."""
        fault = entry.fault
        if not self._is_waiting(entry):
            return self._go_on(entry, now_ns)
        if now_ns < entry.due_ns or (fault.when and not fault.when.happens(self._robot)):
            return False
        self._do(entry, now_ns, over=False)
        duration_s = getattr(fault.kind, "for_s", 0.0)
        if duration_s is None:
            entry.end_ns = FOREVER
        elif duration_s:
            entry.end_ns = now_ns + round(duration_s * NANOSECONDS)
        if entry.end_ns is not None:
            self._lasting.append(entry)
        if isinstance(fault.kind, LateCycles):
            entry.left = fault.kind.count - 1
        return self._is_waiting(entry)

    def _go_on(self, entry: _Entry, now_ns: int) -> bool:
        if entry.left:
            entry.fault.kind.begin(self._robot)
            entry.left -= 1
            return entry.left == 0
        if entry.end_ns is None or now_ns < entry.end_ns:
            return False
        if not entry.fault.kind.can_end(self._robot):
            return False
        self._do(entry, now_ns, over=True)
        return True

    def _others(self, entry: _Entry) -> list[_Entry]:
        """Return the lasting faults of the same target, the newest last."""
        target = entry.fault.kind.target
        return [effect for effect in self._lasting if effect.fault.kind.target == target]

    def _begin(self, entry: _Entry) -> None:
        others, kind = self._others(entry), entry.fault.kind
        entry.before = others[-1].before if others else kind.state(self._robot)
        kind.begin(self._robot)

    def _end(self, entry: _Entry) -> None:
        """Remove a fault, unless another one of its target lasts: the newest of them counts."""
        newest = self._others(entry)[-1]
        self._lasting.remove(entry)
        if not (others := self._others(entry)):
            entry.fault.kind.end(self._robot, entry.before)
        elif newest is entry and not _is_same(others[-1].fault, entry.fault):
            others[-1].fault.kind.begin(self._robot)

    def _do(self, entry: _Entry, now_ns: int, *, over: bool) -> None:
        fault, failure = entry.fault, None
        try:
            (self._end if over else self._begin)(entry)
        except RobotdError as error:
            failure = str(error)
            log.warning("fault failed", fault=str(fault), reason=failure)
        else:
            log.info("fault over" if over else "fault", fault=str(fault))
        self.happened.append(
            Happened(fault, (now_ns - self._origin_ns) / NANOSECONDS, over, failure)
        )


def _is_same(fault: Fault, other: Fault) -> bool:
    """Return True for faults that differ in their duration only."""
    lasting = {"for_s": None}
    return fault.kind.model_copy(update=lasting) == other.kind.model_copy(update=lasting)


class RequestedFaults:
    """Faults of one robot on a simulated backend. Any thread.

    Attributes:
        fields: ``name``, ``type``, ``default`` and ``optional`` of each field, by kind of fault.
    """

    def __init__(self, schedule: FaultSchedule) -> None:
        self._schedule = schedule
        definitions = Fault.model_json_schema()["$defs"]
        self.fields: dict[str, list[dict[str, Any]]] = {}
        for kind in FAULTS:
            model = definitions["".join(map(str.capitalize, kind.split("_")))]
            self.fields[kind] = [_field(*field) for field in model["properties"].items()]

    def inject(self, values: Mapping[str, Any]) -> str:
        """Inject a fault, written as in a scenario file; return it as text.

        Raises DescriptorError: it is not a fault; InvalidArgument: it does not fit the robot.
        """
        fault = validate_fault(values)
        self._schedule.add(fault)
        return str(fault)


def _check(fault: Fault, robot: Robot) -> None:
    _ = robot.fault_injector
    fault.check(robot)


def _field(name: str, spec: Mapping[str, Any]) -> dict[str, Any]:
    types = [spec, *spec.get("anyOf", ())]
    kind = next(choice["type"] for choice in types if choice.get("type"))
    return {
        "name": name,
        "type": kind,
        "default": spec.get("default"),
        "optional": "default" in spec,
    }
