"""A link that loses frames: a stop is confirmed, and no datagram is longer than a frame."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from tests.ros.lossy_network import ENVIRONMENT, lossy_network, obstacle
from tests.ros.robot_process import RobotProcess

from robotd_testing.domain import own_domain

REASON = obstacle()
pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(bool(REASON), reason=f"no network namespaces: {REASON}"),
]


def test_a_stop_is_confirmed_where_each_twentieth_frame_is_lost() -> None:
    with (
        lossy_network(0.05) as link,
        own_domain() as domain,
        RobotProcess(domain=domain, prefix=link.robot, environment=ENVIRONMENT) as robot,
    ):
        robot.wait_ready()
        for _ in range(3):
            stopped = subprocess.run(
                [*link.client, sys.executable, "-m", "robotd", "stop", "--timeout", "120"],
                env=os.environ | ENVIRONMENT | {"ROS_DOMAIN_ID": str(domain)},
                capture_output=True,
                text=True,
                timeout=180,
                check=False,
            )
            assert (stopped.returncode, stopped.stdout) == (0, "stopped, at rest\n"), stopped.stderr
        # All parts of a long datagram have to arrive: with them, discovery takes half a minute.
        assert link.frames > 100
        assert link.fragments == 0
