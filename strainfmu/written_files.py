"""Files that a command writes are none of those that it reads: a slip of the hand must not cost a recording."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from strainfmu.errors import InputError

WRITTEN = ("output", "known_output", "field", "export_influence", "record", "report", "curves")
"""Parameters that name a file to write; ``tare.output`` of a bus file may be the file of ``zeros.file``."""


def check_outputs(parameters: Mapping[str, Any]) -> None:
    """Refuse a file to write that another parameter names too.

    Raises
    ------
    InputError
        There is one, folders apart; or what is written would lie in a file.
    """
    paths = {name: Path(value) for name, value in parameters.items() if isinstance(value, str | Path) and value}
    for name in (one for one in WRITTEN if one in paths):
        path, option = paths[name], f"--{name.replace('_', '-')}"
        _refuse_in_a_file(path, option)
        if any(other != name and _is_same_file(path, paths[other]) for other in paths):
            raise InputError(f"{path}: {option}: expected another file than those that are read")
        if any(other != name and path == paths.get(other) for other in WRITTEN):
            raise InputError(f"{path}: {option}: expected another file than the others that are written")


def _refuse_in_a_file(path: Path, option: str) -> None:
    """Refuse a path under a file, which no folder can be made in."""
    try:
        above = next(one for one in path.absolute().parents if one.exists())
        is_folder = above.is_dir()
    except (OSError, ValueError):  # no name of a file at all: refused where it is written
        return
    if not is_folder:
        raise InputError(f"{path}: {option}: expected a path in folders, got the file {above} instead of one")


def _is_same_file(one: Path, other: Path) -> bool:
    try:
        return one.is_file() and other.exists() and one.samefile(other)
    except (OSError, ValueError):  # no name of a file at all
        return False
