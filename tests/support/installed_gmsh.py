"""Gmsh, where it is installed."""

from typing import Any

import pytest

from builder.structure.solid.gmsh_mesh import load_gmsh
from strainfmu.errors import StrainfmuError


def gmsh_or_skip() -> Any:
    """Return the module ``gmsh``; without it, or a library of the system that it needs, the test is skipped."""
    try:
        return load_gmsh()
    except StrainfmuError as error:
        pytest.skip(str(error))  # an extra, whose system libraries not every machine has; the error names them
