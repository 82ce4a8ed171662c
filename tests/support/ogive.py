"""The coarse vehicle of many tests: an ogive that goes the whole way in seconds."""

import shutil
from pathlib import Path

OGIVE = Path(__file__).parents[1] / "acceptance" / "ogive" / "ogive.toml"
"""18 conditions, 15 distinct flows on 12 x 18 cells."""


def copied_ogive(folder: Path) -> Path:
    """Copy its file and the tables beside it to ``folder``, a new one; return the path of the file."""
    shutil.copytree(OGIVE.parent, folder)
    return folder / OGIVE.name
