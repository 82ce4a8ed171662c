"""Synthetic artefacts and the FMUs made of them, once per run."""

from __future__ import annotations

import pytest
from synthetic_vehicle import SyntheticFiles, make_synthetic_files


@pytest.fixture(scope="session")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> SyntheticFiles:
    """Return the paths of synthetic maps, a flight model, a trajectory and FMUs of them."""
    return make_synthetic_files(tmp_path_factory.mktemp("synthetic"))
