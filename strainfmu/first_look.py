"""A first look at a file in a child process, which ends where a damaged file would hang, crash or fill the memory.

Parsers of binary formats loop, crash or allocate without limit on some damaged files. What the child survives is
then read in this process, or comes from the child item by item; systems that do not fork go without.
"""

import faulthandler
import os
import pickle
import select
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from math import ceil
from pathlib import Path
from time import process_time
from typing import Any, NoReturn

PATIENCE = 5.0
"""Processor time that the first look at a file may take [s], and a second more for each 20 MB of it."""

_PER_BYTE = 1.0 / 20e6

_LONGEST_WAIT = 20.0
"""Longest time in units of the processor time: a busy host is slow, and a child process may wait for ever."""

MEMORY = 1 << 30
"""Memory that the first look may take in addition to the size of the file [bytes]."""


def reads_well(path: Path, read: Callable[[], object], patience: float = PATIENCE) -> bool:
    """Return whether ``read``, called in a child process, returns in time, within its memory and without an error.

    Parameters
    ----------
    path : of the file that ``read`` reads; its size extends both limits.
    patience : processor time for a small file [s].
    """
    if not hasattr(os, "fork"):
        return True
    size = path.stat().st_size
    patience += _PER_BYTE * size
    ended, end = os.pipe()
    child = os.fork()
    if child == 0:
        _limit_time(patience)
        _leave_after(read, MEMORY + 2 * size)
    os.close(end)
    try:
        in_time, _, _ = select.select([ended], [], [], _LONGEST_WAIT * patience)
        if not in_time:
            os.kill(child, signal.SIGKILL)
    finally:
        os.close(ended)
        _, status = os.waitpid(child, 0)
    return status == 0


_BATCH = 256
"""Items that come from a child process at once."""


def read_apart(path: Path, items: Callable[[], Iterable[Any]], patience: float = PATIENCE) -> Iterator[Any]:
    """Yield what ``items`` yields in a child process, which nothing in this process can crash or hang with.

    Parameters
    ----------
    path : of the file that is read; its size extends both limits.
    patience : processor time for the next items of a small file [s].

    Raises
    ------
    ValueError
        The child did not reach the end: in time, within its memory, without an error.
    """
    if not hasattr(os, "fork"):
        yield from items()
        return
    size = path.stat().st_size
    patience += _PER_BYTE * size
    source, target = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(source)
        _leave_after(lambda: _write_items(items, target, patience), MEMORY + 2 * size)
    os.close(target)
    try:
        with os.fdopen(source, "rb") as stream:
            while True:
                in_time, _, _ = select.select([source], [], [], _LONGEST_WAIT * patience)
                batch = _next_batch(stream) if in_time else None
                if batch is None:
                    raise ValueError("its reader did not reach the end")
                if not batch:
                    return
                yield from batch
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def _write_items(items: Callable[[], Iterable[Any]], target: int, patience: float) -> None:
    """Write all items to a pipe in batches, each within ``patience`` [s] of processor time, then an empty one."""
    iterator = iter(items())
    with os.fdopen(target, "wb") as stream:
        batch = None
        while batch is None or batch:
            _limit_time(patience)
            batch = list(islice(iterator, _BATCH))
            content = pickle.dumps(batch)
            stream.write(len(content).to_bytes(8, "little") + content)
            stream.flush()


def _next_batch(stream: Any) -> list[Any] | None:
    """Return the next batch of a child of this process; None if it has ended without one."""
    size = stream.read(8)
    content = stream.read(int.from_bytes(size, "little")) if len(size) == 8 else b""
    return pickle.loads(content) if content else None


def _leave_after(read: Callable[[], object], memory: int) -> NoReturn:
    """Call ``read``, silently, and end this process with exit code 0, or 1 if that fails."""
    code = 1
    try:
        silent = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silent, 1)
        os.dup2(silent, 2)
        faulthandler.disable()  # it may write to a copy of standard error
        _limit_memory(memory)
        read()
        code = 0
    finally:
        os._exit(code)


def _limit_time(additional: float) -> None:
    """Have the system end this process once it has used ``additional`` processor time [s], in whole seconds."""
    import resource  # POSIX alone

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
    limit = ceil(process_time() + additional)
    resource.setrlimit(resource.RLIMIT_CPU, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))


@contextmanager
def limited_memory(path: Path) -> Iterator[None]:
    """Limit this process meanwhile to the memory that a first look at ``path`` may take.

    A parser that was refused memory in the child may have read on in another way; it is refused here too.
    """
    before = _limit_memory(MEMORY + 2 * path.stat().st_size) if hasattr(os, "fork") else None
    try:
        yield
    finally:
        if before is not None:
            import resource

            resource.setrlimit(resource.RLIMIT_AS, before)


def _limit_memory(additional: int) -> tuple[int, int] | None:
    """Limit the address space to what it is now and ``additional`` bytes, where the system states what it is.

    Return the limits before, None where it does not.
    """
    import resource  # POSIX alone

    try:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except (OSError, ValueError):
        return None
    before = resource.getrlimit(resource.RLIMIT_AS)
    limit = pages * resource.getpagesize() + additional
    if before[1] != resource.RLIM_INFINITY:
        limit = min(limit, before[1])
    resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
    return before
