"""Modules that a served robot, or a command, has no use for: they cost start-up and memory."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

from robotd_testing.domain import own_domain

NOT_NEEDED = (
    *("aiohttp", "attr", "can", "canopen", "foxglove", "http.client", "jinja2", "lark", "mcap"),
    *(
        "matplotlib",
        "numpy.ma",
        "numpy.random",
        "numpy.testing",
        "pytest",
        "rich.console",
        "ruamel",
    ),
    *("scipy", "robotd_commissioning", "robotd_export.moveit", "robotd_testing", "robotd_canopen"),
    *("robotd_inventory", "robotd_ros.commands.robot_client"),
    "robotd_ros.commands.status_watch_view",
    *("robotd_page.page_server", "robotd_foxglove.foxglove_server"),
)
READY = "ready after"
TIMEOUT_S = 60.0


def test_a_served_robot_imports_nothing_that_it_does_not_need(tmp_path: Path) -> None:
    imported = _imported_until_ready(tmp_path)
    assert {"numpy", "rclpy", "robotd_ros.run_nodes", "robotd_sim.simulation"} <= imported
    found = [
        name
        for name in sorted(imported)
        if any(name == package or name.startswith(f"{package}.") for package in NOT_NEEDED)
    ]
    assert not found


def test_the_commands_of_an_operator_import_no_descriptor() -> None:
    """Models of pydantic take longer to import than the rest of ``robotd status``."""
    client = "robotd_ros.client.status_client"
    command = "robotd_ros.commands.status_command, robotd_ros.commands.operator_commands"
    code = f"import sys, {command}, {client}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {"pydantic", "robotd.descriptor.model", "robotd.device"}.isdisjoint(done.stdout.split())


def _imported_until_ready(folder: Path) -> set[str]:
    """Return the modules that ``robotd run`` has imported when it is ready."""
    command = [sys.executable, "-X", "importtime", "-m", "robotd", "--robot", "cr3a"]
    errors = folder / "errors"
    with own_domain() as domain, errors.open("w") as stream:
        process = subprocess.Popen(
            [*command, "--backend", "sim"],
            env=os.environ
            | {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
            stdout=subprocess.PIPE,
            stderr=stream,
            text=True,
        )
        try:
            assert process.stdout is not None
            assert any(READY in line for line in process.stdout), errors.read_text()[-2000:]
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=TIMEOUT_S)
        finally:
            process.kill()
            process.wait()
    return set(re.findall(r"^import time:.*\| +(\S+)$", errors.read_text(), re.MULTILINE))
