"""A slender vehicle that flies, once per module."""

from __future__ import annotations

from pathlib import Path

import pytest
from slender_vehicle import SlenderFiles, make_slender_files

from strainfmu.cosim.scenario import Scenario, load_scenario
from strainfmu.fmu.flight_package import export_flight


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> SlenderFiles:
    return make_slender_files(tmp_path_factory.mktemp("slender"))


@pytest.fixture(scope="module")
def scenario(files: SlenderFiles) -> Scenario:
    return load_scenario(files.scenario)


@pytest.fixture(scope="module")
def fmus(scenario: Scenario, files: SlenderFiles) -> dict[str, Path]:
    return export_flight(scenario, files.folder / "fmus")
