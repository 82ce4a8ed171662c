"""Results that take long to make: one process of a run makes them, all of them read them."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from filelock import FileLock


def folder_of_run(factory: pytest.TempPathFactory) -> Path:
    """Return the temporary folder that all processes of this run have in common."""
    folder = factory.getbasetemp()
    # Of several processes, each has its folder there.
    return folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder


def once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """Return the folder ``name`` of this run, filled by ``make(folder)`` in the first process that needs it.

    Other processes that need it meanwhile wait. Where ``make`` fails, the next process tries again. Nobody may
    change what lies in the folder.
    """
    run = folder_of_run(factory)
    folder, finished = run / name, run / f"{name}.finished"
    with FileLock(run / f"{name}.lock"):
        if not finished.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            make(folder)
            finished.touch()
    return folder
