"""Memory of a process that calibrates."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import numpy as np
from builder.processors import keep_freed_memory

def resident():
    with open("/proc/self/statm") as file:
        return 4096 * int(file.read().split()[1])

{call}
arrays = [np.ones(2_000_000) for _ in range(20)]
full = resident()
del arrays
print(resident() / full)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc of Linux, glibc")
def test_freed_arrays_stay_with_the_process() -> None:
    def share(call: str) -> float:
        program = [sys.executable, "-c", PROGRAM.format(call=call)]
        return float(subprocess.run(program, check=True, capture_output=True, text=True).stdout)

    assert share("keep_freed_memory()") > 0.95 > 0.5 > share("")
