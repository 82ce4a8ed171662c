"""Interface by which long work reports its progress, without knowing who listens."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

Progress = Callable[[int, int], None]
"""Takes how much of a stage is done, and how much there is."""

Note = Callable[[str], None]
"""Takes one line of information."""


class Reporter(Protocol):
    """Receives the progress of the stages of a pipeline."""

    @contextmanager
    def stage(self, title: str) -> Iterator[Progress]:
        """Begin a stage; the callback given takes (done, of)."""
        ...

    def note(self, text: str) -> None:
        """Take one line of information."""
        ...


class Silent:
    """Receives progress and shows nothing."""

    @contextmanager
    def stage(self, title: str) -> Iterator[Progress]:
        yield lambda done, total: None

    def note(self, text: str) -> None:
        return None
