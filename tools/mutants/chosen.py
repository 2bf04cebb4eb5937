"""A plugin of pytest that runs chosen tests in a chosen order, and ends a test that computes for far too long."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

CHOICE = "MUTANTS_CHOICE"
"""The file that says which tests run: their names with the seconds of processor time that each may take, in order."""

MEMORY = 16 << 30
"""A mutant that asks for ever more fails, instead of the machine."""


class Choice:
    """Tests in their order, each with its limit."""

    def __init__(self, limits: dict[str, float]) -> None:
        self.limits = limits

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        order = {name: i for i, name in enumerate(self.limits)}
        items[:] = sorted((item for item in items if item.nodeid in order), key=lambda item: order[item.nodeid])

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        signal.setitimer(signal.ITIMER_PROF, self.limits[item.nodeid])  # SIGPROF, which nothing here expects, ends it
        try:
            return (yield)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)


def pytest_configure(config: pytest.Config) -> None:
    import resource  # which not every system has

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    limits = json.loads(Path(os.environ[CHOICE]).read_text())
    config.pluginmanager.register(Choice(limits))
