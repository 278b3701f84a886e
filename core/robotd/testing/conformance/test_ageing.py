"""Ageing of values: what is shown is alive, and what is dead does not look alive."""

from __future__ import annotations

import time
from contextlib import suppress

import numpy as np

from robotd.cycle.execution import Outcome
from robotd.device.bench import Bench
from robotd.device.state import EngineState
from robotd.errors import Unsupported
from robotd.plugin.guard import unguarded
from robotd.testing.conformance.rig import MakeRig, Rig
from robotd.testing.conformance.stand import BenchOrSkip

CALLS = 20


def test_values_are_fresh(rig: Rig) -> None:
    ages_s = []

    def watch(image: object) -> None:
        ages_s.append((rig.clock.now_ns() - rig.image.fresh_ns) * 1e-9)

    with rig.each_period(watch):
        rig.let(0.3)
    assert max(ages_s) <= rig.robot.engine.settings.stale_after_s
    assert min(ages_s) >= -rig.period_s, "values from the future: another clock was used"


def test_their_time_goes_on(rig: Rig) -> None:
    first = rig.image.fresh_ns
    rig.let(0.2)
    assert abs((rig.image.fresh_ns - first) * 1e-9 - 0.2) <= 0.1


def test_values_follow_the_motion(rig: Rig) -> None:
    stale_s = rig.robot.engine.settings.stale_after_s
    with rig.recording() as recording:
        rig.move(rig.all, rig.image.position_command + rig.travel())
        rig.rest()
    for axis in rig.all:
        fast = np.abs(recording.velocity_command[:, axis]) > 0.5 * rig.profile(axis).velocity
        assert fast.any(), "the commanded velocity does not show the motion"
        times_s, position = recording.time_s[fast], recording.position[fast, axis]
        changed = times_s[np.flatnonzero(np.diff(position, prepend=np.nan))]
        assert np.diff(changed).max(initial=0.0) <= stale_s
        assert len(changed) > 3, "the position stands still while the axis moves"


def test_a_dead_bus_does_not_look_alive(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up()
    bench, engine = BenchOrSkip.of(rig), rig.robot.engine
    bench.freeze(True)
    stale_s = engine.settings.stale_after_s
    rig.until(lambda: not engine.ready, "the engine is not ready", 3 * stale_s + 0.2)
    assert engine.state in (EngineState.UNKNOWN, EngineState.RUNNING)
    bench.freeze(False)
    if engine.state is EngineState.UNKNOWN:
        rig.until(lambda: engine.ready, "the engine is ready again when values arrive")


def test_the_device_says_at_once_why_it_is_silent(make_rig: MakeRig) -> None:
    rig = make_rig()
    device = unguarded(rig.parts.device)

    def said() -> str:
        began_s = time.perf_counter()
        text = min(device.fault() for _ in range(CALLS))
        assert (time.perf_counter() - began_s) / CALLS < rig.period_s, "fault() blocks"
        assert "\n" not in text, "a fault is part of a line"
        return text

    said()
    rig.up()
    assert said() == "", "a fault while fresh values arrive"
    if rig.bench is not None:
        with suppress(Unsupported):
            rig.bench.freeze(True)
            rig.until(lambda: not rig.robot.engine.ready, "the engine is not ready")
            said()
            rig.bench.freeze(False)
    rig.robot.engine.close()
    said()


def test_a_dead_bus_ends_a_trajectory(jointed: Rig, bench: Bench) -> None:
    rig = jointed
    way = rig.travel()[list(rig.robot.joint_axes)]
    with rig.following([1.5], [way]) as execution:
        rig.let(0.4)
        bench.freeze(True)
        try:
            rig.until(lambda: execution.done, "the trajectory ends")
        finally:
            bench.freeze(False)
    assert execution.outcome is Outcome.FAULT
    rig.rest()


def test_nothing_is_fresh_after_communication_stopped(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.up()
    rig.robot.engine.stop_communication()
    rig.let(0.05)
    last = rig.image.fresh_ns
    rig.parts.driver.read(rig.image)
    rig.let(0.2)
    rig.parts.driver.read(rig.image)
    assert rig.image.fresh_ns == last
