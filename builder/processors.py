"""The processors that this process may use, threads of BLAS on them, and the memory it has taken."""

from __future__ import annotations

import os
import sys
from contextlib import AbstractContextManager
from typing import cast


def processors() -> int:
    """Return how many processors the process may run on: a container or a batch system may allow it few."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def peak_memory() -> int:
    """Return the maximum memory this process has held [byte]; 0 where the platform does not report it."""
    try:
        import resource
    except ImportError:  # Windows
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak if sys.platform == "darwin" else 1024 * peak)


def one_thread_of_blas() -> AbstractContextManager[object]:
    """Return a context without threads of BLAS and OpenMP: on small matrices they wait for each other.

    `strainfmu calibrate` takes a third less processor time so, and no more time by the clock.
    """
    from threadpoolctl import threadpool_limits

    return cast(AbstractContextManager[object], threadpool_limits(1))
