"""Rows turned until they are orthogonal: singular values to full accuracy, of any rank, in any order of size."""

import ctypes
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from c_host import program_by_zig
from raw_fmu import this_platform

from strainfmu.fmu.native.build import NATIVE

NUMERICS = NATIVE / "estimator" / "numerics"
WIDE = this_platform() == "linux64" and "avx2" in Path("/proc/cpuinfo").read_text(encoding="utf-8")

pytestmark = [
    pytest.mark.skipif(find_spec("ziglang") is None, reason="needs zig: pip install 'strainfmu[native]'"),
    pytest.mark.skipif(this_platform() != "linux64", reason="compiles for x86-64 and Linux"),
]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    path = tmp_path_factory.mktemp("rows") / "rows.so"
    program_by_zig("x86_64-linux-gnu.2.17", path, [NUMERICS / "triangles.c"], "-shared", "-fPIC")
    found = ctypes.CDLL(str(path))
    found.orthogonal_rows_doubles.restype = ctypes.c_size_t
    found.orthogonal_rows_doubles.argtypes = (ctypes.c_size_t,) * 2
    found.orthogonal_rows.restype = ctypes.c_int
    found.orthogonal_rows.argtypes = (
        *(ctypes.c_int, *(ctypes.c_size_t,) * 3),
        *((ctypes.c_void_p,) * 3),
        ctypes.c_size_t,
    )
    return found


class Turned(ctypes.Structure):
    _fields_ = (
        ("stage", ctypes.c_int),
        ("row", ctypes.c_size_t),
        ("round", ctypes.c_int),
        ("largest", ctypes.c_double),
    )


AT_ONCE = 2 ** (8 * ctypes.sizeof(ctypes.c_size_t)) - 1


def turned(
    library: ctypes.CDLL, matrix: np.ndarray, wide: bool, work: int = AT_ONCE
) -> tuple[np.ndarray, np.ndarray]:
    """The rows of ``matrix`` turned, in parts, and the turns: the rows of the unit matrix stand behind."""
    count, n = matrix.shape
    rows = np.ascontiguousarray(np.hstack([matrix, np.eye(count)]))
    scratch = np.empty(library.orthogonal_rows_doubles(count, n + count))
    done, parts = Turned(), 1
    sizes = (wide, count, n, n + count)
    while not library.orthogonal_rows(*sizes, rows.ctypes.data, scratch.ctypes.data, ctypes.byref(done), work):
        parts += 1
    assert (parts > 1) == (work < AT_ONCE)
    return rows[:, :n], rows[:, n:]


def case(name: str) -> np.ndarray:
    random = np.random.default_rng(3)
    left, _, right = np.linalg.svd(random.normal(size=(30, 37)), full_matrices=False)
    size = {
        "random": random.uniform(0.1, 10.0, size=30),
        "graded": np.logspace(6, -8, 30),
        "one size": np.full(30, 2.0),
        "few sizes": np.repeat([5.0, 1e-3, 1.0], 10),
        "rank 4": np.r_[[7.0, 7.0, 0.3, 1e-6], np.zeros(26)],
        "nothing": np.zeros(30),
    }
    return (left * size[name]) @ right


@pytest.mark.parametrize("name", ["random", "graded", "one size", "few sizes", "rank 4", "nothing"])
def test_rows_are_orthogonal(library: ctypes.CDLL, name: str) -> None:
    matrix = case(name)
    rows, turns = turned(library, matrix, wide=WIDE)
    size = np.linalg.norm(rows, axis=1)
    expected = np.linalg.svd(matrix, compute_uv=False)
    largest = max(expected[0], 1e-300)
    assert np.abs(turns @ turns.T - np.eye(30)).max() < 1e-13
    assert np.abs(turns @ matrix - rows).max() <= 1e-13 * largest
    assert np.abs(np.sort(size)[::-1] - expected).max() <= 1e-13 * largest
    some = size > 1e-14 * largest  # what is smaller is rounding
    unit = rows[some] / size[some, None]
    assert np.abs(unit @ unit.T - np.eye(some.sum())).max(initial=0.0) < 1e-14
    for work in (AT_ONCE, 20_000, 1):
        alike = turned(library, matrix, wide=False, work=work)
        assert rows.tobytes() + turns.tobytes() == alike[0].tobytes() + alike[1].tobytes()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_rows(library: ctypes.CDLL, count: int) -> None:
    matrix = np.random.default_rng(count).normal(size=(count, 5))
    rows, turns = turned(library, matrix, wide=WIDE)
    products = rows @ rows.T
    assert np.abs(products - np.diag(np.diag(products))).max(initial=0.0) < 1e-14
    assert np.allclose(turns @ matrix, rows, rtol=0, atol=1e-14)
