"""The small vehicle, and its undisturbed result."""

import pytest
from campaign_case import Undisturbed, undisturbed_campaign
from ogive import OGIVE

from builder.vehicle.file import Vehicle, load_vehicle


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    return load_vehicle(OGIVE)


@pytest.fixture(scope="session")
def undisturbed(vehicle: Vehicle, tmp_path_factory: pytest.TempPathFactory, compiled_solver: None) -> Undisturbed:
    return undisturbed_campaign(vehicle, tmp_path_factory.mktemp("undisturbed") / "snapshots.h5")
