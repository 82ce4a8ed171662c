"""What the test left in the noise of a map: the mean of J C J' over pressure fields."""

from __future__ import annotations

import numpy as np
import pytest

from builder.calibration.as_built_parameters import drawn, prior_std
from builder.calibration.as_built_structure import AsBuiltStructure
from builder.calibration.calibrated_map import Remaining, calibrated_map, calibrated_vehicle, hardware_covariance
from builder.campaign.snapshots import Snapshots
from builder.vehicle.file import Vehicle


@pytest.mark.fast
def test_remaining_error_is_that_of_vehicles_drawn(vehicle: Vehicle, as_built: AsBuiltStructure) -> None:
    std = prior_std(vehicle.calibration, as_built.n_gauges, as_built.n_regions).vector * 0.02
    random = np.random.default_rng(8)
    n, n_g = len(std), as_built.n_gauges
    # Correlated, as after a test: the first gains go against the common one.
    root = np.diag(std)
    root[:n_g, 0] -= 0.5 * std[:n_g]
    nominal = as_built.exactly_built()
    pressure = 1e4 * random.standard_normal((as_built.surface.n_nodes, 2))
    stated = hardware_covariance(as_built, Remaining(parameters=nominal, covariance=root @ root.T), pressure)
    plain = as_built.strain_operator(nominal) @ pressure
    draws = [nominal.of_vector(root @ random.standard_normal(n)) for _ in range(400)]
    changes = np.array([as_built.strain_operator(one) @ pressure - plain for one in draws])
    sampled = np.einsum("dgk,dhk->gh", changes, changes) / len(draws)
    scale = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
    assert np.abs(sampled - stated).max() < 0.3 * scale.max()
    np.testing.assert_allclose(np.diag(sampled) / np.diag(stated), 1.0, atol=0.3)


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
    std = prior_std(vehicle.calibration, as_built.n_gauges, as_built.n_regions)
    nothing, sizes = np.zeros((len(std.vector),) * 2), []
    for built in (as_built.exactly_built(), drawn(std, np.random.default_rng(5))):
        made = calibrated_map(vehicle, snapshots, as_built, Remaining(parameters=built, covariance=nothing))
        sizes.append(made.provenance["mesh_error"]["rms_sigma"])
    assert sizes[1] == pytest.approx(sizes[0], rel=0.15)  # in sigma, which follows the strains
