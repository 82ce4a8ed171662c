"""The coarse vehicle with a map that knows of gauge noise alone."""

from __future__ import annotations

import pytest

from builder.campaign.snapshots import Snapshots
from builder.compare.flights import GAUGE_NOISE, with_errors
from builder.inverse.build import build_inverse_map
from builder.structure.fourier.model import StructuralModel
from builder.vehicle.file import Vehicle
from strainfmu.estimator.map.inverse_map import InverseMap


@pytest.fixture(scope="session")
def noise_only(vehicle: Vehicle) -> Vehicle:
    return with_errors(vehicle, GAUGE_NOISE, case=2)


@pytest.fixture(scope="session")
def gaussian(noise_only: Vehicle, snapshots: Snapshots, structure: StructuralModel) -> InverseMap:
    """The map of Case 2 for gauge noise."""
    return build_inverse_map(noise_only, snapshots, structure)
