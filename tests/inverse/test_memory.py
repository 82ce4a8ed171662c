"""What large maps need of memory and leave on disk, in processes whose address space is limited."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

SCRIPT = Path(__file__).parent / "memory_limited.py"
SUPPORT = str(Path(__file__).parents[1] / "support")
MIB = 2**20


def result(what: str, folder: Path) -> dict[str, Any]:
    """Return what the script finds with one thread, whose stacks and buffers count too."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    finished = subprocess.run(
        [sys.executable, str(SCRIPT), what, str(folder)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **threads, "PYTHONPATH": os.pathsep.join((SUPPORT, os.environ.get("PYTHONPATH", "")))},
    )
    assert finished.returncode == 0, finished.stderr
    found: dict[str, Any] = json.loads(finished.stdout)
    return found


@pytest.mark.slow
def test_maps_of_sixty_thousand_nodes_are_built_in_one_gibibyte(tmp_path: Path) -> None:
    """54 gauges, 243 snapshots, both cases: on disk under 40 MiB with the field, under 1 MiB without."""
    found = result("build", tmp_path)
    assert found["nodes"] >= 60_000
    for case in (1, 2):
        assert found[f"case {case}, bytes with field"] < 40 * MIB
        assert found[f"case {case}, bytes without field"] < MIB


def test_many_nodes_need_no_square(tmp_path: Path) -> None:
    """Both cases within 1 GiB, where one square would be 320 GB."""
    found = result("field", tmp_path)
    assert [shape[0] for shape in found["shapes"]] == [200_000] * 4


@pytest.fixture(autouse=True)
def _only_where_limits_exist() -> None:
    pytest.importorskip("resource")
