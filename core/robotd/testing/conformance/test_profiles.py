"""Moves keep to the profile that they were given, and to nothing more."""

from __future__ import annotations

import numpy as np

from robotd.device.state import Operation
from robotd.testing.conformance.attempts import judge, steep_ramps
from robotd.testing.conformance.recording import Recording
from robotd.testing.conformance.rig import SETTLED_RAD, Rig

SPAN_S = 0.02  # over which ramps are measured
MORE = 1.1  # what a measured value may be above its limit


def record_move(rig: Rig, share: float = 1.0) -> tuple[Recording, np.ndarray]:
    distance = rig.travel()
    with rig.recording() as recording:
        rig.move(rig.all, rig.image.position_command + distance, share)
        rig.rest()
    return recording, distance


def test_a_move_keeps_to_its_velocity(rig: Rig) -> None:
    for share in (1.0, 0.4):
        recording, _ = record_move(rig, share)
        for axis in rig.all:
            limit = rig.profile(axis, share).velocity
            top = np.abs(recording.velocity[:, axis]).max()
            assert 0.8 * limit <= top <= MORE * limit


def test_a_move_keeps_to_its_ramps(rig: Rig) -> None:
    judge(rig, lambda: record_move(rig)[0], lambda found: steep_ramps(rig, found, SPAN_S, MORE))


def test_a_second_is_a_second(rig: Rig) -> None:
    recording, distance = record_move(rig, 0.3)
    for axis in rig.all:
        profile = rig.profile(axis, 0.3)
        shortest_s = (
            abs(distance[axis]) / profile.velocity + profile.velocity / profile.acceleration
        )
        moving = recording.time_s[np.abs(recording.velocity[:, axis]) > 0.02 * profile.velocity]
        took_s = moving[-1] - moving[0]
        # Ramps may be rounded off, which takes longer; nothing may be faster than its profile.
        assert 0.93 * shortest_s <= took_s <= 1.5 * shortest_s + 0.1


def test_a_move_ends_at_its_target_without_overshoot(rig: Rig) -> None:
    start = rig.image.position.copy()
    recording, distance = record_move(rig)
    for axis in rig.all:
        way = (recording.position[:, axis] - start[axis]) * np.sign(distance[axis])
        assert way.max() <= abs(distance[axis]) + SETTLED_RAD
        assert way.min() >= -SETTLED_RAD


def test_a_move_shows_what_it_does(rig: Rig) -> None:
    rig.move(rig.all, rig.image.position_command + rig.travel())
    rig.until(lambda: bool((rig.image.operation == Operation.POSITION).all()), "all axes move")
    assert not rig.image.motion_complete.any()
    rig.rest()
    assert rig.image.motion_complete.all()


def test_a_new_target_is_taken_without_a_jump(rig: Rig) -> None:
    def motion() -> Recording:
        start, distance = rig.image.position_command.copy(), rig.travel()
        with rig.recording() as recording:
            rig.move(rig.all, start + distance)
            rig.let(0.2)
            rig.move(rig.all, start - 0.2 * distance)
            rig.rest()
        assert np.abs(rig.image.position - (start - 0.2 * distance)).max() <= SETTLED_RAD
        return recording

    judge(rig, motion, lambda recording: steep_ramps(rig, recording, SPAN_S, MORE))


def test_a_move_to_where_it_stands_ends(rig: Rig) -> None:
    start = rig.image.position.copy()
    rig.move(rig.all, rig.image.position_command)
    rig.rest()
    assert np.abs(rig.image.position - start).max() <= SETTLED_RAD
