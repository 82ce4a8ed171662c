"""The processors that this process may use."""

from __future__ import annotations

import os


def processors() -> int:
    """Return how many processors the process may run on: a container or a batch system may allow it few."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
