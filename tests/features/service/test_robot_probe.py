from __future__ import annotations

import json
import socket
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from robotd.cli import main
from robotd.cli.exit_codes import ExitCode
from robotd.clock import MonotonicClock, wait_until
from robotd.descriptor import load_robot_descriptor, parse_override
from robotd.feature_host import open_features
from robotd.plugin.manager import load_backend
from robotd.robot import Robot
from robotd_service.service_notifier import NotifySocket, RobotProbe

PATIENCE_S = 30.0


@contextmanager
def arm(*overrides: str) -> Iterator[Robot]:
    descriptor = load_robot_descriptor("cr3a", overrides=list(map(parse_override, overrides)))
    robot = Robot(descriptor, load_backend("sim"), MonotonicClock())
    try:
        yield robot
    finally:
        robot.shutdown()


def becomes(condition: Any) -> bool:
    return wait_until(condition, PATIENCE_S, MonotonicClock(), 0.02)


def test_the_state_is_the_first_problem_until_the_robot_is_ready() -> None:
    with arm() as robot:
        probe = RobotProbe(robot, "/left")
        before = probe.look()
        assert (before.alive, before.ready) == (True, False)
        robot.start(enable=False)
        assert becomes(lambda: probe.look().state.endswith(": servo off"))
        robot.servos.enable()
        assert becomes(lambda: probe.look().ready)
        found = probe.document()
        assert (found["state"], found["namespace"], found["simulated"]) == ("ready", "/left", True)
        robot.stop("by a test")
        assert not probe.look().ready
        assert probe.look().alive
    assert probe.look().alive  # shut down in order: nothing hangs


def test_a_control_loop_that_hangs_is_not_alive() -> None:
    released = threading.Event()
    with arm() as robot:
        robot.start(enable=False)
        probe = RobotProbe(robot, "/")
        assert probe.look().alive
        robot.control_loop.every(500, "hang", lambda _: released.wait(PATIENCE_S))
        try:
            assert becomes(lambda: not probe.look().alive)
            assert "the control loop hangs" in probe.look().state
        finally:
            released.set()
        assert becomes(lambda: probe.look().alive)


def test_a_control_loop_that_has_ended_is_not_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    with arm() as robot:
        robot.start(enable=False)
        probe = RobotProbe(robot, "/")
        assert probe.look().alive
        monkeypatch.setattr(robot.control_loop._stopping, "is_set", lambda: True)  # ends the thread
        assert becomes(lambda: not robot.control_loop._thread.is_alive())  # type: ignore[union-attr]
        monkeypatch.undo()
        assert becomes(lambda: not probe.look().alive)
        assert "has begun no period" in probe.look().state


@pytest.fixture
def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """Stand-in for the notify socket of a service manager."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
        end.bind(str(tmp_path / "notify"))
        end.settimeout(PATIENCE_S)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "300000")
        yield end


def test_the_manager_gets_no_watchdog_notification_while_the_loop_hangs(
    manager: socket.socket,
) -> None:
    released = threading.Event()

    def texts(until: str) -> list[str]:
        found: list[str] = []
        while not any(until in text for text in found):
            found.append(manager.recv(4096).decode())
        return found

    with arm() as robot, open_features(robot) as host:
        assert "service" in host.parts
        for task in host.on_served:
            task()
        texts("READY=1")
        robot.start(enable=False)
        texts("servo off")
        texts("WATCHDOG=1")
        robot.control_loop.every(500, "hang", lambda _: released.wait(PATIENCE_S))
        texts("STATUS=the control loop hangs")
        status = manager.recv(4096).decode()  # the next one comes when it runs again
        released.set()
        while status.startswith("STATUS=the control loop"):
            status = manager.recv(4096).decode()
        assert status == "WATCHDOG=1"
        robot.shutdown()
    assert texts("STOPPING=1")


def test_the_manager_may_use_the_abstract_name_space() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
        end.bind("\0robotd-test-notify")
        end.settimeout(PATIENCE_S)
        found = NotifySocket.of_environment({"NOTIFY_SOCKET": "@robotd-test-notify"})
        assert found is not None
        assert found.watchdog_s is None
        found.send("READY=1", "STATUS=ready")
        assert end.recv(100) == b"READY=1\nSTATUS=ready"
        found.close()


@pytest.mark.parametrize(
    ("variables", "watchdog_s"),
    [
        ({}, None),
        ({"WATCHDOG_USEC": "2000000"}, 2.0),
        ({"WATCHDOG_USEC": "2000000", "WATCHDOG_PID": "1"}, None),  # of another process
        ({"WATCHDOG_USEC": "soon"}, None),
    ],
)
def test_the_watchdog_is_the_one_of_this_process(
    variables: dict[str, str], watchdog_s: float | None
) -> None:
    found = NotifySocket.of_environment({"NOTIFY_SOCKET": "/nowhere", **variables})
    assert found is not None
    assert found.watchdog_s == watchdog_s
    found.send("READY=1")  # no one listens: logged, not raised
    found.close()


def test_without_a_manager_nothing_is_notified() -> None:
    assert NotifySocket.of_environment({}) is None
    assert NotifySocket.of_environment({"NOTIFY_SOCKET": "relative"}) is None


def free_port() -> int:
    with socket.socket() as end:
        end.bind(("127.0.0.1", 0))
        return int(end.getsockname()[1])


def status_of(url: str) -> tuple[int, str]:
    try:
        with urllib.request.urlopen(url, timeout=PATIENCE_S) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


def test_probes_read_life_and_readiness() -> None:
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    with arm(f"health={port}") as robot, open_features(robot):
        robot.start(enable=False)
        assert status_of(f"{url}/healthz")[0] == 200
        assert status_of(f"{url}/readyz")[0] == 503
        assert status_of(f"{url}/other")[0] == 404
        asked = CliRunner().invoke(main, ["health", "--port", str(port)])
        assert asked.exit_code == ExitCode.OK
        assert "cr3a on sim, SIMULATED: joint1, joint2" in asked.output
        assert CliRunner().invoke(main, ["health", "--port", str(port), "--ready"]).exit_code == 1
        robot.servos.enable()
        assert becomes(lambda: status_of(f"{url}/readyz")[0] == 200)
        asked = CliRunner().invoke(main, ["health", "--port", str(port), "--ready", "--json"])
        assert asked.exit_code == ExitCode.OK
        assert json.loads(asked.output)["state"] == "ready"
        robot.shutdown()


def test_a_probe_of_nothing_says_so() -> None:
    asked = CliRunner().invoke(main, ["health", "--port", str(free_port())])
    assert asked.exit_code == ExitCode.DEVICE
    assert "is a robot running here with --health" in asked.output
