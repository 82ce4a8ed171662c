"""Files that a command writes are none of those that it reads: a slip of the hand must not cost a recording."""

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
    for name in (option for option in WRITTEN if option in paths):
        path, option = paths[name], f"--{name.replace('_', '-')}"
        _refuse_in_a_file(path, option)
        if any(second != name and _is_same_file(path, paths[second]) for second in paths):
            raise InputError(f"{path}: {option}: expected another file than those that are read")
        if any(second != name and path == paths.get(second) for second in WRITTEN):
            raise InputError(f"{path}: {option}: expected another file than the others that are written")


def _refuse_in_a_file(path: Path, option: str) -> None:
    """Refuse a path under a file, which no folder can be made in."""
    try:
        above = next(folder for folder in path.absolute().parents if folder.exists())
        is_folder = above.is_dir()
    except (OSError, ValueError):  # no name of a file at all: refused where it is written
        return
    if not is_folder:
        raise InputError(f"{path}: {option}: expected a path in folders, got the file {above} instead of one")


def _is_same_file(first: Path, second: Path) -> bool:
    try:
        return first.is_file() and second.exists() and first.samefile(second)
    except (OSError, ValueError):  # no name of a file at all
        return False
