"""A monitor on loopback."""

from collections.abc import Iterator

import pytest

from strainfmu.monitor.server import Monitor


@pytest.fixture
def monitor() -> Iterator[Monitor]:
    running = Monitor(("127.0.0.1", 0), ("127.0.0.1", 0))
    yield running
    running.close()
