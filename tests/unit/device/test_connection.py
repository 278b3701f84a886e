"""The engine's life: retries, parameters, readiness, and an end that always closes."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from structlog.testing import capture_logs
from tests.fakes import FakeDevice

from robotd.descriptor import EngineSettings
from robotd.device.connection import Connection
from robotd.device.startup_step import StartupStep
from robotd.device.state import ConnectionState
from robotd.errors import (
    ConnectError,
    DescriptorError,
    DeviceTimeout,
    NotReady,
    OperationError,
    Unsupported,
)


def make(device: FakeDevice, parameters: Path | None = None, **settings: Any) -> Connection:
    return Connection(
        device, EngineSettings(**{"open_retry_s": 0.0, **settings}), parameters, "fake"
    )


def names(device: FakeDevice) -> list[object]:
    return [call[0] for call in device.calls]


@pytest.fixture
def device() -> FakeDevice:
    return FakeDevice()


@pytest.fixture
def parameters(tmp_path: Path) -> Path:
    path = tmp_path / "parameters.xml"
    path.write_text("<Parameters/>", encoding="utf-8")
    return path


def test_start_opens_scans_and_communicates(device: FakeDevice) -> None:
    connection = make(device, communication_timeout_s=7.0)
    assert connection.state is ConnectionState.IDLE
    connection.start()
    assert device.calls == [("open", "", ""), ("scan_network",), ("start_communication", 7.0)]
    assert connection.ready
    assert connection.state is ConnectionState.COMMUNICATING


def test_open_is_tried_again_until_it_works() -> None:
    device = FakeDevice(failing_opens=2)
    device.failures["open"] = ConnectError("locked")
    connection = make(device, open_tries=3)
    connection.start()
    assert names(device).count("open") == 3
    assert connection.ready


def test_the_last_open_error_is_raised() -> None:
    device = FakeDevice()
    device.failures["open"] = ConnectError("locked")
    connection = make(device, open_tries=3)
    with pytest.raises(ConnectError, match="locked"):
        connection.start()
    assert names(device) == ["open"] * 3
    assert not connection.ready


def test_only_a_connect_error_is_worth_another_try(device: FakeDevice) -> None:
    device.failures["open"] = DeviceTimeout("no answer")
    with pytest.raises(DeviceTimeout):
        make(device).start()
    assert names(device) == ["open"]


def test_abort_start_ends_the_wait_between_two_tries() -> None:
    device = FakeDevice()
    device.failures["open"] = ConnectError("locked")
    connection = make(device, open_tries=2, open_retry_s=3600.0)
    tried = threading.Event()
    device.record = _signalling(device.record, tried)  # type: ignore[method-assign]
    starting = threading.Thread(target=connection.start)
    starting.start()
    assert tried.wait(5.0)
    connection.abort_start()
    starting.join(5.0)
    assert not starting.is_alive()
    assert names(device) == ["open"]


def _signalling(record: Callable[..., None], event: threading.Event) -> Callable[..., None]:
    def recorded(*call: object) -> None:
        event.set()
        record(*call)

    return recorded


def test_opening_an_open_device_has_no_effect(device: FakeDevice) -> None:
    connection = make(device)
    connection.open("/dev/one", "me")
    connection.open()
    assert device.calls == [("open", "/dev/one", "me")]


def test_opening_another_device_asks_to_close_first(device: FakeDevice) -> None:
    connection = make(device)
    connection.open()
    with pytest.raises(NotReady, match="close it before opening '/dev/two'"):
        connection.open("/dev/two")


def test_communication_needs_an_open_device(device: FakeDevice) -> None:
    connection = make(device)
    with pytest.raises(NotReady, match="not open"):
        connection.start_communication()
    with pytest.raises(NotReady, match="not open"):
        connection.scan_network()


def test_parameters_are_applied_once_per_opening(device: FakeDevice, parameters: Path) -> None:
    connection = make(device, parameters)
    connection.start()
    connection.stop_communication()
    connection.start_communication()
    assert device.calls.count(("load_parameters", parameters)) == 1
    connection.close()
    connection.start()
    assert device.calls.count(("load_parameters", parameters)) == 2


class EarlyParameters(FakeDevice):
    parameters_before_communication = True


def test_parameters_come_before_communication_where_the_device_allows_it(parameters: Path) -> None:
    device = EarlyParameters()
    connection = make(device, parameters)
    connection.start()
    assert names(device) == ["open", "scan_network", "load_parameters", "start_communication"]
    connection.stop_communication()
    connection.start_communication()
    assert names(device).count("load_parameters") == 1


def test_without_its_parameters_such_a_device_never_communicates(parameters: Path) -> None:
    device = EarlyParameters()
    device.failures["load_parameters"] = DescriptorError("axis 3 is missing")
    with pytest.raises(DescriptorError, match="axis 3"):
        make(device, parameters).start()
    assert "start_communication" not in names(device)


def test_a_missing_parameter_file_stops_before_communication(
    device: FakeDevice, tmp_path: Path
) -> None:
    connection = make(device, tmp_path / "gone.xml")
    with pytest.raises(DescriptorError, match=r"gone\.xml: parameter file does not exist"):
        connection.start()
    assert "start_communication" not in names(device)


def test_rejected_parameters_stop_communication_again(device: FakeDevice, parameters: Path) -> None:
    device.failures["load_parameters"] = OperationError("bad gear ratio")
    connection = make(device, parameters)
    with pytest.raises(OperationError, match="bad gear ratio"):
        connection.start()
    assert names(device)[-1] == "stop_communication"
    assert not connection.ready


def test_a_backend_without_parameter_files_ignores_the_robots_and_refuses_more(
    device: FakeDevice, parameters: Path
) -> None:
    connection = Connection(device, EngineSettings(), parameters, "fake", has_parameters=False)
    connection.start()
    assert "load_parameters" not in names(device)
    rejected = "parameter files: not supported by the fake backend"
    with pytest.raises(Unsupported, match=rejected):
        connection.load_parameters(parameters)
    with pytest.raises(Unsupported, match=rejected):
        connection.dump_parameters(0)


def test_loading_needs_a_file_and_a_ready_engine(device: FakeDevice, parameters: Path) -> None:
    connection = make(device)
    with pytest.raises(OperationError, match="does not exist"):
        connection.load_parameters(parameters.with_name("gone.xml"))
    with pytest.raises(NotReady, match="Idle"):
        connection.load_parameters(parameters)
    connection.start()
    connection.load_parameters(parameters)
    assert device.calls[-1] == ("load_parameters", parameters)
    assert connection.dump_parameters(4) == "parameters of axis 4"


def test_listeners_hear_the_present_state_and_every_change_once(device: FakeDevice) -> None:
    connection = make(device)
    heard: list[bool] = []
    connection.on_ready(heard.append)
    connection.start()
    connection.update_ready()
    connection.stop_communication()
    assert heard == [False, True, False]


def test_stale_values_are_not_ready_and_unknown_until_they_are_fresh(device: FakeDevice) -> None:
    connection = make(device)
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
    connection = make(device)
    connection.before_stop = lambda: device.calls.append(("at rest",))
    connection.stop_communication()
    assert device.calls == []
    connection.start()
    connection.stop_communication()
    assert device.calls[-2][0] == "at rest"
    assert device.calls[-1][0] == "stop_communication"


def test_shutdown_is_for_good(device: FakeDevice) -> None:
    connection = make(device)
    connection.start()
    connection.shutdown()
    assert names(device)[-2:] == ["stop_communication", "close"]
    assert connection.state is ConnectionState.SHUTDOWN
    assert not connection.ready
    for command in (connection.open, connection.start_communication):
        with pytest.raises(NotReady, match="shut down"):
            command()
    connection.shutdown()


def test_a_failing_stop_does_not_keep_the_device_open(device: FakeDevice) -> None:
    connection = make(device)
    connection.start()
    device.failures["stop_communication"] = DeviceTimeout("still cyclic")
    with pytest.raises(DeviceTimeout):
        connection.shutdown()
    assert names(device)[-1] == "close"
    assert connection.state is ConnectionState.SHUTDOWN


def test_whoever_commands_a_device_that_does_not_communicate_is_told_why(
    device: FakeDevice,
) -> None:
    connection = make(device)
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
    connection = make(device, parameters)
    with pytest.raises(DeviceTimeout, match="the link is not up"):
        connection.start()
    assert names(device)[-1] == "stop_communication"
    device.current = ConnectionState.COMMUNICATING  # the link came up after all
    connection.update_ready()
    assert not connection.ready
    with pytest.raises(NotReady, match="although its start failed: the link is not up"):
        connection.require_ready()
    connection.start_communication()
    assert names(device)[-1] == "load_parameters"
    assert connection.ready


def test_communication_that_somebody_else_started_is_not_ready(device: FakeDevice) -> None:
    connection = make(device)
    connection.open()
    device.current = ConnectionState.COMMUNICATING
    connection.update_ready()
    assert not connection.ready
    assert "communication was not started by robotd" in connection.rejection


def test_a_failed_restart_leaves_what_still_communicates_alone(device: FakeDevice) -> None:
    connection = make(device)
    connection.start()
    device.current = ConnectionState.UNKNOWN  # some nodes are lost, the others go on
    device.failures["start_communication"] = ConnectError("node 3 does not answer")
    with pytest.raises(ConnectError):
        connection.start_communication()
    assert "stop_communication" not in names(device)
    device.current = ConnectionState.COMMUNICATING
    connection.update_ready()
    assert not connection.ready


def test_a_request_to_end_during_the_start_of_communication_undoes_it(
    device: FakeDevice, parameters: Path
) -> None:
    connection = make(device, parameters)
    start = device.start_communication

    def interrupted(timeout_s: float) -> None:
        start(timeout_s)
        connection.abort_start()

    device.start_communication = interrupted  # type: ignore[method-assign]
    with pytest.raises(NotReady, match="shut down"):
        connection.start()
    assert names(device)[-2:] == ["start_communication", "stop_communication"]
    assert not connection.ready


def test_a_note_about_the_parameters_is_returned_and_logged(
    device: FakeDevice, parameters: Path
) -> None:
    engine = make(device)
    engine.start()
    device.note = "missing elements, which get their defaults: axis 0: QuickStopDec"
    with capture_logs() as lines:
        assert engine.load_parameters(parameters) == device.note
    assert [(line["log_level"], line["note"]) for line in lines] == [("warning", device.note)]


def test_parameters_wait_for_a_servo_that_is_being_switched_on(
    device: FakeDevice, parameters: Path
) -> None:
    engine = make(device)
    engine.start()
    loading = threading.Thread(target=engine.load_parameters, args=(parameters,))
    with engine.parameters.scaling_lock:
        loading.start()
        loading.join(0.1)
        assert loading.is_alive()
    loading.join(5.0)
    assert names(device)[-1] == "load_parameters"


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
    engine = make(device)
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
    engine = make(device)
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
    engine, reasons = make(device), iter(["values are old", ""])
    monkeypatch.setattr(Connection, "reason", property(lambda _: next(reasons)))
    assert engine.rejection.endswith("): values are old")
