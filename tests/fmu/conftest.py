"""Synthetic artefacts and the FMUs made of them, once per run."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

# The synthetic vehicle serves the tests of FMUs and of co-simulation alike.
sys.path.insert(0, str(Path(__file__).parents[1] / "cosim"))

from fmu_host import OPTIONS
from synthetic_vehicle import SyntheticFiles, make_synthetic_files

from strainfmu.fmu.export import export_estimator


@pytest.fixture(scope="session")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> SyntheticFiles:
    """Return the paths of synthetic maps, a flight model, a trajectory and FMUs of them."""
    return make_synthetic_files(tmp_path_factory.mktemp("synthetic"))


@pytest.fixture(scope="session")
def fmus(synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the paths of estimator FMUs of map 1 by kind, ``kind_2`` of map 2, and of the plant."""
    folder = tmp_path_factory.mktemp("kinds")
    paths = {"plant": synthetic.plant}
    for kind, options in OPTIONS.items():
        for name, source in ((kind, synthetic.map_1), (f"{kind}_2", synthetic.map_2)):
            paths[name] = folder / f"{name}.fmu"
            export_estimator(source, paths[name], options)
    return paths
