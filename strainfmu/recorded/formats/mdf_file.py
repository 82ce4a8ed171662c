"""MF4 files opened with asammdf; a damaged one is one line and no more."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from strainfmu.errors import InputError, StrainfmuError


@contextmanager
def opened_mdf(path: Path) -> Iterator[Any]:
    """Open an MF4 file; yield asammdf's object.

    Raises
    ------
    InputError
        The file is missing or damaged.
    StrainfmuError
        asammdf is not installed.
    """
    try:
        from asammdf import MDF
    except ImportError as error:
        raise StrainfmuError("asammdf is not installed: pip install 'strainfmu[mf4]'") from error
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    file = _opened(MDF, path)
    if file is None:
        raise InputError(f"{path}: damaged, or not an MF4 file")
    with file:
        yield file


def _opened(mdf: Any, path: Path) -> Any:
    """Return asammdf's object, None if it cannot read the file.

    An object that was made in part fails in its destructor as well, which Python reports on standard error.
    """
    hook = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        try:
            return mdf(str(path))
        except Exception:  # asammdf raises whatever its parsers do
            pass
        gc.collect()
        return None
    finally:
        sys.unraisablehook = hook
