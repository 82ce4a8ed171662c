"""Files that are written in parts and appear when they are complete."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol, TypeVar

from strainfmu.errors import StrainfmuError


class PartWriter(Protocol):
    """An open file that is written in parts."""

    def finish(self) -> None:
        """Write what is left and bring all to the disk; raises OSError if it cannot."""
        ...

    def close(self) -> None:
        """Close the file, in order or not."""
        ...


Writer = TypeVar("Writer", bound=PartWriter)


@contextmanager
def whole_file(path: Path, opened: Callable[[Path], Writer]) -> Iterator[Writer]:
    """Write ``path`` by what ``opened`` returns of a temporary file next to it.

    The file is finished and renamed into place at the end, and removed if there was an error.

    Raises
    ------
    StrainfmuError
        It cannot be written; an earlier file remains unchanged.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            writer = opened(temporary)
        try:
            yield writer
            with writing(path):
                writer.finish()
        finally:
            writer.close()
        with writing(path):
            os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an error of the operating system into one line that names ``path``."""
    try:
        yield
    except OSError as error:
        raise StrainfmuError(f"{path}: could not be written: {error.strerror or error}") from error
