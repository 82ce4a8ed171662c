"""Elementary functions of the core against numpy: every quarter of the circle, and what is out of range."""

import ctypes
import subprocess
import sys
from shutil import which

import numpy as np
import pytest

from strainfmu.fmu.native.build import NATIVE

COMPILER = which("cc") or which("gcc") or which("clang")

pytestmark = [
    pytest.mark.skipif(COMPILER is None, reason="needs a C compiler"),
    pytest.mark.skipif(sys.platform == "win32", reason="compiles a shared library of Unix"),
]

QUARTERS = 0.5 * np.pi * np.arange(-9, 10)
ANGLES = np.concatenate([QUARTERS + off for off in (-0.7, -1e-3, 0.0, 1e-3, 0.7)] + [np.array([99_999.0])])


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    path = tmp_path_factory.mktemp("elementary") / "elementary.so"
    flags = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC", f"-I{NATIVE}")
    source = NATIVE / "core" / "elementary.c"
    subprocess.run([str(COMPILER), *flags, str(source), "-lm", "-o", str(path)], check=True)
    found = ctypes.CDLL(str(path))
    found.sine_cosine.argtypes = (ctypes.c_double, *(ctypes.POINTER(ctypes.c_double),) * 2)
    found.sine_cosine.restype = None
    for name, count in (("angle_of", 2), ("exponential", 1), ("logarithm", 1)):
        getattr(found, name).argtypes = (ctypes.c_double,) * count
        getattr(found, name).restype = ctypes.c_double
    return found


def sine_cosine(library: ctypes.CDLL, angle: float) -> tuple[float, float]:
    sine, cosine = ctypes.c_double(), ctypes.c_double()
    library.sine_cosine(angle, sine, cosine)
    return sine.value, cosine.value


def test_sine_and_cosine_in_every_quarter(library: ctypes.CDLL) -> None:
    found = np.array([sine_cosine(library, angle) for angle in ANGLES])
    np.testing.assert_allclose(found, np.column_stack([np.sin(ANGLES), np.cos(ANGLES)]), atol=2e-11)
    np.testing.assert_allclose(found[:-1], np.column_stack([np.sin(ANGLES), np.cos(ANGLES)])[:-1], atol=1e-15)
    assert np.isnan([sine_cosine(library, angle) for angle in (1e5, -1e5, np.nan, np.inf)]).all()


def test_angle_exponential_and_logarithm(library: ctypes.CDLL) -> None:
    angle = np.linspace(0.0, np.pi, 41)
    found = [library.angle_of(3.0 * np.sin(one), 3.0 * np.cos(one)) for one in angle]
    np.testing.assert_allclose(found, angle, atol=1e-15)
    power = np.linspace(-650.0, 650.0, 53)
    np.testing.assert_allclose([library.exponential(one) for one in power], np.exp(power), rtol=1e-14)
    positive = 10.0 ** np.linspace(-300.0, 300.0, 61)
    np.testing.assert_allclose(
        [library.logarithm(one) for one in positive], np.log(positive), rtol=1e-15, atol=1e-15
    )
    assert np.isnan([library.exponential(one) for one in (701.0, -701.0, np.nan)]).all()
