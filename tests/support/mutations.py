"""Damaged files: copies with a few random bytes changed, by fixed seeds; and a limit on how long one may take."""

import random
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

LIMIT = 10.0
"""Within this processor time [s] every damaged file ends with one line; a child process has a limit of its own."""


class TooLongError(BaseException):
    """The limit was reached; no handler of the program catches it."""


def mutated(content: bytes, seed: int, most: int = 8) -> bytes:
    """Return ``content`` with one to ``most`` of its bytes changed."""
    stream, changed = random.Random(seed), bytearray(content)
    for _ in range(stream.randint(1, most)):
        changed[stream.randrange(len(changed))] = stream.randrange(256)
    return bytes(changed)


@contextmanager
def limited(seconds: float = LIMIT) -> Iterator[None]:
    """Raise :class:`TooLongError` in what takes more processor time than ``seconds``, where there is a signal."""

    def end(_number: int, _frame: FrameType | None) -> None:
        raise TooLongError(f"not ended after {seconds:g} s")

    if not hasattr(signal, "setitimer"):
        yield
        return
    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def ends_in_one_line(run: Callable[..., tuple[int, str, str]], *arguments: object) -> int:
    """Run ``strainfmu`` with ``arguments``; return its exit code, 0 without an error and else with one line."""
    with limited():
        code, _, errors = run(*arguments)
    assert code in (0, 1, 2), errors
    assert "internal error" not in errors
    assert "file system" not in errors
    assert errors.count("\n") == (code > 0), errors
    return code
