"""Cyclic torque mode of a CiA 402 axis, on a looped simulated drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from tests.plugins.cia402.looped_drive import PERIOD_S, LoopedDrive
from tests.plugins.cia402.test_axes import LoopedAxes

from robotd.api import CommandMode, NotReady, Operation
from robotd_cia402.controlword import DriveState
from robotd_cia402.modes import OperationMode
from robotd_cia402.object_numbers import MODE, OUTPUTS, TARGET_POSITION, TARGET_TORQUE
from robotd_cia402.simulated.drive import SimulatedState

# The model of a motor, see ``Motors.push``.
INERTIA, VISCOUS, COULOMB = 0.5, 1.0, 2.0
RATED_NM = 50.0


@pytest.fixture
def axes() -> LoopedAxes:
    """Servo on and in torque mode, at rest."""
    made = LoopedAxes(LoopedDrive())
    made.servo(0, on=True, timeout_s=1.0)
    made.set_command_mode(0, CommandMode.TORQUE)
    return made


def drive(axes: LoopedAxes, torque: float, seconds: float) -> list[float]:
    """Stream ``torque``; return the measured velocity of each period."""
    velocities = []
    for _ in range(round(seconds / PERIOD_S)):
        axes.stream_torque(np.array([torque]), 0)
        axes.looped.run(PERIOD_S)
        velocities.append(float(axes.looped.image.velocity[0]))
    return velocities


def test_an_axis_in_torque_mode_holds_its_position_until_it_streams(axes: LoopedAxes) -> None:
    assert axes.looped.image.mode[0] == CommandMode.TORQUE
    assert axes.looped.axis.report.displayed_mode == OperationMode.CYCLIC_POSITION
    assert axes.looped.image.operation[0] == Operation.IDLE


def test_a_torque_accelerates_as_inertia_and_friction_say(axes: LoopedAxes) -> None:
    axes.begin_stream([0])
    assert axes.looped.axis.report.displayed_mode == OperationMode.CYCLIC_TORQUE
    torque, seconds = 5.0, 0.2
    velocity = drive(axes, torque, seconds)[-1]
    # v' = (T - c - d·v) / J from rest
    steady, decay = (torque - COULOMB) / VISCOUS, np.exp(-VISCOUS / INERTIA * seconds)
    assert velocity == pytest.approx(steady * (1.0 - decay), rel=0.08)
    assert axes.looped.image.torque[0] == pytest.approx(torque, abs=0.3)
    assert axes.looped.image.position_command[0] == axes.looped.image.position[0]


def test_a_torque_that_is_not_a_number_leaves_the_last_one(axes: LoopedAxes) -> None:
    axes.begin_stream([0])
    drive(axes, 4.0, PERIOD_S)
    drive(axes, float("nan"), PERIOD_S)
    assert axes.looped.objects.dictionary[TARGET_TORQUE, 0] == round(4.0 / RATED_NM * 1000)


def test_the_stream_begins_with_the_torque_that_holds_the_axis(axes: LoopedAxes) -> None:
    axes.looped.motors._torque[0] = 6.5  # as gravity would ask for
    axes.looped.drive._measure()
    axes.looped.objects.take()
    axes.looped.axis.observe(axes.looped.image)
    sent: list[tuple[int, int]] = []
    put = axes.looped.objects.put

    def note(values: Sequence[int]) -> None:
        put(values)
        sent.append((values[OUTPUTS.index(MODE)], values[OUTPUTS.index(TARGET_TORQUE)]))

    axes.looped.objects.put = note  # type: ignore[method-assign]
    axes.begin_stream([0])
    first = next(torque for mode, torque in sent if mode == OperationMode.CYCLIC_TORQUE)
    assert first == round(6.5 / RATED_NM * 1000)


@pytest.mark.parametrize("ending", ["stop", "quick_stop", "end_stream"])
def test_every_end_is_a_quick_stop_and_then_position_control(axes: LoopedAxes, ending: str) -> None:
    axes.begin_stream([0])
    drive(axes, 8.0, 0.3)
    getattr(axes, ending)([0])
    before = float(axes.looped.image.velocity[0])
    fastest, steps = abs(before), []
    for _ in range(100):
        axes.looped.run(PERIOD_S)
        now = float(axes.looped.image.velocity[0])
        steps.append(abs(now - before))
        before, fastest = now, max(fastest, abs(now))
    assert axes.looped.image.operation[0] == Operation.IDLE
    assert axes.looped.axis.report.state is DriveState.QUICK_STOP_ACTIVE
    ramp = axes.looped.axis.options.quick_stop_deceleration_rad_s2
    assert max(steps) < 1.5 * ramp * PERIOD_S
    assert before == pytest.approx(0.0, abs=1e-3)

    rest = float(axes.looped.image.position[0])
    seen: list[tuple[int, int]] = []
    put = axes.looped.objects.put

    def note(values: Sequence[int]) -> None:
        put(values)
        if axes.looped.axis.report.state is not None:
            seen.append((values[OUTPUTS.index(MODE)], values[OUTPUTS.index(TARGET_POSITION)]))

    axes.looped.objects.put = note  # type: ignore[method-assign]
    axes.set_command_mode(0, CommandMode.POSITION)
    axes.looped.run(0.5)
    assert axes.looped.axis.report.state is DriveState.OPERATION_ENABLED
    assert axes.looped.axis.report.displayed_mode == OperationMode.CYCLIC_POSITION
    assert axes.looped.image.position[0] == pytest.approx(rest, abs=1e-4)
    counts = [value for mode, value in seen if mode == OperationMode.CYCLIC_POSITION]
    assert max(counts) - min(counts) <= 2
    assert all(mode != OperationMode.CYCLIC_TORQUE for mode, _ in seen[1:])


def test_operation_is_never_enabled_with_a_torque(axes: LoopedAxes) -> None:
    """Transition 16 with mode 10 in force would apply the last torque to a standing arm."""
    axes.begin_stream([0])
    drive(axes, 8.0, 0.2)
    axes.stop([0])
    axes.looped.run(0.5)
    axes.begin_stream([0])  # torque mode is still set: from the quick stop into torque again
    velocities = [float(axes.looped.image.velocity[0])]
    for _ in range(20):
        axes.looped.run(PERIOD_S)
        velocities.append(float(axes.looped.image.velocity[0]))
    assert max(map(abs, velocities)) < 1e-3


def test_no_torque_remains_in_a_drive_that_switches_itself_off(axes: LoopedAxes) -> None:
    """It may change its mode late, and a CAN bus has no torque in the frames of other modes."""
    looped = axes.looped
    put, requested = looped.objects.put, [int(OperationMode.CYCLIC_TORQUE)] * 20
    before, positions = [0], list[float]()

    def put_as_can(values: Sequence[int]) -> None:
        positions.append(looped.drive.position)
        requested.append(values[OUTPUTS.index(MODE)])
        if requested[-1] == OperationMode.CYCLIC_TORQUE:
            before[0] = values[OUTPUTS.index(TARGET_TORQUE)]
        late = list(values)
        late[OUTPUTS.index(MODE)], late[OUTPUTS.index(TARGET_TORQUE)] = requested.pop(0), before[0]
        put(late)

    axes.begin_stream([0])
    looped.objects.put = put_as_can  # type: ignore[method-assign]
    drive(axes, 8.0, 0.2)
    looped.drive._leave_power(SimulatedState.SWITCH_ON_DISABLED)  # safe torque off
    looped.run(1.0)
    positions.clear()
    axes.servo(0, on=True, timeout_s=1.0)
    looped.run(0.2)
    assert looped.axis.report.powered
    assert max(positions) - min(positions) < 1e-3


def test_a_drive_without_the_target_torque_says_so(axes: LoopedAxes) -> None:
    axes.looped.objects.outputs = axes.looped.objects.outputs[:4]
    with pytest.raises(NotReady, match=r"node 1: no PDO holds 0x6071 \(target torque\)"):
        axes.begin_stream([0])
    assert axes.looped.axis.report.displayed_mode == OperationMode.CYCLIC_POSITION


def test_a_joint_whose_rated_torque_is_not_known_takes_no_torque(axes: LoopedAxes) -> None:
    axes.looped.axis.scaling.rated_torque_nm = float("nan")
    with pytest.raises(NotReady, match="the rated torque of the joint is not known"):
        axes.begin_stream([0])


def test_a_drive_that_does_not_change_its_mode_keeps_position_control(axes: LoopedAxes) -> None:
    axes.looped.drive.motion._handlers.pop(
        next(iter(mode for mode in axes.looped.drive.motion._handlers if mode == 10))
    )
    before = axes.looped.drive.motion._change
    axes.looped.drive.motion._change = (  # type: ignore[method-assign]
        lambda mode: None if mode == 10 else before(mode)
    )
    with pytest.raises(Exception, match="mode cyclic_torque was requested, the drive shows mode 8"):
        axes.begin_stream([0])
    axes.looped.run(0.1)
    assert axes.looped.objects.dictionary[MODE, 0] == OperationMode.CYCLIC_POSITION
