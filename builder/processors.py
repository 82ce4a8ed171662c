"""The processors that this process may use, threads of BLAS on them, and its memory."""

import ctypes
import os
import sys
from contextlib import AbstractContextManager
from importlib import import_module
from typing import cast

MALLOC_OPTIONS = {-1: 2**31 - 1, -4: 0, -8: 1}
"""M_TRIM_THRESHOLD [byte], M_MMAP_MAX and M_ARENA_MAX of glibc's mallopt: all threads' arrays are in one heap."""


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

    `strainfmu calibrate` takes a third less processor time so, and no more time by the clock. Only libraries that
    are loaded are limited, so numpy's and scipy's are loaded first.
    """
    from threadpoolctl import threadpool_limits

    for name in ("numpy", "scipy.linalg"):
        import_module(name)
    return cast(AbstractContextManager[object], threadpool_limits(1))


def keep_freed_memory() -> None:
    """Let the process keep the memory of freed arrays for the next ones, where the C library is glibc.

    Returned to the system it is cleared page by page for every large array: of 4,096 gauges `strainfmu build`
    takes a sixth less processor time so, for a tenth more memory. It is for programs of the command line: it is of
    the process.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if os.name == "posix" else None
    if mallopt is not None:
        for option, size in MALLOC_OPTIONS.items():
            mallopt(option, size)
