"""The mean of normalised innovations, which widens the discrepancy, against its closed form."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from pathlib import Path
from shutil import which

import numpy as np
import pytest

from strainfmu.estimator.policies import BAND, LARGEST_WIDENING, NARROW, WIDEN, WINDOW
from strainfmu.fmu.native.build import NATIVE

COMPILER = which("cc") or which("gcc") or which("clang")

pytestmark = [
    pytest.mark.skipif(COMPILER is None, reason="needs a C compiler"),
    pytest.mark.skipif(sys.platform == "win32", reason="compiles a shared library of Unix"),
]

SOURCE = """
#include "estimator/policies/consistency.h"

static Filter filter;

void note_all(const double *settings, const double *ratio, long count, double freedom, double *widening) {
    FilterMap *map = &filter.map;
    map->window = settings[0], map->band = settings[1], map->widen = settings[2];
    map->narrow = settings[3], map->largest_widening = settings[4];
    filter.next.mean = filter.next.widening = 1.0, filter.next.steps = 0.0;
    for (long k = 0; k < count; k++) {
        filter_note(&filter, ratio[k] * freedom, freedom);
        widening[k] = filter.next.widening;
    }
}
"""


def widening(folder: Path, ratio: np.ndarray, freedom: float) -> np.ndarray:
    """Return the widening after each normalised innovation, chi-square over its expectation."""
    source, path = folder / "note.c", folder / "note.so"
    source.write_text(SOURCE)
    flags = ("-std=c99", "-O1", "-shared", "-fPIC", f"-I{NATIVE}")
    of_law = NATIVE / "estimator" / "policies" / "consistency.c"
    subprocess.run([str(COMPILER), *flags, str(source), str(of_law), "-lm", "-o", str(path)], check=True)
    settings = np.array([WINDOW, BAND, WIDEN, NARROW, LARGEST_WIDENING], dtype=float)
    found, numbers = np.empty(len(ratio)), ctypes.POINTER(ctypes.c_double)
    note = ctypes.CDLL(str(path)).note_all
    note.argtypes, note.restype = (numbers, numbers, ctypes.c_long, ctypes.c_double, numbers), None
    pointers = (one.ctypes.data_as(numbers) for one in (settings, ratio, found))
    note(next(pointers), next(pointers), len(ratio), freedom, next(pointers))
    return found


@pytest.mark.parametrize("last", [150, 260, 400])
def test_it_widens_from_the_step_at_which_the_mean_leaves_its_band(tmp_path: Path, last: int) -> None:
    """A mean with weights that fall by 1 / w a step has the variance of a value over 2 w - 1.

    From 1, innovations of 1 + e bring it to 1 + e (1 - (1 - 1/w)^n) in n steps; e is such that it passes the band
    between two of them. Then ones of 0 bring it below 1, and the widening back.
    """
    freedom, w = 30.0, float(WINDOW)
    band = BAND * np.sqrt(2.0 / freedom / (2.0 * w - 1.0))
    excess = band / (1.0 - (1.0 - 1.0 / w) ** (last + 0.5))
    found = widening(tmp_path, np.append(np.full(last + 5, 1.0 + excess), np.zeros(400)), freedom)
    np.testing.assert_array_equal(found[:last], 1.0)
    np.testing.assert_allclose(found[last : last + 5], WIDEN ** np.arange(1, 6), rtol=1e-14)
    assert found[-1] == 1.0
    assert np.all(np.diff(found[last + 40 :]) <= 0.0)


def test_one_value_counts_only_in_part(tmp_path: Path) -> None:
    """However large it is, a single one brings the mean to the middle of the band."""
    ratio = np.ones(WINDOW + 50)
    ratio[WINDOW] = 1e9
    np.testing.assert_array_equal(widening(tmp_path, ratio, 30.0), 1.0)
