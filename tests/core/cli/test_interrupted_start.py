"""Ctrl-C before a robot is served ends the process, whatever code of others makes of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

from tests.installed_plugin import Install

from robotd.stop_signals import ended_by_interrupt

SWALLOWS = """
    import os, signal, time

    from robotd.api import hookimpl

    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(10.0)
    except BaseException:
        pass

    @hookimpl
    def robotd_register_nodes(registry):
        pass
"""


def test_a_robot_does_not_start_after_it(install: Install) -> None:
    site = install("swallows", SWALLOWS, group="robotd.plugins")
    command = [sys.executable, "-m", "robotd", "--robot", "cr3a", "--backend", "sim"]
    path = os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH", "")]))
    done = subprocess.run(
        command,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert done.returncode == -signal.SIGINT, done.stdout + done.stderr
    assert not done.stdout


def test_other_handlers_stay() -> None:
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with ended_by_interrupt():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with ended_by_interrupt():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with ended_by_interrupt():
            pass
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
