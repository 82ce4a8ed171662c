"""The map of a vehicle as built: its noise, and the error of its mesh."""

import numpy as np
import pytest

from builder.calibration.after_test.calibrated_map import calibrated_map, calibrated_vehicle
from builder.calibration.after_test.left_by_test import Remaining
from builder.campaign.snapshots import Snapshots
from builder.structure.as_built.as_built_structure import AsBuiltStructure
from builder.structure.as_built.as_built_vehicle import as_built_std, draw_as_built
from builder.vehicle.file import Vehicle


@pytest.mark.fast
def test_the_vehicle_keeps_what_no_ground_test_knows(vehicle: Vehicle) -> None:
    noise = calibrated_vehicle(vehicle).noise
    assert noise.gauge_gain_percent == noise.wall_thickness_percent == noise.layout_roll_deg == 0.0
    assert noise.apparent_strain_um_per_m == vehicle.noise.apparent_strain_um_per_m > 0.0
    assert noise.internal_pressure_percent == vehicle.noise.internal_pressure_percent > 0.0


def test_what_the_vehicle_differs_by_is_no_error_of_the_mesh(
    vehicle: Vehicle, as_built: AsBuiltStructure, snapshots: Snapshots
) -> None:
    """The mesh's error of a map is that of the drawing, however far the vehicle as built is from it."""
    std = as_built_std(vehicle.calibration, as_built.counts)
    nothing, sizes = np.zeros((len(std.vector),) * 2), []
    for built in (as_built.exactly_built(), draw_as_built(std, np.random.default_rng(5))):
        made = calibrated_map(vehicle, snapshots, as_built, Remaining(parameters=built, covariance=nothing))
        sizes.append(made.provenance["mesh_error"]["rms_sigma"])
    assert sizes[1] == pytest.approx(sizes[0], rel=0.15)  # in sigma, which follows the strains
