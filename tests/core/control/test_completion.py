"""Requested end of an execution, by clients and by faults."""

from __future__ import annotations

from robotd.control.loop.setpoint_source import Completion, Outcome


class FaultMeanwhile(Completion):
    """The control loop finds a fault while another thread is in ``request``, before it writes."""

    def __init__(self) -> None:
        super().__init__()
        self.looks = 0

    @property
    def outcome(self) -> Outcome | None:
        self.looks += 1
        if self.looks == 1:
            self.escalate("j2: overcurrent")
        return None

    @outcome.setter
    def outcome(self, value: Outcome | None) -> None:
        pass


def test_a_cancel_at_the_moment_of_a_fault_does_not_hide_it() -> None:
    completion = FaultMeanwhile()
    completion.request(Outcome.CANCELED, "by the client")
    assert completion.looks == 1
    assert completion.is_fault
    assert completion.requested == (Outcome.FAULT, "j2: overcurrent")


def test_a_fault_while_stopping_names_both() -> None:
    completion = Completion()
    completion.request(Outcome.CANCELED, "by the client")
    completion.request(Outcome.STOPPED, "by the operator")
    assert completion.requested == (Outcome.CANCELED, "by the client")
    completion.escalate("j2: overcurrent")
    text = "j2: overcurrent (while stopping: by the client)"
    assert completion.requested == (Outcome.FAULT, text)
