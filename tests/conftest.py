"""Hypothesis profiles: ``ci`` is reproducible and quick, ``deep`` (HYPOTHESIS_PROFILE=deep) hunts; Ctrl-C is heard.

One browser for all tests that look at a page.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

from tests.chromium import Tab, browser

settings.register_profile(
    "ci", max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("deep", max_examples=1000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

# Started in the background of a script, a process ignores Ctrl-C, and so would those that tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def tab() -> Iterator[Tab]:
    """A tab of one browser; starting one takes seconds. Each test says its size and its page."""
    with browser() as tab:
        yield tab
