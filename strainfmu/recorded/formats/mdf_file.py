"""MDF files read with asammdf: each channel has the times of its group; a damaged file is one line and no more."""

from __future__ import annotations

import gc
import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from strainfmu.errors import InputError, StrainfmuError
from strainfmu.recorded.columns.column_names import TIME_NAMES
from strainfmu.recorded.formats.channel_file import ChannelFile, Reading
from strainfmu.recorded.formats.first_look import limited_memory, reads_well
from strainfmu.recorded.formats.name_match import plain_name


def is_mdf(head: bytes) -> bool:
    """Return whether the first bytes of a file are an MDF file's, of any version."""
    return head.startswith((b"MDF ", b"UnFinMF "))


@contextmanager
def mdf_channels(path: Path, reading: Reading) -> Iterator[ChannelFile]:
    """Open an MDF file, whose channels have times themselves.

    Raises
    ------
    InputError
        As :func:`opened_mdf`, or the file holds frames of a bus alone.
    """
    with opened_mdf(path) as file:
        held = file.channels_db
        if "CAN_DataFrame" in held and all(name.startswith(("CAN_", "t", "T")) for name in held):
            raise InputError(f"{path}: holds CAN frames, and no channels of gauges: use 'strainfmu replay'")
        names = [name for name in held if plain_name(name) not in TIME_NAMES]

        @lru_cache(maxsize=1)  # values and times of a channel are asked for one after the other
        def signal(name: str) -> Any:
            if len(held[name]) > 1:
                raise InputError(f"{path}: expected one channel '{name}', got {len(held[name])}")
            return file.get(name)

        known = [name for name in names if reading.is_known(name.rpartition("/")[2]) or reading.is_known(name)]
        units = {name: file.get_channel_unit(name) for name in known if len(held[name]) == 1}
        yield ChannelFile(
            path=path,
            names=tuple(names),
            units={name: str(unit) for name, unit in units.items() if unit},
            values=lambda name: signal(name).samples,
            clock=lambda name: np.asarray(signal(name).timestamps, dtype=float),
        )


@contextmanager
def opened_mdf(path: Path) -> Iterator[Any]:
    """Open an MDF file; yield asammdf's object.

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
    file = None
    if reads_well(path, lambda: MDF(str(path)).close()):
        with limited_memory(path):
            file = _opened(MDF, path)
    if file is None:
        kind = "MF4" if path.suffix.lower() == ".mf4" else "MDF"
        raise InputError(f"{path}: damaged, or not an {kind} file")
    with file:
        yield file


def _opened(mdf: Any, path: Path) -> Any:
    """Return asammdf's object, None if it cannot read the file.

    An object that was made in part fails in its destructor as well, which Python reports on standard error, as
    asammdf's log does what is damaged.
    """
    hook, log = sys.unraisablehook, logging.getLogger("asammdf")
    sys.unraisablehook, log.disabled = lambda _: None, True
    try:
        try:
            return mdf(str(path))
        except Exception:  # asammdf raises whatever its parsers do
            pass
        gc.collect()
        return None
    finally:
        sys.unraisablehook, log.disabled = hook, False
