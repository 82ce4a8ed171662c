"""The shipped vehicle on a coarse mesh, solved for what may differ as built, once per run."""

from __future__ import annotations

import pytest

from builder.calibration.as_built_structure import AsBuiltStructure, as_built_structure
from builder.structure.loads.loaded_structure import LoadProperties
from builder.vehicle.file import Vehicle

TITANIUM = LoadProperties(density=4430.0)
LAYOUT = "configuration_2"


@pytest.fixture(scope="session")
def as_built(vehicle: Vehicle) -> AsBuiltStructure:
    return as_built_structure(vehicle, LAYOUT, properties=TITANIUM, max_harmonic=12)
