"""Content of an FMU file: its description, this project's own entries, its files."""

import json
import zipfile
from pathlib import Path
from typing import Any

from strainfmu.cosim.systems.instance import described
from strainfmu.errors import InputError
from strainfmu.interface.contents import CONTENTS


def read_fmu(path: Path) -> tuple[Any, dict[str, Any], dict[str, int]]:
    """Return fmpy's ModelDescription, this project's own entries (none in other FMUs) and size by file.

    Raises
    ------
    InputError
        The FMU is missing, damaged or larger than FMUs are.
    """
    description = described(path)
    try:
        with zipfile.ZipFile(path) as archive:
            files = {item.filename: item.file_size for item in archive.infolist() if not item.is_dir()}
            contents = json.loads(archive.read(CONTENTS)) if CONTENTS in files else {}
    except Exception as error:  # zipfile raises whatever its readers do
        raise InputError(f"{path}: damaged, or not an FMU") from error
    if not isinstance(contents, dict) or not isinstance(contents.get("validity", {}), dict):
        raise InputError(f"{path}: {CONTENTS}: damaged, expected the entries of an FMU of this program")
    return description, contents, files
