"""Parameters that are loaded at the start, and on request."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
from structlog.testing import capture_logs
from tests.core.device.harness import call_names, make_connection
from tests.fakes import FakeDevice

from robotd.descriptor import EngineSettings
from robotd.device.connection import Connection
from robotd.errors import (
    DescriptorError,
    NotReady,
    OperationError,
    Unsupported,
)


def test_parameters_are_applied_once_per_opening(device: FakeDevice, parameters: Path) -> None:
    connection = make_connection(device, parameters)
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
    connection = make_connection(device, parameters)
    connection.start()
    assert call_names(device) == ["open", "scan_network", "load_parameters", "start_communication"]
    connection.stop_communication()
    connection.start_communication()
    assert call_names(device).count("load_parameters") == 1


def test_without_its_parameters_such_a_device_never_communicates(parameters: Path) -> None:
    device = EarlyParameters()
    device.failures["load_parameters"] = DescriptorError("axis 3 is missing")
    with pytest.raises(DescriptorError, match="axis 3"):
        make_connection(device, parameters).start()
    assert "start_communication" not in call_names(device)


def test_a_missing_parameter_file_stops_before_communication(
    device: FakeDevice, tmp_path: Path
) -> None:
    connection = make_connection(device, tmp_path / "gone.xml")
    with pytest.raises(DescriptorError, match=r"gone\.xml: parameter file does not exist"):
        connection.start()
    assert "start_communication" not in call_names(device)


def test_rejected_parameters_stop_communication_again(device: FakeDevice, parameters: Path) -> None:
    device.failures["load_parameters"] = OperationError("bad gear ratio")
    connection = make_connection(device, parameters)
    with pytest.raises(OperationError, match="bad gear ratio"):
        connection.start()
    assert call_names(device)[-1] == "stop_communication"
    assert not connection.ready


def test_a_backend_without_parameter_files_ignores_the_robots_and_refuses_more(
    device: FakeDevice, parameters: Path
) -> None:
    connection = Connection(device, EngineSettings(), parameters, "fake", has_parameters=False)
    connection.start()
    assert "load_parameters" not in call_names(device)
    rejected = "parameter files: not supported by the fake backend"
    with pytest.raises(Unsupported, match=rejected):
        connection.load_parameters(parameters)
    with pytest.raises(Unsupported, match=rejected):
        connection.dump_parameters(0)


def test_loading_needs_a_file_and_a_ready_engine(device: FakeDevice, parameters: Path) -> None:
    connection = make_connection(device)
    with pytest.raises(OperationError, match="does not exist"):
        connection.load_parameters(parameters.with_name("gone.xml"))
    with pytest.raises(NotReady, match="Idle"):
        connection.load_parameters(parameters)
    connection.start()
    connection.load_parameters(parameters)
    assert device.calls[-1] == ("load_parameters", parameters)
    assert connection.dump_parameters(4) == "parameters of axis 4"


def test_a_note_about_the_parameters_is_returned_and_logged(
    device: FakeDevice, parameters: Path
) -> None:
    engine = make_connection(device)
    engine.start()
    device.note = "missing elements, which get their defaults: axis 0: QuickStopDec"
    with capture_logs() as lines:
        assert engine.load_parameters(parameters) == device.note
    assert [(line["log_level"], line["note"]) for line in lines] == [("warning", device.note)]


def test_parameters_wait_for_a_servo_that_is_being_switched_on(
    device: FakeDevice, parameters: Path
) -> None:
    engine = make_connection(device)
    engine.start()
    loading = threading.Thread(target=engine.load_parameters, args=(parameters,))
    with engine.scaling_lock:
        loading.start()
        loading.join(0.1)
        assert loading.is_alive()
    loading.join(5.0)
    assert call_names(device)[-1] == "load_parameters"
