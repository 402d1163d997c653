"""Debian's chromium, where it and playwright are there and CAPSULE_BROWSER is set."""

import os
import shutil
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, Final

import pytest

CHROMIUM: Final = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
NEEDS_BROWSER: Final = pytest.mark.skipif(
    CHROMIUM is None or find_spec("playwright") is None or "CAPSULE_BROWSER" not in os.environ,
    reason="needs playwright (extra `browser`), Debian's chromium and CAPSULE_BROWSER=1: minutes on a busy machine",
)
LONG_MS: Final = 40_000


def waited(page: Any, until: Callable[[], bool]) -> None:
    """Let the page go on until something is so."""
    for _ in range(LONG_MS // 50):
        if until():
            return
        page.wait_for_timeout(50)
    raise AssertionError("it never was so")
