"""Whatever clients ask and whatever becomes of the bus: no drive is commanded by surprise.

Judged by what each drive executes. `python -m tools.endurance.witness` runs more seeds; one that
fails joins `FAILED`, with what it found, when it is mended.
"""

from __future__ import annotations

import pytest
from tests.witness.backends import run_seed

SEEDS, TOOL_SEEDS = 100, 40  # of each backend, and of each with a tool
DAILY = {
    "sim": 12,
    "arm": 15,
    "mujoco": 3,
    "dobot": 10,
    "franka": 3,
    "feetech": 2,
    "dynamixel": 1,
    "wmx": 6,
    "canopen": 4,
    "keeping": 2,
    "mode-by-sdo": 2,
    "ethercat": 4,
    "sim-base": 8,
    "canopen-base": 2,
    "keeping-base": 2,
    "ethercat-base": 3,
    "wmx-base": 2,
    "mujoco-tool": 1,
    "dobot-tool": 1,
    "franka-tool": 1,
}
FAILED = [
    # Servos stayed on after a shutdown with stale values, and would have obeyed.
    ("arm", 9),
    ("arm", 24),
    ("sim", 9),
    ("sim", 29),
    # The simulated device went on with a velocity command while robotd stood still.
    ("sim", 122),
    # Mended on the way; what they found is not recorded.
    ("sim", 23),
    ("sim", 160),
    # The arm pressed against the table of its scene: no goal could be reached.
    ("mujoco", 15),
    # Paths and streams went on while a drive was silent.
    ("canopen", 17),
    ("canopen", 20),
    ("canopen", 38),
    # Frames waited in a blocked network interface, and were executed late, all at once.
    ("ethercat", 15),
    ("ethercat", 20),
    # Frames lost during the start counted for ever: the drives obeyed nothing.
    ("ethercat", 26),
    # The judge took the one frame that waited for more: the drive had braked by itself before it.
    ("ethercat", 150),
    # The ramp of a velocity went on while a drive was silent, which got all of it in one period.
    ("canopen-base", 0),
    ("canopen-base", 2),
    ("ethercat-base", 0),
    # The judge took a period without a new target for one whose target was lost.
    ("keeping-base", 18),
    # The judge did not know that late answers let one more setpoint wait.
    ("keeping-base", 66),
    # A servo off and the end of the base's stream waited for each other, in simulated time only.
    ("canopen-base", 92),
    # The judge did not know that the arm has stopped at its last target when robotd was killed,
    # and that a move brakes harder where it would run past its target.
    ("dobot", 14),
    ("dobot", 52),
    # A profile that was a third of a period late made its step as much longer.
    ("dobot", 2002),
    # A killed robotd had left motion and servos on: the next one could not load parameters.
    ("wmx", 12),
    ("wmx", 17),
    # A stop that began a part of a period late got the travel of all of it in its first period.
    ("arm", 46),
    ("sim", 46),
    # The bench's killed bus thread was still in a job that was ended.
    ("feetech", 95),
    # An engine that had stood still went on after the path's new start: 0.14 rad off the path.
    ("wmx", 38),
    # A stop was over by what had been sent, while the cable was cut: the rest of its ramp followed.
    ("dobot", 2477),
    # Targets that were computed in a silence were followed after it, some of them backwards.
    ("feetech", 6),
    ("feetech", 14),
    ("dynamixel", 72),
    # A reply that came late showed an old goal: the next ones led back to that.
    ("feetech", 8),
    # Values were lost in motion: goals went at once to the position that was measured after it.
    ("feetech", 12),
    # A jog ran 0.1 rad beyond the position limit, by which the servo was behind its command.
    ("feetech", 38),
    # A port that was lost while servos were held again: its thread ended before the jobs of others.
    ("feetech", 55),
    # An axis that was guided when its port was lost remained guided: no servo on after it.
    ("feetech", 137),
    ("dynamixel", 137),
    # The judge took a goal that a servo is given where a hand has led it for a motion.
    ("feetech", 2),
    # The hand of the bench led the joint on while the arm was to recover.
    ("dynamixel", 40),
    # A stop after a missing period, which the buffer had bridged, began a period late.
    ("wmx", 23),
    ("wmx", 70),
    # A guided joint went on with its velocity where it was caught, to the end of its range.
    ("franka", 23),
    # The newest target was followed after a silence, the next one led back to that before it.
    ("franka-tool", 20),
    ("franka-tool", 26),
    # The judge took what is left of a ramp after rejected or late calls for a harder one.
    ("wmx-base", 9),
    ("wmx-base", 15),
    # The ramp of a base went on while the engine rejected its velocities: one step for all of it.
    ("wmx-base", 20),
    ("wmx-base", 24),
    ("wmx-base", 27),
    ("wmx-base", 32),
    ("wmx-base", 35),
    # The engine did not answer a stop in time: it was repeated 10 s later, and the wheels went on.
    ("wmx-base", 60),
    ("wmx-base", 77),
    # The ramp of a base went on while the engine stood still: one step for all of it.
    ("wmx-base", 71),
    # A stop while no status could be read stopped nothing, the next one had no deceleration.
    ("wmx-base", 23),
    ("wmx-base", 51),
    # The sender was late by less than a period: two steps of a ramp came in the next one.
    ("wmx-base", 44),
    # A stop was over while the engine came slowly back to setpoints of a source that had ended.
    ("wmx", 200),
    # A stop was over while the servo was still behind its command.
    ("feetech", 232),
    # Late replies of the stand-in queued up: 1.3 s of them were still to come when it was healed.
    ("feetech", 10025),
    # A stall of 3 ms put the bus thread before the control loop: it sent one target twice.
    ("feetech", 10089),
    # The bus thread was busy for 70 ms: a jog went on, and its travel came in two periods.
    ("dynamixel", 206),
    # The engine's buffer was emptied 1 % faster, all at once: half as much acceleration again.
    ("wmx-base", 338),
    # A goal came while the loop stalled: its first setpoint was two periods ahead on its path.
    ("wmx-base", 10002),
    # All servos off brings to rest first, a joint that was just let go, too.
    ("feetech", 20023),
    # A ramp with limited jerk that was to end sped up on while the engine took nothing.
    ("wmx-base", 21000),
    # A slower jog near a limit brought a deceleration that was too gentle to stop before it.
    ("sim-base", 22039),
    # A blocked engine took the stop of the wheels when it was free again; before it nothing could.
    ("wmx-base", 313),
    # The robot's file allowed goals that ask for twice the acceleration.
    ("mujoco-tool", 325),
    # The bench did not model the watchdog by which the engine ends a jog of a stalled robotd.
    ("wmx", 252),
    # Two targets waited unread when no more were sent, and were executed late.
    ("dobot", 41004),
    # The connection was lost and open again between two periods: the path went on, 8 periods on.
    ("dobot", 41041),
    # The judge did not know that an arm bridges a few lost packets by its last torque.
    ("franka-tool", 41006),
    # The controller was started again for a payload between two periods: the arm was pulled back.
    ("franka-tool", 51020),
    # The play took a rejected servo on for the end of what was being held again.
    ("feetech", 51004),
    ("dynamixel", 51004),
]


@pytest.mark.parametrize(
    ("backend", "seed"),
    [
        pytest.param(name, seed, marks=[] if seed < daily else [pytest.mark.long])
        for name, daily in DAILY.items()
        for seed in range(TOOL_SEEDS if name.endswith("-tool") else SEEDS)
    ],
)
def test_no_drive_is_commanded_by_surprise(backend: str, seed: int) -> None:
    judge_seed(backend, seed)


@pytest.mark.parametrize(("backend", "seed"), FAILED)
def test_a_seed_that_failed_once(backend: str, seed: int) -> None:
    judge_seed(backend, seed)


def judge_seed(backend: str, seed: int) -> None:
    if backend.startswith("wmx"):
        pytest.importorskip("nanobind", reason="make -C plugins/wmx tools")
    found = run_seed(backend, seed)
    assert not found, found
