"""Memory of a process that calibrates, and its threads of BLAS."""

import json
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


def test_libraries_that_load_later_have_one_thread_of_blas() -> None:
    """numpy and scipy bring a BLAS each, which a fresh process has not loaded."""
    program = (
        "from builder.processors import one_thread_of_blas\n"
        "with one_thread_of_blas():\n"
        "    import numpy, scipy.linalg\n"
        "    from threadpoolctl import threadpool_info\n"
        "    print([pool['num_threads'] for pool in threadpool_info() if pool['user_api'] == 'blas'])"
    )
    printed = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout
    threads = json.loads(printed)
    assert len(threads) >= 1
    assert set(threads) == {1}
