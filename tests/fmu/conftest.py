"""The FMUs of the synthetic maps, once per run."""

from __future__ import annotations

from pathlib import Path

import pytest
from fmu_host import OPTIONS, SCALARS
from synthetic_vehicle import SyntheticFiles

from strainfmu.fmu.export import export_estimator


@pytest.fixture(scope="session")
def fmus(synthetic: SyntheticFiles, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return paths of estimator FMUs: of map 1 by kind and of scalars, ``kind_2`` of map 2; and of the plant."""
    folder = tmp_path_factory.mktemp("kinds")
    paths = {"plant": synthetic.plant}
    for kind, options in OPTIONS.items():
        for name, source in ((kind, synthetic.map_1), (f"{kind}_2", synthetic.map_2)):
            paths[name] = folder / f"{name}.fmu"
            export_estimator(source, paths[name], options)
    paths["scalars"] = folder / "scalars.fmu"
    export_estimator(synthetic.map_1, paths["scalars"], SCALARS)
    return paths
