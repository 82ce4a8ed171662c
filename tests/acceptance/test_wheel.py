"""A wheel in a clean environment: the run-time alone, estimating by the library that the wheel brings."""

import subprocess
import sys
import venv
from pathlib import Path

import pytest
from scaled_maps import NOMINAL, whole_scaled_map

from strainfmu.estimator.estimator import Estimator
from strainfmu.estimator.map.inverse_map import save_inverse_map

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]

PROGRAM = """
import sys, strainfmu
from strainfmu.estimator.core import library, library_file
estimator = strainfmu.load(sys.argv[1])
found = estimator.estimate(estimator.inverse_map.mean_strain, float(sys.argv[2]))
print(type(estimator.core).__name__, library()._name == str(library_file()), library_file())
print(found.coefficients.tolist())
"""


def test_a_wheel_uses_its_library(tmp_path: Path) -> None:
    if not (ROOT / "pyproject.toml").exists():
        pytest.skip("installed without its sources")
    made = whole_scaled_map(1, 3)
    save_inverse_map(made, tmp_path / "map.h5")
    run([sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(tmp_path), str(ROOT)])
    (wheel,) = tmp_path.glob("*.whl")
    venv.create(tmp_path / "clean", with_pip=True)
    python = next(path for path in (tmp_path / "clean").glob("*/python*") if path.stem == "python")
    run([str(python), "-m", "pip", "install", "-q", str(wheel)])
    said = run([str(python), "-c", PROGRAM, str(tmp_path / "map.h5"), str(NOMINAL)], cwd=tmp_path)
    first, second = said.splitlines()
    assert first.startswith("Core True ")
    assert str(tmp_path / "clean") in first
    assert second == str(Estimator(made).estimate(made.mean_strain, NOMINAL).coefficients.tolist())


def run(command: list[str], cwd: Path | None = None) -> str:
    """Return what ``command`` prints; it must succeed."""
    finished = subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd)
    assert finished.returncode == 0, finished.stderr
    return finished.stdout
