"""What the tests of the reproduction share: one quick run of the command, and small models."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def quick_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the folder of ``strainfmu reproduce --quick`` and what it printed."""
    folder = tmp_path_factory.mktemp("reproduce") / "quick"
    return folder, _run("reproduce", "--quick", "-o", str(folder))


@pytest.fixture(scope="session")
def command() -> Callable[..., str]:
    """Return a function that runs the installed command in a process of its own and gives what it printed."""
    return _run


def _run(*arguments: str) -> str:
    command = [sys.executable, "-c", "from strainfmu.cli.main import main; main()", *arguments]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr
    return finished.stdout
