"""The engine's life: retries, parameters, readiness, and an end that always closes."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from structlog.testing import capture_logs
from tests.core.device.harness import call_names, make_connection
from tests.fakes import FakeDevice

from robotd.device.connection import Connection, StartupStep
from robotd.device.state import ConnectionState
from robotd.errors import (
    ConnectError,
    DeviceTimeout,
    NotReady,
    OperationError,
)


def test_start_opens_scans_and_communicates(device: FakeDevice) -> None:
    connection = make_connection(device, communication_timeout_s=7.0)
    assert connection.state is ConnectionState.IDLE
    connection.start()
    assert device.calls == [("open", "", ""), ("scan_network",), ("start_communication", 7.0)]
    assert connection.ready
    assert connection.state is ConnectionState.COMMUNICATING


def test_open_is_tried_again_until_it_works() -> None:
    device = FakeDevice(failing_opens=2)
    device.failures["open"] = ConnectError("locked")
    connection = make_connection(device, open_tries=3)
    connection.start()
    assert call_names(device).count("open") == 3
    assert connection.ready


def test_a_permanent_error_is_raised_at_once() -> None:
    device = FakeDevice()
    device.failures["open"] = ConnectError("no such interface", permanent=True)
    connection = make_connection(device, open_tries=5, open_retry_s=3600.0)
    with pytest.raises(ConnectError, match="no such interface"):
        connection.start()
    assert [call[0] for call in device.calls].count("open") == 1


def test_the_last_open_error_is_raised() -> None:
    device = FakeDevice()
    device.failures["open"] = ConnectError("locked")
    connection = make_connection(device, open_tries=3)
    with pytest.raises(ConnectError, match="locked"):
        connection.start()
    assert call_names(device) == ["open"] * 3
    assert not connection.ready


def test_only_a_connect_error_is_worth_another_try(device: FakeDevice) -> None:
    device.failures["open"] = DeviceTimeout("no answer")
    with pytest.raises(DeviceTimeout):
        make_connection(device).start()
    assert call_names(device) == ["open"]


def test_abort_start_ends_the_wait_between_two_tries() -> None:
    device = FakeDevice()
    device.failures["open"] = ConnectError("locked")
    connection = make_connection(device, open_tries=2, open_retry_s=3600.0)
    tried = threading.Event()
    device.record = _signalling(device.record, tried)  # type: ignore[method-assign]
    starting = threading.Thread(target=connection.start)
    starting.start()
    assert tried.wait(5.0)
    connection.abort_start()
    starting.join(5.0)
    assert not starting.is_alive()
    assert call_names(device) == ["open"]


def _signalling(record: Callable[..., None], event: threading.Event) -> Callable[..., None]:
    def recorded(*call: object) -> None:
        event.set()
        record(*call)

    return recorded


def test_opening_an_open_device_has_no_effect(device: FakeDevice) -> None:
    connection = make_connection(device)
    connection.open("/dev/one", "me")
    connection.open()
    assert device.calls == [("open", "/dev/one", "me")]


def test_opening_another_device_asks_to_close_first(device: FakeDevice) -> None:
    connection = make_connection(device)
    connection.open()
    with pytest.raises(NotReady, match="close it before opening '/dev/two'"):
        connection.open("/dev/two")


def test_communication_needs_an_open_device(device: FakeDevice) -> None:
    connection = make_connection(device)
    with pytest.raises(NotReady, match="not open"):
        connection.start_communication()
    with pytest.raises(NotReady, match="not open"):
        connection.scan_network()


def test_listeners_hear_the_present_state_and_every_change_once(device: FakeDevice) -> None:
    connection = make_connection(device)
    heard: list[bool] = []
    connection.on_ready(heard.append)
    connection.start()
    connection.update_ready()
    connection.stop_communication()
    assert heard == [False, True, False]


def test_stale_values_are_not_ready_and_unknown_until_they_are_fresh(device: FakeDevice) -> None:
    connection = make_connection(device)
    connection.start()
    connection.set_stale(True)
    assert not connection.ready
    assert connection.state is ConnectionState.UNKNOWN
    with pytest.raises(NotReady, match=r"state Unknown\)$"):
        connection.require_ready()
    device.fault = lambda: "the cable is out"  # type: ignore[method-assign]
    with pytest.raises(NotReady, match=r"state Unknown\): the cable is out$"):
        connection.require_ready()
    connection.set_stale(False)
    assert connection.ready


def test_motion_is_brought_to_rest_before_communication_stops(device: FakeDevice) -> None:
    connection = make_connection(device)
    connection.before_stop = lambda: device.calls.append(("at rest",))
    connection.stop_communication()
    assert device.calls == []
    connection.start()
    connection.stop_communication()
    assert device.calls[-2][0] == "at rest"
    assert device.calls[-1][0] == "stop_communication"


def test_shutdown_is_for_good(device: FakeDevice) -> None:
    connection = make_connection(device)
    connection.start()
    connection.shutdown()
    assert call_names(device)[-2:] == ["stop_communication", "close"]
    assert connection.state is ConnectionState.SHUTDOWN
    assert not connection.ready
    for command in (connection.open, connection.start_communication):
        with pytest.raises(NotReady, match="shut down"):
            command()
    connection.shutdown()


def test_a_failing_stop_does_not_keep_the_device_open(device: FakeDevice) -> None:
    connection = make_connection(device)
    connection.start()
    device.failures["stop_communication"] = DeviceTimeout("still cyclic")
    with pytest.raises(DeviceTimeout):
        connection.shutdown()
    assert call_names(device)[-1] == "close"
    assert connection.state is ConnectionState.SHUTDOWN


def test_whoever_commands_a_device_that_does_not_communicate_is_told_why(
    device: FakeDevice,
) -> None:
    connection = make_connection(device)
    connection.start()
    device.current = ConnectionState.RUNNING
    device.fault = lambda: "the licence has run out"  # type: ignore[method-assign]
    connection.update_ready()
    with pytest.raises(NotReady, match=r"state Running\): the licence has run out$"):
        connection.require_ready()


class SlowDevice(FakeDevice):
    """A device that begins to communicate by itself, after its start has timed out."""

    def start_communication(self, timeout_s: float) -> None:
        self.record("start_communication", timeout_s)
        raise DeviceTimeout("the link is not up")


def test_a_start_that_timed_out_is_undone_and_never_becomes_ready(parameters: Path) -> None:
    device = SlowDevice()
    connection = make_connection(device, parameters)
    with pytest.raises(DeviceTimeout, match="the link is not up"):
        connection.start()
    assert call_names(device)[-1] == "stop_communication"
    device.current = ConnectionState.COMMUNICATING  # the link came up after all
    connection.update_ready()
    assert not connection.ready
    with pytest.raises(NotReady, match="although its start failed: the link is not up"):
        connection.require_ready()
    connection.start_communication()
    assert call_names(device)[-1] == "load_parameters"
    assert connection.ready


def test_communication_that_somebody_else_started_is_not_ready(device: FakeDevice) -> None:
    connection = make_connection(device)
    connection.open()
    device.current = ConnectionState.COMMUNICATING
    connection.update_ready()
    assert not connection.ready
    assert "communication was not started by robotd" in connection.rejection


def test_a_failed_restart_leaves_what_still_communicates_alone(device: FakeDevice) -> None:
    connection = make_connection(device)
    connection.start()
    device.current = ConnectionState.UNKNOWN  # some nodes are lost, the others go on
    device.failures["start_communication"] = ConnectError("node 3 does not answer")
    with pytest.raises(ConnectError):
        connection.start_communication()
    assert "stop_communication" not in call_names(device)
    device.current = ConnectionState.COMMUNICATING
    connection.update_ready()
    assert not connection.ready


def test_a_request_to_end_during_the_start_of_communication_undoes_it(
    device: FakeDevice, parameters: Path
) -> None:
    connection = make_connection(device, parameters)
    start = device.start_communication

    def interrupted(timeout_s: float) -> None:
        start(timeout_s)
        connection.abort_start()

    device.start_communication = interrupted  # type: ignore[method-assign]
    with pytest.raises(NotReady, match="shut down"):
        connection.start()
    assert call_names(device)[-2:] == ["start_communication", "stop_communication"]
    assert not connection.ready


def test_a_slow_step_of_the_start_up_is_told_while_it_lasts() -> None:
    step = StartupStep(report_interval_s=0.02)
    told = threading.Event()
    with capture_logs() as lines, step.running("starting communication"):
        assert step.text == "starting communication for 0 s"
        with step.running("loading parameters"):
            assert step.text.startswith("loading parameters")
        assert step.text.startswith("starting communication")
        for _ in range(500):
            if lines or told.wait(0.01):
                break
    assert step.text == ""
    assert lines[0]["event"] == "start-up takes long"
    assert lines[0]["step"] == "starting communication"


def test_a_device_that_is_starting_says_so_to_who_commands_it(device: FakeDevice) -> None:
    engine = make_connection(device)
    heard: list[str] = []
    start = device.start_communication

    def noted(timeout_s: float) -> None:
        heard.append(engine.rejection)
        start(timeout_s)

    device.start_communication = noted  # type: ignore[method-assign]
    engine.start()
    assert heard == ["engine is not ready (state Running): starting communication for 0 s"]


def test_the_failure_of_the_last_start_is_the_reason_until_it_is_stopped(
    device: FakeDevice,
) -> None:
    engine = make_connection(device)
    device.failures["start_communication"] = OperationError("no link")
    with pytest.raises(OperationError):
        engine.start()
    assert engine.rejection.endswith("(state Running): the last start failed: no link")
    del device.failures["start_communication"]
    engine.start_communication()
    engine.stop_communication()
    assert engine.rejection == "engine is not ready (state Running)"


def test_a_rejection_while_the_reason_ends_is_a_whole_sentence(
    device: FakeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine, reasons = make_connection(device), iter(["values are old", ""])
    monkeypatch.setattr(Connection, "reason", property(lambda _: next(reasons)))
    assert engine.rejection.endswith("): values are old")
