"""Maps of a vehicle as built: the shipped vehicle on the coarsest mesh in newtonian flow, after a ground test."""

from functools import cache

import numpy as np
from inverse_case import snapshots_at

from builder.aero.engines.registry import make_engine
from builder.calibration.after_test.calibrated_map import calibrated_map
from builder.calibration.after_test.left_by_test import Remaining
from builder.campaign.snapshots import Snapshots
from builder.structure.as_built.as_built_structure import AsBuiltStructure, as_built_structure
from builder.structure.as_built.as_built_vehicle import as_built_std, draw_as_built
from builder.structure.loads.loaded_structure import LoadProperties
from builder.vehicle.file import IC3X, Vehicle, load_vehicle
from builder.vehicle.flight_conditions import condition_grid
from builder.vehicle.model_entries import Resolution, Resolutions
from strainfmu.estimator.map.inverse_map import InverseMap

COARSEST = Resolution(
    radial_cells=12,
    circumferential_cells=16,
    surface_stations=24,
    surface_roll_angles=16,
    harmonics=4,
    element_length_mm=120.0,
    wall_layers=1,
)
"""Enough for a map of plausible numbers; a vehicle needs more."""

LAYOUT = "configuration_1"
LEFT = 0.3
"""Part of each prior standard deviation that the test leaves."""


@cache
def _parts() -> tuple[Vehicle, Snapshots, AsBuiltStructure, Remaining]:
    shipped = load_vehicle(IC3X)
    changed = {
        "resolution": Resolutions(map=COARSEST, truth=COARSEST),
        "gauges": shipped.gauges.model_copy(update={"layout": LAYOUT}),
        "noise": shipped.noise.model_copy(update={"of_layout": None}),
    }
    vehicle = shipped.model_copy(update=changed)
    titanium = LoadProperties(density=4430.0)
    structure = as_built_structure(vehicle, LAYOUT, properties=titanium, max_harmonic=4)
    conditions = condition_grid([5.0, 6.0, 7.0], [0.0, 5.0, 10.0], [0.0, 5.0, 10.0], 20e3)
    snapshots = snapshots_at(make_engine(vehicle, "newtonian", COARSEST), vehicle, conditions)
    # A test leaves of a recorder's zeros what its noise is, not a part of their prior.
    clamped = vehicle.calibration.model_copy(update={"clamp_compliance_mm": 0.0, "zero_um_per_m": 50.0})
    std = as_built_std(clamped, structure.counts)
    as_built = draw_as_built(std, np.random.default_rng(5))
    return (
        vehicle,
        snapshots,
        structure,
        Remaining(parameters=as_built, covariance=np.diag((LEFT * std.vector) ** 2)),
    )


@cache
def calibrated(estimator: str) -> InverseMap:
    """Return the calibrated map with tables, ``estimator`` "nonlinear", or without, "linear"."""
    vehicle, snapshots, structure, remaining = _parts()
    entry = vehicle.map.model_copy(update={"estimator": estimator})
    vehicle = vehicle.model_copy(update={"map": entry})
    return calibrated_map(vehicle, snapshots, structure, remaining)
