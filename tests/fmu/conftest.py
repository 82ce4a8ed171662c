"""Synthetic artefacts and the FMUs made of them, once per run."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

# The synthetic vehicle serves the tests of FMUs and of co-simulation alike.
sys.path.insert(0, str(Path(__file__).parents[1] / "cosim"))

from synthetic_vehicle import SyntheticFiles, make_synthetic_files


@pytest.fixture(scope="session")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> SyntheticFiles:
    """Return the paths of synthetic maps, a flight model, a trajectory and FMUs of them."""
    return make_synthetic_files(tmp_path_factory.mktemp("synthetic"))
