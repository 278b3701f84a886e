"""Fixtures of the checks, their time limit, and the report at the end."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from robotd.api import Capability, FaultInjector, RobotdError
from robotd_conformance.checks.comparison import explain
from robotd_conformance.checks.harness import Harness, MakeHarness
from robotd_conformance.checks.inconclusive import Repeats
from robotd_conformance.checks.interruption import INTERRUPTION
from robotd_conformance.checks.kit_report import KitReport
from robotd_conformance.checks.kit_target import KitTarget
from robotd_conformance.checks.known_faults import quick_checks
from robotd_conformance.checks.results import Results
from robotd_conformance.checks.start_pose import StartPose, parse_range
from robotd_conformance.checks.surroundings import surroundings
from robotd_conformance.checks.time_limits import TimeLimits
from robotd_shared.foreign_process import note_step


def pytest_configure(config: pytest.Config) -> None:
    """Load backend and robot once, so that a wrong name is reported once."""
    name = config.getoption("--robotd-backend")
    if not name:
        raise pytest.UsageError("which backend? add --robotd-backend NAME")
    config.add_cleanup(INTERRUPTION.install())
    config.pluginmanager.register(TimeLimits(), "robotd-conformance-time-limits")
    config.stash[AT_START] = surroundings()
    try:
        note_step(f"loading the backend {name}")
        robot, overrides = config.getoption("--robotd-robot"), config.getoption("--robotd-set")
        ranges = dict(map(parse_range, config.getoption("--robotd-range")))
        pose = StartPose(config.getoption("--robotd-max-excursion"), ranges)
        target = KitTarget(name, robot, overrides, pose)
    except RobotdError as error:
        raise pytest.UsageError(str(error)) from error
    config.stash[TARGET] = target
    path = config.getoption("--robotd-resume")
    results = Results(Path(path), target.arguments) if path else None
    config.stash[RESULTS] = results
    progress = bool(config.getoption("--robotd-progress"))
    report = KitReport(target, results, progress=progress)
    config.pluginmanager.register(report, "robotd-conformance-report")
    config.pluginmanager.register(Repeats(target), "robotd-conformance-repeats")


# First what moves nothing, then stops, then ever longer and faster motion; endurance at the end.
SAFE_ORDER = (
    "rejections", "fieldbus", "io", "io_images", "switches", "enable", "hand_moves", "guiding",
    "payload", "wrenches",
    "connection", "ageing", "stopping", "stops_of_some_axes", "stop_ramps", "ramps", "faults",
    "watchdog", "axes_apart", "resumption", "units", "neighbours", "small_and_large", "profiles",
    "overrides", "command_sequences", "shown_motion", "while_it_happens", "extremes", "questions",
    "feedback", "last_axis", "late_effects", "velocity_commands", "streams", "setpoints",
    "whole_streams", "underrun", "dry_buffers", "silences",
    "trajectories", "bus_objects", "lost_nodes", "limits", "torque", "scaling", "scale_and_home",
    "parameters", "reopening", "open_again", "again", "cost", "process", "leaks", "locks",
    "threads", "device_under_load",
)  # fmt: skip
# Checks that change what a position means, or that use the whole travel of a simulated axis.
LONGEST_PERIOD_S = 0.025  # of values that show ramps and delays
UNCOUNTED = (Capability.HOMING, Capability.SCALING, Capability.SIMULATED)
MISPLACED = 13  # exit status of pytest: an axis is where no check can begin
TARGET = pytest.StashKey[KitTarget]()
RESULTS = pytest.StashKey["Results | None"]()
AT_START = pytest.StashKey[dict[str, object]]()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put the checks in a safe order; note capability and clauses of each."""
    ranks = {theme: rank for rank, theme in enumerate(SAFE_ORDER)}
    items.sort(key=lambda item: ranks.get(item.path.stem.removeprefix("test_"), len(ranks)))
    for item in items:
        mark = item.get_closest_marker("needs")
        capability = mark.args[0] if mark else Capability.AXES
        item.user_properties.append(("capability", str(capability)))
        clauses = [name for mark in _clause_marks(item) for name in mark.args]
        item.user_properties.append(("clauses", " ".join(dict.fromkeys(clauses))))
    if config.getoption("--robotd-quick"):
        quick = quick_checks()
        chosen = [item for item in items if f"{item.path.name}::{_function(item)}" in quick]
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = chosen
    results = config.stash.get(RESULTS, None)  # none either where the backend cannot be loaded
    if results is not None:
        left, passed = results.split(items)
        config.hook.pytest_deselected(items=passed)
        items[:] = left


def _clause_marks(item: pytest.Item) -> Iterable[pytest.Mark]:
    """Return the marks with the clauses of a check; a repeated one has those of its own."""
    repeated = item.callspec.params.get("check") if hasattr(item, "callspec") else None
    if repeated is None:
        return item.iter_markers("clause")
    return [mark for mark in vars(repeated)["pytestmark"] if mark.name == "clause"]


def _function(item: pytest.Item) -> str:
    return item.name.partition("[")[0]


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what the backend does not have."""
    mark = item.get_closest_marker("needs")
    target = item.config.stash[TARGET]
    backend = target.backend
    target.pose.counts = not (mark and mark.args[0] in UNCOUNTED)
    if mark and mark.args[0] not in backend.capabilities:
        pytest.skip(f"the {backend.name} backend does not have {mark.args[0]}")
    if item.get_closest_marker("short_period") and target.feedback_s > LONGEST_PERIOD_S:
        pytest.skip(
            f"values every {1e3 * target.feedback_s:.0f} ms show no ramps, at most"
            f" {1e3 * LONGEST_PERIOD_S:g} ms apart they do"
        )
    if item.get_closest_marker("free_space") and Capability.CONTACTS in backend.capabilities:
        pytest.skip(f"the {backend.name} backend has contacts: links and objects are in the way")


def pytest_assertrepr_compare(op: str, left: object, right: object) -> list[str] | None:
    """Name the axes that differ."""
    return explain(op, left, right)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Say when a check has failed: of the time that its device has, from the start of the check."""
    report = yield
    if report.failed and report.when == "call":
        time_s = item.config.stash[TARGET].passed_s
        report.sections.append(("time", f"failed {time_s:.3f} s after the start of the check"))
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Fail a check during which a call of a driver was wrong, whatever the check expects."""
    result = yield
    calls = item.config.stash[TARGET].take_wrong_calls()
    assert not calls, f"{len(calls)} calls of drivers were wrong, the first: {calls[0]}"
    assert not item.config.stash[TARGET].stray, item.config.stash[TARGET].stray
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Return to the start pose after each check; replace the device after a failed one."""
    failed_before, target = item.session.testsfailed, item.config.stash[TARGET]
    result = yield
    if item.session.testsfailed > failed_before:
        target.clear()
    if ended := target.stray or target.pose.misplaced or target.return_to_start():
        item.session.shouldstop = f"{item.name}: {ended}"
    return result


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Shut down what the return to the start pose has opened after the last check."""
    target = session.config.stash[TARGET]
    target.clear()
    if target.pose.misplaced:
        session.exitstatus = MISPLACED


@pytest.fixture(scope="session")
def at_start(pytestconfig: pytest.Config) -> dict[str, object]:
    """The process as it was before the backend was imported."""
    return pytestconfig.stash[AT_START]


@pytest.fixture(scope="session")
def target(pytestconfig: pytest.Config) -> Iterator[KitTarget]:
    """Backend and robot, and the harness that most checks share."""
    target = pytestconfig.stash[TARGET]
    yield target
    target.clear()


@pytest.fixture(scope="session")
def thorough(pytestconfig: pytest.Config) -> bool:
    """The long form of checks whose faults only time reveals."""
    return bool(pytestconfig.getoption("--robotd-thorough"))


@pytest.fixture
def harness(target: KitTarget) -> Harness:
    """The shared harness: started, every axis enabled, at rest at its first position."""
    return target.shared()


@pytest.fixture
def make_harness(target: KitTarget) -> Iterator[MakeHarness]:
    """Function that builds further harnesses; the shared one is shut down first."""
    made: list[Harness] = []

    def make(**options: Any) -> Harness:
        target.clear()
        for harness in made:
            harness.stop()
        made.append(target.build(**options))
        return made[-1]

    yield make
    for harness in made:
        harness.stop()


@pytest.fixture
def unopened(make_harness: MakeHarness) -> Harness:
    """A harness of its own, whose device is not open."""
    return make_harness()


@pytest.fixture
def disabled(unopened: Harness) -> Harness:
    """A started harness of its own, with the servos off."""
    unopened.start(enable=False)
    return unopened


@pytest.fixture
def fresh(unopened: Harness) -> Harness:
    """A started harness of its own, servos on; may be left in any state."""
    unopened.start()
    return unopened


@pytest.fixture
def rescalable(fresh: Harness) -> Harness:
    """A harness of its own, away from zero, servos off, whose scale may change."""
    fresh.require_rescaling()
    fresh.move_all()
    fresh.rest()
    fresh.disable()
    return fresh


@pytest.fixture
def streamed(unopened: Harness) -> Harness:
    """A started harness of its own; a device that streams no positions skips the check."""
    if unopened.robot.axes.trajectories_on_device:
        pytest.skip("positions are not streamed: trajectories run on the device")
    unopened.start()
    return unopened


@pytest.fixture
def injector(harness: Harness) -> FaultInjector:
    """Fault injector of the shared harness; unsupported calls skip the check."""
    return harness.injector


@pytest.fixture
def joints(harness: Harness) -> list[int]:
    """Axes of the joints of the shared harness; a robot without joints skips the check."""
    if not harness.joints:
        pytest.skip(f"the robot {harness.robot.descriptor.name} has no joints")
    return harness.joints
