"""Motion by the CiA 402 layer on a simulated drive, without a bus: the protocol is enough."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

import pytest
from tests.plugins.cia402.looped_drive import (
    FAST,
    LoopedDrive,
    idle,
    peak_velocity,
)

from robotd.api import (
    CommandMode,
    NotReady,
    Operation,
    OperationError,
    Profile,
)
from robotd_cia402.controlword import DriveState, Phase
from robotd_cia402.object_numbers import (
    MODE,
    OUTPUTS,
    TARGET_VELOCITY,
)
from robotd_cia402.simulated.drive import SimulatedState


def test_a_move_reaches_its_target_and_shows_its_profile(on: LoopedDrive) -> None:
    on.commands.move(0.5, FAST)
    on.run(0.25)
    assert on.image.operation[0] == Operation.POSITION
    assert on.image.velocity_command[0] == pytest.approx(1.0)
    idle(on)
    assert on.axis.activity.complete
    assert on.drive.position == pytest.approx(0.5, abs=1e-3)
    assert on.image.position_command[0] == pytest.approx(0.5, abs=1e-5)


def test_a_move_begins_without_a_step_in_a_drive_that_changes_its_mode_late() -> None:
    looped = LoopedDrive()
    send, requested = looped.objects.send, [0] * 5

    def change_mode_late() -> None:
        send()
        requested.append(looped.objects.dictionary[MODE, 0])
        looped.objects.dictionary[MODE, 0] = requested.pop(0)

    looped.objects.send = change_mode_late  # type: ignore[method-assign]
    looped.commands.enable(1.0)
    looped.commands.move(2.0, FAST)
    assert peak_velocity(looped, 700) == pytest.approx(FAST.velocity, abs=0.05)
    assert looped.drive.position == pytest.approx(2.0, abs=1e-3)


def test_a_stop_brakes_a_move_before_its_target(on: LoopedDrive) -> None:
    on.commands.move(2.0, FAST)
    on.run(0.5)
    on.commands.stop()
    idle(on)
    assert 0.2 < on.drive.position < 1.0
    assert not on.axis.activity.complete


@pytest.mark.parametrize("phase", [Phase.ENTERING, Phase.ASKING, Phase.RELEASING])
def test_a_stop_in_the_middle_of_a_frame_of_the_handshake_counts(
    on: LoopedDrive, phase: Phase
) -> None:
    """The control loop has read the phase and not yet written the bits."""
    mode, stopping = on.axis.mode, threading.Thread(target=on.commands.stop)

    class Word(int):
        def __and__(self, bits: int) -> int:
            if mode.phase is phase and stopping.ident is None:
                stopping.start()
                stopping.join(0.1)  # it waits for the end of the frame
            return int(self) & bits

    advance = mode.advance_target

    def raced(word: int, *rest: Any) -> bool:
        ended = advance(Word(word), *rest)
        if stopping.ident is not None:
            stopping.join(5.0)
        return ended

    mode.advance_target = raced  # type: ignore[method-assign]
    on.commands.move(2.0, FAST)
    idle(on)
    on.run(0.5)
    assert on.drive.position < 0.1
    assert not on.axis.activity.complete


@pytest.mark.parametrize("velocity_mode", ["pv", "csv"])
def test_a_jog_moves_at_its_speed_until_it_is_stopped(velocity_mode: str) -> None:
    looped = LoopedDrive(velocity_mode=velocity_mode)
    looped.commands.enable(1.0)
    looped.commands.jog(FAST)
    looped.run(1.0)
    assert looped.image.velocity[0] == pytest.approx(1.0, abs=0.05)
    looped.commands.jog(Profile(velocity=0.0, acceleration=5.0, deceleration=5.0))
    idle(looped)
    assert looped.image.velocity_command[0] == 0.0


@pytest.mark.parametrize("stream_mode", ["csp", "ip"])
def test_streamed_setpoints_are_followed(stream_mode: str) -> None:
    looped = LoopedDrive(stream_mode=stream_mode)
    looped.commands.enable(1.0)
    looped.commands.prepare_stream()
    looped.commands.begin_stream()
    for step in range(100):
        looped.axis.follow(0.001 * step, 0.25)
        looped.run(0.004)
    looped.axis.follow(0.1, 0.0)
    looped.run(0.2)
    looped.commands.end_stream()
    assert looped.axis.activity.complete
    assert looped.drive.position == pytest.approx(0.1, abs=1e-3)


def test_a_quick_stop_keeps_the_power_and_the_next_move_leaves_it(on: LoopedDrive) -> None:
    on.commands.move(2.0, FAST)
    on.run(0.5)
    on.commands.quick_stop()
    on.run(0.1)
    assert on.axis.report.state is DriveState.QUICK_STOP_ACTIVE
    idle(on)
    on.commands.move(0.0, FAST)
    idle(on)
    assert on.drive.position == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("hard", [5.0, 80.0])
def test_a_quick_stop_takes_over_a_gentler_stop(on: LoopedDrive, hard: float) -> None:
    """The drive has 40 rad/s² for a quick stop: a harder ramp of the command stays in force."""
    on.commands.move(9.0, Profile(velocity=2.0, acceleration=20.0, deceleration=hard))
    on.run(0.3)
    on.commands.stop()
    on.run(0.008)
    speed, stopped = on.image.velocity_command[0], on.drive.position
    on.commands.quick_stop()
    idle(on)
    way = speed**2 / (2.0 * max(hard, 40.0))
    assert on.drive.position - stopped == pytest.approx(way, abs=0.02)
    assert on.image.position_command[0] == pytest.approx(on.drive.position, abs=1e-3)


@pytest.mark.parametrize("velocity_mode", ["csv", "pv"])
def test_a_velocity_command_that_turns_slows_down_by_its_deceleration(velocity_mode: str) -> None:
    looped = LoopedDrive(velocity_mode=velocity_mode)
    looped.commands.set_mode(CommandMode.VELOCITY)
    looped.commands.enable(1.0)
    looped.commands.jog(Profile(velocity=1.0, acceleration=10.0, deceleration=10.0))
    looped.run(0.5)
    looped.commands.jog(Profile(velocity=-1.0, acceleration=10.0, deceleration=2.0))
    looped.run(0.25)
    assert looped.image.velocity_command[0] == pytest.approx(0.5, abs=0.05)
    looped.run(0.3)
    assert looped.image.velocity_command[0] == pytest.approx(-0.5, abs=0.1)


@pytest.mark.parametrize("velocity_mode", ["csv", "pv"])
def test_a_lost_drive_gets_no_velocity(velocity_mode: str) -> None:
    """It may receive what is sent."""
    looped, sent = LoopedDrive(velocity_mode=velocity_mode), list[int]()
    put = looped.objects.put

    def note(values: Sequence[int]) -> None:
        put(values)
        sent.append(values[OUTPUTS.index(TARGET_VELOCITY)])

    looped.objects.put = note  # type: ignore[method-assign]
    looped.commands.enable(1.0)
    looped.commands.jog(FAST)
    looped.run(0.5)
    assert sent[-1]
    looped.objects.node.online = False
    looped.run(0.5)
    assert not sent[-1]
    with pytest.raises(NotReady, match="node 1: offline"):
        looped.commands.set_mode(CommandMode.POSITION)


@pytest.mark.parametrize("motion", ["stream", "jog", "move"])
def test_a_quick_stop_of_the_drive_itself_ends_the_motion(on: LoopedDrive, motion: str) -> None:
    """It is left when its cause has ended, for "enable operation" stays in the controlword."""
    if motion == "stream":
        on.commands.prepare_stream()
        on.commands.begin_stream()
    elif motion == "jog":
        on.commands.jog(FAST)
    else:
        on.commands.move(2.0, FAST)
    enter = on.drive._enter
    for step in range(200):
        if on.axis.activity.streaming:
            on.axis.follow(0.004 * step, 1.0)
        if step == 100:
            enter(SimulatedState.QUICK_STOP_ACTIVE)
            on.drive._enter = lambda state: None  # type: ignore[method-assign]
        if step == 150:
            on.drive._enter = enter  # type: ignore[method-assign]
        on.run(0.004)
    assert on.drive.position < 0.5
    assert peak_velocity(on, 100) < 0.01
    assert on.axis.activity.is_idle


def test_a_move_waits_for_the_end_of_a_quick_stop(on: LoopedDrive) -> None:
    on.commands.move(3.0, Profile(velocity=2.0, acceleration=20.0, deceleration=20.0))
    on.run(0.5)
    on.commands.quick_stop()
    on.run(0.02)
    braking = on.image.position_command[0]
    on.commands.move(3.0, FAST)
    assert on.axis.report.state is DriveState.OPERATION_ENABLED
    assert on.drive.position > braking
    assert abs(on.motors.velocity(0)) < 0.05
    idle(on)
    assert on.drive.position == pytest.approx(3.0, abs=1e-3)


@pytest.mark.parametrize("by_supervision", [False, True])
@pytest.mark.parametrize("command", ["move", "jog", "home"])
def test_a_stop_during_the_sdo_of_a_command_prevents_its_motion(
    command: str, by_supervision: bool
) -> None:
    looped = LoopedDrive(homing_method=19)
    looped.commands.enable(1.0)
    write = looped.objects.write

    def stop_meanwhile(index: int, sub: int, value: int) -> None:
        if by_supervision:
            looped.axis.brake(10.0)
        else:
            looped.commands.stop()
        write(index, sub, value)

    looped.objects.write = stop_meanwhile  # type: ignore[method-assign]
    start = {
        "move": lambda: looped.commands.move(0.5, FAST),
        "jog": lambda: looped.commands.jog(FAST),
        "home": lambda: looped.commands.home(5.0),
    }
    with pytest.raises(OperationError, match="stopped before the motion began"):
        start[command]()
    assert peak_velocity(looped) < 0.01
    assert looped.image.operation[0] == Operation.IDLE
