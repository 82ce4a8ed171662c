"""The name of the file of an FMU."""

from pathlib import Path

from strainfmu.errors import InputError


def check_fmu_path(path: Path) -> None:
    """Refuse to write an FMU under a name that no tool opens.

    Raises
    ------
    InputError
        The name does not end in ``.fmu``, or is the name of a folder.
    """
    if path.suffix != ".fmu":
        raise InputError(f"{path}: the name of an FMU must end in .fmu")
    if path.is_dir():
        raise InputError(f"{path}: is a folder, an FMU cannot be written there")
