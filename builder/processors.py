"""The processors that this process may use, and threads of BLAS on them."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from typing import cast


def processors() -> int:
    """Return how many processors the process may run on: a container or a batch system may allow it few."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def one_thread_of_blas() -> AbstractContextManager[object]:
    """Return a context without threads of BLAS and OpenMP: on small matrices they wait for each other.

    `strainfmu calibrate` takes a third less processor time so, and no more time by the clock.
    """
    from threadpoolctl import threadpool_limits

    return cast(AbstractContextManager[object], threadpool_limits(1))
