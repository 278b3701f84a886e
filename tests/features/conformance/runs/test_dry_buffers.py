"""The checks of buffers on a backend that holds setpoints ahead, and on one that does not."""

from __future__ import annotations

from tests.features.conformance.runs.conftest import InstallPlugin
from tests.features.conformance.runs.kit import run_kit

THEME = "test_dry_buffers.py"
DRY = f"{THEME}::test_buffers_that_ran_dry_in_motion_are_reported"
AGAIN = "test_again.py::test_dry_buffers_again"
NOT_DRY = {
    f"{THEME}::test_a_stream_in_time_is_not_reported_dry",
    f"{THEME}::test_a_stream_at_rest_is_not_reported_dry",
}


def test_a_backend_that_reports_dry_buffers_passes(install_plugin: InstallPlugin) -> None:
    outcome = run_kit(install_plugin("Buffered"), THEME, AGAIN)
    assert not outcome.failed
    assert {name.partition("[")[0] for name in outcome.passed} == {DRY, *NOT_DRY, AGAIN}


def test_a_backend_without_buffers_is_skipped() -> None:
    outcome = run_kit("sim", THEME)
    assert outcome.skipped == {DRY}
    assert outcome.passed == NOT_DRY
