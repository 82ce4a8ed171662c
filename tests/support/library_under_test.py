"""Plug-in of pytest: Python takes the compiled library that the environment names."""

import os
from pathlib import Path

from strainfmu.estimator import core

VARIABLE = "STRAINFMU_TEST_LIBRARY"


def _library_file() -> Path:
    return Path(os.environ[VARIABLE])


if VARIABLE in os.environ:
    core.library_file = _library_file
