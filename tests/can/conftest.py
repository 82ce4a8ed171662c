"""Modules of this folder by name, and the synthetic FMUs that the tests of co-simulation make."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "cosim"))

from synthetic_vehicle import SyntheticFiles, make_synthetic_files


@pytest.fixture(scope="session")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> SyntheticFiles:
    """Return the paths of synthetic maps, a flight model, a trajectory and FMUs of them."""
    return make_synthetic_files(tmp_path_factory.mktemp("synthetic"))
