"""Chromium for the tests of the page, the mark of the tests that need it, and pictures."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, ViewportSize, expect, sync_playwright

from robotd_page.page_server import BUNDLE_FOLDER

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next(filter(None, map(shutil.which, PROGRAMS)), None)
DRAWING = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NOT_DRAWING = ("--disable-gpu", "--disable-software-rasterizer")
FLAGS = (
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--no-first-run",
)
TIMEOUT_MS = 40_000
DESKTOP = ViewportSize(width=1280, height=800)
PHONE = ViewportSize(width=360, height=740)
SCREENSHOT = Path(__file__).parents[4] / "build" / "page"
NO_WEBGL = """(() => {
  const own = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind.startsWith("webgl") ? null : own.call(this, kind, ...rest);
  };
})()"""  # several drawings by the processor would take a minute
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
def chromium(*, draws: bool = True) -> Iterator[Browser]:
    """A browser without a window, which draws with the processor, or has no WebGL and is quick."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=[*FLAGS, *(DRAWING if draws else NOT_DRAWING)],
            timeout=TIMEOUT_MS,
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


def keep_screenshot(page: Page, name: str, *, full_page: bool = True) -> None:
    """Keep a picture for the documentation in build/page."""
    SCREENSHOT.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SCREENSHOT / f"{name}.png", full_page=full_page)


def has_sideways_scrolling(page: Page) -> bool:
    width, available = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    return bool(width > available)


COLORS = """pairs => {
  const style = getComputedStyle(document.documentElement);
  const color = name => {
    const element = document.createElement("i");
    element.style.color = style.getPropertyValue(name);
    document.body.append(element);
    const numbers = getComputedStyle(element).color.match(/\\d+/g).map(Number);
    element.remove();
    return numbers;
  };
  return pairs.map(([front, back]) => [color(front), color(back)]);
}"""


def contrasts(page: Page, scheme: Any, pairs: Sequence[tuple[str, str]]) -> list[float]:
    """Contrast of pairs of colours of the style sheet, by WCAG 2.2; the scheme is light or dark."""
    page.emulate_media(color_scheme=scheme)
    colors = page.evaluate(COLORS, [*map(list, pairs)])
    page.emulate_media(color_scheme="light")
    found = []
    for both in colors:
        lighter, darker = sorted(map(_luminance, both), reverse=True)
        found.append((lighter + 0.05) / (darker + 0.05))
    return found


def _luminance(color: list[float]) -> float:
    share = np.array(color) / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])
