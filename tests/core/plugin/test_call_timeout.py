"""Hooks and imports that do not end, or end the process, are the plugin's fault, not ours."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from robotd.errors import PluginError
from robotd.plugin import call_timeout, manager
from robotd.plugin.call_timeout import CallTimeout, call_with_timeout, end_idle_threads
from robotd.plugin.manager import load_backend

Install = Callable[..., Path]

HEADER = "from robotd.api import BackendInfo, hookimpl\nimport threading, sys\n"
DESCRIBE = """
@hookimpl
def robotd_backend():
    {body}
    return BackendInfo(summary="", api_version=1)
"""


def rejection() -> str:
    with pytest.raises(PluginError) as caught:
        load_backend("odd")
    return str(caught.value)


def test_results_and_errors_come_back() -> None:
    assert call_with_timeout(5.0, lambda: 7, "work") == 7
    with pytest.raises(KeyError, match="x"):
        call_with_timeout(5.0, lambda: {}["x"], "work")


def test_what_takes_too_long_is_given_up() -> None:
    released = threading.Event()
    with pytest.raises(CallTimeout):
        call_with_timeout(0.02, lambda: released.wait(20.0), "work")
    released.set()


def test_an_endless_hook_is_given_up(install: Install, monkeypatch: pytest.MonkeyPatch) -> None:
    install("odd", HEADER + DESCRIBE.format(body="threading.Event().wait(3.0)"))
    monkeypatch.setattr(manager, "HOOK_BUDGET_S", 0.05)
    text = rejection()
    assert "'odd' (plugin_acme of acme 1.2)" in text
    assert "robotd_backend did not return within 0.05 s" in text


def test_an_endless_import_is_given_up(install: Install, monkeypatch: pytest.MonkeyPatch) -> None:
    install("odd", HEADER + "threading.Event().wait(3.0)")
    monkeypatch.setattr(manager, "IMPORT_BUDGET_S", 0.05)
    assert "cannot be imported: not done within 0.05 s" in rejection()


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        (HEADER + "sys.exit(3)", "cannot be imported: SystemExit: 3"),
        (HEADER + DESCRIBE.format(body="sys.exit(3)"), "robotd_backend failed: SystemExit: 3"),
        (
            HEADER + "@hookimpl\ndef robotd_open_device(context=None): ...",
            "robotd_open_device must take 'context' as a plain argument",
        ),
        (
            HEADER + "@hookimpl\ndef robotd_open_device(*, context): ...",
            "robotd_open_device must take 'context' as a plain argument",
        ),
    ],
)
def test_what_would_end_the_process_or_get_lost_is_rejected(
    install: Install, source: str, reason: str
) -> None:
    install("odd", source)
    assert reason in rejection()


def test_a_program_that_leaves_a_stream_open_ends() -> None:
    """Its claims are given back while the interpreter ends, when no thread starts any more."""
    program = (
        "from robotd import build_robot; from robotd.clock.simulated import SteppedClock;"
        "robot = build_robot('cr3a', 'sim', clock=SteppedClock()); robot.start();"
        "stream = robot.stream(); print('open')"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "open" in done.stdout
    assert "Traceback" not in done.stderr


def test_calls_share_a_thread_until_one_does_not_return() -> None:
    end_idle_threads()
    first = call_with_timeout(5.0, threading.current_thread, "work")
    assert call_with_timeout(5.0, threading.current_thread, "work") is first
    released = threading.Event()
    with pytest.raises(CallTimeout):
        call_with_timeout(0.02, lambda: released.wait(20.0), "work")
    assert call_with_timeout(5.0, threading.current_thread, "work") is not first
    released.set()


def test_idle_threads_end() -> None:
    thread = call_with_timeout(5.0, threading.current_thread, "work")
    end_idle_threads()
    assert not thread.is_alive()


def test_an_idle_thread_may_be_taken_while_they_end(monkeypatch: pytest.MonkeyPatch) -> None:
    class Taken(list[object]):
        """The last thread, which another one takes after a look at their number."""

        def __len__(self) -> int:
            return 1

    monkeypatch.setattr(call_timeout._CallThread, "idle", Taken())
    end_idle_threads()


def test_a_forked_process_waits_for_no_thread_of_its_parent() -> None:
    program = (
        "import os\n"
        "from robotd.plugin.call_timeout import call_with_timeout\n"
        "call_with_timeout(5.0, int, 'work')\n"
        "child = os.fork()\n"
        "if not child: os._exit(call_with_timeout(5.0, lambda: 7, 'work'))\n"
        "print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "7\n", done.stderr
