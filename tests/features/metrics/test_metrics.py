from __future__ import annotations

import errno
import itertools
import logging
import re
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily
from prometheus_client.parser import text_string_to_metric_families
from tests.features.harness import Observed

from robotd.clock import MonotonicClock, wait_until
from robotd.errors import OperationError
from robotd.events import EventKind, sent_by
from robotd.motion import TrajectoryRejected
from robotd_metrics import metrics
from robotd_metrics.metrics import registry, serve_metrics
from robotd_shared.local_http import MAX_CONNECTIONS

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "metrics.md"


@pytest.fixture
def arm(tmp_path: Path) -> Iterator[Observed]:
    observed = Observed(tmp_path)
    yield observed
    observed.close()


def values(made: CollectorRegistry) -> dict[str, float]:
    """Sample and its labels, as the text has them, with its value."""
    text = generate_latest(made).decode()
    return {
        f"{sample.name}{sample.labels or ''}": sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_goals_faults_and_periods_are_counted(arm: Observed) -> None:
    made = registry(arm.tap, arm.flight)
    with sent_by("/planner"):
        with arm.goal([0.1] * 6, 0.5):
            arm.step(0.8)
        with pytest.raises(TrajectoryRejected), arm.goal([99.0] * 6):
            pass
        arm.robot.fault_injector.trip(2, 0x8611)
        arm.step(0.2)
    found = values(made)
    assert found["robotd_goals_total{'outcome': 'succeeded'}"] == 1
    assert found["robotd_goals_total{'outcome': 'rejected'}"] == 1
    assert found["robotd_faults_total{'axis': 'joint3'}"] == 1
    assert found["robotd_clients"] == 1
    assert found["robotd_ready"] == 1
    cycles = arm.robot.control_loop.stats.cycles
    assert found["robotd_loop_periods_total"] == cycles
    assert found["robotd_loop_lateness_seconds_count"] == cycles
    assert found["robotd_loop_lateness_seconds_bucket{'le': '1e-05'}"] == cycles  # stepped time
    assert found["robotd_values_age_seconds"] < 0.01
    assert found["robotd_bus_lost_frames_total{'bus': 'bus0'}"] == 0
    assert found["robotd_bus_node_offline{'node': 'bus0/node0'}"] == 0
    assert found["process_resident_memory_bytes"] > 1e7


def test_a_stop_is_counted_by_its_cause(arm: Observed) -> None:
    made = registry(arm.tap, arm.flight)
    with arm.tap:
        arm.robot.axes.stop_latch.engage("a guard is open")
    found = values(made)
    assert found["robotd_stops_total{'cause': 'a guard is open'}"] == 1
    assert found["robotd_stopped"] == 1


def test_every_metric_is_on_its_page(arm: Observed) -> None:
    documented = set(re.findall(r"`(robotd_\w+)", PAGE.read_text(encoding="utf-8")))
    families = text_string_to_metric_families(
        generate_latest(registry(arm.tap, arm.flight)).decode()
    )
    served = {
        f"{family.name}_total" if family.type == "counter" else family.name
        for family in families
        if family.name.startswith("robotd_")
    }
    assert served == documented


@pytest.mark.parametrize(
    "headers", [{"Host": "evil.example"}, {"Origin": "http://evil.example"}], ids=str
)
def test_foreign_requests_are_rejected(arm: Observed, headers: dict[str, str]) -> None:
    with serve_metrics(registry(arm.tap, arm.flight), 0) as port:
        request = Request(f"http://127.0.0.1:{port}/metrics", headers=headers)
        with pytest.raises(HTTPError, match="403") as raised:
            urlopen(request, timeout=10)
    assert b"evil.example' is rejected" in raised.value.read()


def test_metrics_are_served_on_the_loopback_interface_only(arm: Observed) -> None:
    made = registry(arm.tap, arm.flight)
    with serve_metrics(made, 0) as port:
        with urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
            assert b"robotd_ready 1.0" in answer.read()
        used = pytest.raises(OperationError, match=f"--metrics {port}: Address already in use")
        with used, serve_metrics(made, port):
            pass
        own = socket.gethostbyname(socket.gethostname())
        if not own.startswith("127."):
            with pytest.raises(OSError, match=f"Errno {errno.ECONNREFUSED}"):
                socket.create_connection((own, port), timeout=5).close()
    assert not [thread for thread in threading.enumerate() if thread.name == "robotd-metrics"]


def test_connections_are_limited(arm: Observed) -> None:
    with serve_metrics(registry(arm.tap, arm.flight), 0) as port, ExitStack() as stack:
        address = ("127.0.0.1", port)
        silent = [
            stack.enter_context(socket.create_connection(address, timeout=10))
            for _ in range(MAX_CONNECTIONS)
        ]
        with socket.create_connection(address, timeout=10) as another:
            assert another.recv(1) == b""  # closed at once
        silent[0].close()

        def answers() -> bool:
            try:
                with urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
                    return bool(answer.status == 200)
            except OSError:
                return False

        assert wait_until(answers, 10.0, MonotonicClock(), 0.02)


@pytest.fixture
def logged() -> Iterator[list[logging.LogRecord]]:
    """Collect what robotd logs during the test."""
    records: list[logging.LogRecord] = []
    handler = logging.Handler()
    handler.emit = records.append  # type: ignore[method-assign]
    logging.getLogger().addHandler(handler)
    yield records
    logging.getLogger().removeHandler(handler)


def test_a_request_that_breaks_off_is_one_warning(
    arm: Observed, logged: list[logging.LogRecord], capsys: pytest.CaptureFixture[str]
) -> None:
    with serve_metrics(registry(arm.tap, arm.flight), 0) as port:
        with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            client.sendall(b"GET /metrics HTTP/1.1\r\nHost: localhost")
        assert wait_until(lambda: bool(logged), 10.0, MonotonicClock(), 0.02)
    assert [record.getMessage()[:15] for record in logged] == ["request failed:"]
    assert "Traceback" not in capsys.readouterr().err


def test_what_happens_during_a_scrape_does_not_break_it(
    arm: Observed, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each value that is written lets a fault, a stop and a rejected command come in between."""
    made, axes = registry(arm.tap, arm.flight), itertools.cycle(range(6))

    class Family(CounterMetricFamily):
        def add_metric(self, *args: Any, **options: Any) -> None:
            number = next(axes)
            for text in (f"all motion stopped: by {number}", "motion is allowed again"):
                outcome = "stopped" if ":" in text else "reset"
                arm.tap.events.add(EventKind.STOP, "stop", text, data={"outcome": outcome})
            arm.tap.events.add(EventKind.FAULT, f"joint{number}", "a fault")
            arm.tap.events.count(EventKind.COMMAND, f"outcome {number}")
            arm.tap.observe()
            super().add_metric(*args, **options)

    arm.robot.fault_injector.trip(2, 0x8611)
    arm.step(0.2)
    monkeypatch.setattr(metrics, "CounterMetricFamily", Family)
    assert values(made)["robotd_faults_total{'axis': 'joint3'}"] >= 1
