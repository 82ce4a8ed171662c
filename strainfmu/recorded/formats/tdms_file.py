"""TDMS files opened with npTDMS; a damaged one is one line and no more."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from strainfmu.errors import InputError, StrainfmuError


@contextmanager
def opened_tdms(path: Path) -> Iterator[Any]:
    """Open a TDMS file; yield npTDMS's object.

    Raises
    ------
    InputError
        The file is missing or damaged.
    StrainfmuError
        npTDMS is not installed.
    """
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise StrainfmuError("npTDMS is not installed: pip install 'strainfmu[tdms]'") from error
    try:
        file = TdmsFile.open(str(path))
    except Exception as error:  # npTDMS raises whatever its parsers do
        raise InputError(f"{path}: damaged, or not a TDMS file") from error
    with file:
        yield file
