"""Hooks and imports that do not end, or end the process, are the plugin's fault, not ours."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from robotd import call_timeout, entry_points
from robotd.call_timeout import (
    CallTimeout,
    Overdue,
    call_with_timeout,
    end_idle_threads,
    interrupted_after,
)
from robotd.errors import PluginError
from robotd.plugin import manager
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


def test_a_call_that_waits_for_a_processor_has_more_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its thread is in the queue nearly all the time."""
    began_s = time.monotonic()
    monkeypatch.setattr(
        call_timeout, "queue_time_s", lambda thread: 0.99 * (time.monotonic() - began_s)
    )
    assert call_with_timeout(0.2, lambda: time.sleep(0.5) or 7, "work") == 7


def test_the_main_thread_is_interrupted_and_its_signals_are_as_before() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with pytest.raises(Overdue, match=r"not done within 0\.05 s"), interrupted_after(0.05):
        threading.Event().wait(20.0)
    assert signal.getsignal(signal.SIGALRM) is before

    def own(*_: object) -> None: ...

    with interrupted_after(20.0):
        signal.signal(signal.SIGALRM, own)
    assert signal.signal(signal.SIGALRM, before) is own


def test_the_main_thread_has_more_time_while_it_waits_for_a_processor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    began_s = time.monotonic()
    monkeypatch.setattr(
        call_timeout, "queue_time_s", lambda thread: 0.99 * (time.monotonic() - began_s)
    )
    with interrupted_after(0.1):
        time.sleep(0.2)
    monkeypatch.setattr(call_timeout, "queue_time_s", lambda thread: time.monotonic() - began_s)
    with pytest.raises(Overdue), interrupted_after(0.05):
        time.sleep(5.0)


def test_what_is_given_up_on_a_busy_computer_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    released, began_s = threading.Event(), time.monotonic()
    monkeypatch.setattr(call_timeout, "queue_time_s", lambda thread: time.monotonic() - began_s)
    with pytest.raises(CallTimeout, match="of the computer, which is too busy"):
        call_with_timeout(0.02, lambda: released.wait(20.0), "work")
    released.set()


SUSPENDED = """
import os, signal, subprocess, time
from robotd.call_timeout import call_with_timeout

def work():
    subprocess.Popen(["sh", "-c", f"sleep 3; kill -CONT {os.getpid()}"])
    os.kill(os.getpid(), signal.SIGSTOP)
    time.sleep(0.3)
    return "done"

print(call_with_timeout(2.0, work, "work"))
"""


def test_a_process_that_is_suspended_blames_no_call() -> None:
    run = subprocess.run(
        [sys.executable, "-c", SUSPENDED], capture_output=True, text=True, timeout=60, check=False
    )
    assert run.stdout.strip() == "done", run.stderr


def test_the_time_in_the_queue_of_a_processor_is_counted() -> None:
    before_s = call_timeout.queue_time_s(threading.get_native_id())
    assert before_s >= 0.0
    assert call_timeout.queue_time_s(0) == 0.0


def test_an_endless_hook_is_given_up(install: Install, monkeypatch: pytest.MonkeyPatch) -> None:
    install("odd", HEADER + DESCRIBE.format(body="threading.Event().wait(3.0)"))
    monkeypatch.setattr(manager, "HOOK_BUDGET_S", 0.05)
    text = rejection()
    assert "'odd' (plugin_acme of acme 1.2)" in text
    assert "robotd_backend did not return within 0.05 s" in text


def test_an_endless_import_is_given_up(install: Install, monkeypatch: pytest.MonkeyPatch) -> None:
    install("odd", HEADER + "threading.Event().wait(3.0)")
    monkeypatch.setattr(entry_points, "IMPORT_LIMIT_S", 0.05)
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
        "from robotd.call_timeout import call_with_timeout\n"
        "call_with_timeout(5.0, int, 'work')\n"
        "child = os.fork()\n"
        "if not child: os._exit(call_with_timeout(5.0, lambda: 7, 'work'))\n"
        "print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "7\n", done.stderr
