"""Commands that reach the robot late: none undoes what the page did not show when it was given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.features.harness import Observed
from tests.features.page.server.test_control_server import (
    Controller,
    controller,
    position_is_unchanged,
    run,
)
from tests.features.page.server.viewer import connected

from robotd.events import sent_by
from robotd.robot import Robot
from robotd_page.control_jog import JogBeat
from robotd_page.page_server import PageServer
from robotd_page.seen_state import MAX_AGE_S

JOG = {"type": "jog", "hold": 1, "joint": "joint1", "velocity": 0.1}
BOUND: list[tuple[str, dict[str, Any]]] = [
    ("reset", {}),
    ("recover", {}),
    ("servos", {"on": True}),
    ("pause", {"paused": False}),
    ("gripper", {"closed": True}),
    ("output_bit", {"byte": 1, "bit": 0, "value": True}),
    ("inject", {"fault": {"amp_alarm": {"axis": 0}}}),
]


def stop(robot: Robot) -> None:
    robot.axes.stop_latch.engage("by another client")


def switch_off(robot: Robot) -> None:
    robot.axes.servo(2, False)


def slow_down(robot: Robot) -> None:
    robot.set_speed(0.3)


CHANGES: list[tuple[Callable[[Robot], object], str]] = [
    (stop, "all motion stopped: by another client (panel)"),
    (switch_off, "servo: joint3, off (panel)"),
    (slow_down, "speed of all motion: 30 % (panel)"),
    (Robot.pause, "speed of all motion: paused (100 %) (panel)"),
]


def change(arm: Observed, make: Callable[[Robot], object]) -> None:
    """Let another client change the robot, with the tap's note of a stop."""
    arm.robot.axes.stop_latch.on_change(arm.tap._stop_line)
    with sent_by("panel"):
        make(arm.robot)


async def jog_end(client: Controller, **fields: Any) -> dict[str, Any]:
    await client.send(**JOG, seen=client.seen, **fields)
    while (answer := await client.receive())["type"] != "jog":
        pass
    return answer


@pytest.mark.parametrize(("make", "reason"), CHANGES)
def test_a_command_from_before_a_change_by_another_client_is_rejected(
    tmp_path: Path, make: Callable[[Robot], object], reason: str
) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        async with controller(server) as client:
            client.see(arm.robot)
            change(arm, make)
            for type_, fields in BOUND:
                answer = await client.command(type_, **fields)
                assert not answer["ok"], type_
                assert answer["text"].startswith(reason), answer
                assert "after what this page showed: look, and press again" in answer["text"]
            end = await jog_end(client)
            assert (end["ok"], end["silent"]) == (False, False)
            assert end["text"].startswith(reason)
            await client.send(**JOG, seen=client.seen)  # the next heartbeat of the same press
            slower = arm.robot.axes.speed.speed < 1.0
            assert (await client.command("speed", speed=1.0))["ok"] is not slower
            client.see(arm.robot)
            assert (await client.command("pause", paused=False))["ok"]
            assert (await client.command("speed", speed=1.0))["ok"]
        assert position_is_unchanged(arm)

    run(tmp_path, use)


def test_a_reset_held_up_does_not_undo_a_stop_that_came_meanwhile(tmp_path: Path) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        latch = arm.robot.axes.stop_latch
        async with controller(server) as operator, controller(server) as other:
            assert (await other.command("stop"))["ok"]
            operator.see(arm.robot)  # and presses Reset, which is held up
            assert (await other.command("stop"))["ok"]  # again: motion is stopped already
            answer = await operator.command("reset")
            assert (answer["ok"], latch.reason) == (False, "by the stop button of the page")
            assert answer["text"].startswith("motion stopped again: by the stop button of the page")
            assert "(page 2)" in answer["text"]
            operator.see(arm.robot)
            assert (await operator.command("reset"))["ok"]
            assert latch.reason == ""

    run(tmp_path, use)


def test_what_reduces_motion_is_never_too_late_and_own_commands_do_not_count(
    tmp_path: Path,
) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        async with controller(server) as client:
            client.see(arm.robot)
            before, client.seen = client.seen, None
            for type_, fields in [
                ("speed", {"speed": 0.5}),
                ("pause", {"paused": True}),
                ("servos", {"on": False}),
                ("stop", {}),
            ]:
                assert (await client.command(type_, **fields))["ok"], type_
            answer = await client.command("reset")
            assert answer["text"].startswith("the command does not say which state its page showed")
            client.seen = before
            assert (await client.command("reset"))["ok"]

    run(tmp_path, use)


def test_a_command_for_an_old_picture_is_rejected_by_the_clock_of_the_robot(
    tmp_path: Path,
) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        async with controller(server) as client:
            client.see(arm.robot)
            arm.step(MAX_AGE_S - 0.5)
            assert (await client.command("gripper", closed=True))["ok"]
            arm.step(1.0)
            answer = await client.command("gripper", closed=False)
            late = "this page showed the robot as it was 2.5 s ago, more than 2 s"
            assert answer["text"] == f"{late}: look, and press again"
            assert (await jog_end(client))["text"] == answer["text"]
            assert arm.robot.io.output_bit(0, 0)

    run(tmp_path, use)


def test_a_hold_that_was_rejected_does_not_begin_behind_a_newer_one(tmp_path: Path) -> None:
    drive = {"type": "drive", "linear": 0.1, "lateral": 0.0, "angular": 0.0}

    async def use(arm: Observed, server: PageServer) -> None:
        async with controller(server) as client:
            client.see(arm.robot)
            arm.step(MAX_AGE_S + 0.1)
            for hold, held in enumerate([JOG, drive], 1):
                await client.send(**held | {"hold": hold}, seen=client.seen)
                assert "press again" in (await client.receive())["text"]
            # Heartbeats of the first that were on the way, and one with the number of the second.
            await client.send(**JOG | {"hold": 1}, seen=client.seen)
            await client.send(**JOG | {"hold": 2}, seen=client.seen)
            client.see(arm.robot)
            await client.send(**drive, hold=3, seen=client.seen)
            assert (await client.receive())["hold"] == 3
            (page,) = server._control._controllers  # type: ignore[union-attr]
            assert page._holds[JogBeat]._newest == 0
        assert position_is_unchanged(arm)

    run(tmp_path, use)


def test_the_state_of_the_page_has_the_number_of_the_newest_reduction(tmp_path: Path) -> None:
    async def use(arm: Observed, server: PageServer) -> None:
        async with connected(server.url) as viewer, controller(server) as client:
            await viewer.until(lambda: viewer.state)
            before = viewer.state["seen"]
            change(arm, slow_down)
            await viewer.until(lambda: viewer.state["seen"] > before)
            time_s = arm.robot.clock.now_ns() / 1e9
            client.seen = {"events": viewer.state["seen"], "time_s": time_s}
            assert (await client.command("speed", speed=1.0))["ok"]

    run(tmp_path, use)
