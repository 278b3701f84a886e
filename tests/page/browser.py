"""Chromium for the tests of the page, and the mark of the tests that need it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, Page, ViewportSize, expect, sync_playwright

from robotd.page.page_server import BUNDLE_FOLDER

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next(filter(None, map(shutil.which, PROGRAMS)), None)
FLAGS = (
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
)
TIMEOUT_MS = 40_000
DESKTOP = ViewportSize(width=1280, height=800)
REASON = (
    "no Chromium (apt install chromium)"
    if CHROMIUM is None
    else "the page is not built (make page)"
)
needs_browser = pytest.mark.skipif(
    CHROMIUM is None or not (BUNDLE_FOLDER / "page.js").is_file(),
    reason=f"the page is not tested in a browser: {REASON}",
)


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser without a window, which draws with the processor."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM, args=FLAGS, timeout=TIMEOUT_MS
        )
        expect.set_options(timeout=TIMEOUT_MS)
        try:
            yield browser
        finally:
            browser.close()


def open_page(browser: Browser, errors: list[str]) -> Page:
    """A page that adds errors of scripts, and violations of the policy, to ``errors``."""
    page = browser.new_page(viewport=DESKTOP)
    page.set_default_timeout(TIMEOUT_MS)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda line: errors.append(line.text) if line.type == "error" else None)
    return page
