"""The solver where no machine code can be kept on disk."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.fast

NO_FOLDER = """
from numba.core import caching

class Nowhere:
    @classmethod
    def from_function(cls, *_):
        return None

for kind in (caching.CacheImpl, caching.CompileResultCacheImpl):
    kind._locator_classes = [Nowhere]
from builder.aero.euler.scheme.gas import prandtl_meyer_angle
print(round(float(prandtl_meyer_angle(2.0)), 6))
"""


def test_it_compiles_in_each_process_where_nothing_can_be_kept() -> None:
    finished = subprocess.run([sys.executable, "-c", NO_FOLDER], capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr
    # NACA Report 1135, table II: nu(2) = 26.38 deg.
    assert abs(float(finished.stdout) - 0.460414) < 1e-5
