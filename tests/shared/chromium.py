"""Debian's chromium for tests that open a page in it; they are skipped where it is not."""

import shutil

import pytest

CHROMIUM = shutil.which("chromium")
MARKS = [
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine (Debian's package of that name)"),
    pytest.mark.slow,
]
# Nothing but the page itself: no updates, no first-run pages, no sandbox (absent in containers).
FLAGS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync"
).split()
