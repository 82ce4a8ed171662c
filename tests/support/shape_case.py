"""The elliptic cone in newtonian flow, its structure in closed form: no body of revolution, made in a second."""

from collections.abc import Sequence
from functools import cache

import numpy as np
from scipy.spatial import cKDTree

from builder.aero.engines.registry import make_engine
from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.campaign_run import snapshots_in_memory, vehicle_campaign
from builder.campaign.scheduling import Scheduling
from builder.campaign.snapshots import Snapshots
from builder.inverse.build import build_inverse_map
from builder.manifold.nonlinear_build import with_manifold
from builder.reporting import Silent
from builder.structure.mapped_structure import MappedStructure
from builder.vehicle.file import VEHICLES, Vehicle, load_vehicle
from builder.vehicle.flight_conditions import ConditionSet, condition_grid
from builder.vehicle.gauges.layout import GaugeLayout
from strainfmu.arrays import FloatArray
from strainfmu.estimator.map.inverse_map import InverseMap
from strainfmu.flight_condition import FlightCondition

MACH, ANGLE_OF_ATTACK_DEG, SIDESLIP_DEG = (6.0, 6.5, 7.0), (-4.0, -2.0, 0.0, 2.0, 4.0), (-2.0, -1.0, 0.0, 1.0, 2.0)
ALTITUDE = 22e3
STATIONS = (0.5, 0.8, 1.1, 1.4)
ROLL_DEG = (0.0, 60.0, 180.0, 300.0)
N_D = 2 * len(STATIONS) * len(ROLL_DEG)
"""An axial and a hoop gauge at every station and roll angle; those at 60 and 300 degrees are mirror images."""

MIRRORED = np.arange(N_D).reshape(2, len(STATIONS), -1)[:, :, [0, 3, 2, 1]].ravel()
"""The gauge that is the mirror image of each in the plane y = 0."""


def shape_vehicle(estimator: str = "nonlinear", **entry: object) -> Vehicle:
    """Return the elliptic cone's file with gauge noise alone and small pressures off the tables."""
    vehicle = load_vehicle(VEHICLES / "elliptic_cone.toml")
    small = dict.fromkeys(("discrepancy_of_prior_percent", "discrepancy_of_overpressure_percent"), 1.0)
    updated = {"estimator": estimator, "discrepancy_percent": 0.5, **small, **entry}
    noise = vehicle.noise.without_hardware_errors().model_copy(update={"std_um_per_m": 0.05})
    return vehicle.model_copy(update={"map": vehicle.map.model_copy(update=updated), "noise": noise})


def flown(conditions: Sequence[FlightCondition]) -> Snapshots:
    """Return newtonian pressures at ``conditions``."""
    vehicle = shape_vehicle()
    coarse = vehicle.resolution.map.model_copy(update={"surface_stations": 20, "surface_roll_angles": 48})
    engine = make_engine(vehicle, "newtonian", coarse)
    campaign = vehicle_campaign(vehicle, engine, (ConditionSet("given", tuple(conditions)),))
    return snapshots_in_memory(campaign, Scheduling(workers=0), Silent(), "Flow").snapshots


def grid_conditions(
    mach: Sequence[float] = MACH,
    alpha: Sequence[float] = ANGLE_OF_ATTACK_DEG,
    beta: Sequence[float] = SIDESLIP_DEG,
) -> list[FlightCondition]:
    """Return all combinations of conditions, angles in degrees."""
    return condition_grid(mach, alpha, beta, ALTITUDE)


@cache
def grid_snapshots() -> Snapshots:
    """Return the snapshots at :func:`grid_conditions`."""
    return flown(grid_conditions())


def shape_structure(surface: SurfaceMesh, gauges: Sequence[int] = range(N_D)) -> MappedStructure:
    """Return a beam: axial gauges read bending by the pressure ahead, hoop gauges the pressure around them."""
    area, force = _of_nodes(surface)
    rows, position, direction = [], [], []
    for hoop in (False, True):
        for station in STATIONS:
            for roll in np.radians(ROLL_DEG):
                place = np.array([station, 0.25 * station * np.sin(roll), 0.125 * station * np.cos(roll)])
                position.append(place)
                direction.append([0.0, np.cos(roll), -np.sin(roll)] if hoop else [1.0, 0.0, 0.0])
                rows.append(_hoop(surface, area, place) if hoop else _axial(surface, force, station, float(roll)))
    chosen = list(gauges)
    names = tuple(f"gauge_{k}" for k in chosen)
    layout = GaugeLayout(names, np.array(position)[chosen], np.array(direction)[chosen])
    return MappedStructure(
        surface=surface,
        description="a beam",
        layouts={"four_rows": layout},
        operators={"four_rows": np.array(rows)[chosen]},
    )


def _of_nodes(surface: SurfaceMesh) -> tuple[FloatArray, FloatArray]:
    """Return areas (n_p,) and forces per pressure (n_p, 3), symmetric in y = 0, which the triangles are not."""
    flip = np.array([1.0, -1.0, 1.0])
    image = cKDTree(surface.point).query(surface.point * flip)[1]
    area, force = surface.node_area, -surface.node_area[:, None] * surface.node_normal
    return 0.5 * (area + area[image]), 0.5 * (force + force[image] * flip)


def _axial(surface: SurfaceMesh, force: FloatArray, station: float, roll: float) -> FloatArray:
    arm = np.maximum(station - surface.point[:, 0], 0.0) / station
    across = force[:, 2] * np.cos(roll) + force[:, 1] * np.sin(roll)
    return np.asarray(1e-8 * (arm * across / station**2 + 0.1 * (arm > 0.0) * force[:, 0] / station))


def _hoop(surface: SurfaceMesh, area: FloatArray, place: FloatArray) -> FloatArray:
    near = np.exp(-0.5 * np.sum((surface.point - place) ** 2, axis=1) / 0.15**2) * area
    return np.asarray(1e-9 * near / near.sum())


def shape_map(gauges: Sequence[int] = range(N_D), **entry: object) -> InverseMap:
    """Return the map of both estimators with some ``gauges`` and entries of [map]."""
    vehicle, snapshots = shape_vehicle(**entry), grid_snapshots()
    structure = shape_structure(snapshots.surface, gauges)
    return with_manifold(build_inverse_map(vehicle, snapshots, structure), vehicle, snapshots, structure)
