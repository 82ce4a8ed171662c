"""The structure that a ground test is compared with: what the vehicle file states, and what else may be.

Joints that the file does not name, and Young's modulus by regions, are taken for zero, but have tables, so that
the readings can set them free.
"""

import numpy as np

from builder.reporting import Progress
from builder.structure.as_built.as_built_structure import AsBuiltStructure, as_built_structure
from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built.displaced_structure import AnyAsBuilt
from builder.structure.as_built.wall_regions import wall_regions
from builder.structure.loads.fourier import MAX_HARMONIC
from builder.structure.loads.loaded_structure import LoadProperties
from builder.structure.wall import wall_of
from builder.vehicle.file import Vehicle

APART = 0.05
"""Least distance of two candidates for a joint, over the length of the wall."""

UNKNOWN = 1.0
"""Error of the modulus that makes the structure solve for it [%]; its size does not count."""


def structure_of_test(
    vehicle: Vehicle,
    properties: LoadProperties | None = None,
    max_harmonic: int = MAX_HARMONIC,
    progress: Progress | None = None,
) -> AsBuiltStructure:
    """Solve the structure of the map of ``vehicle`` for its layout; errors as :func:`as_built_structure`."""
    entry = vehicle.calibration
    more = entry.model_copy(
        update={
            "joint_stations_m": entry.joint_stations_m or joint_candidates(vehicle),
            "region_modulus_percent": entry.region_modulus_percent or UNKNOWN,
        }
    )
    return as_built_structure(
        vehicle.model_copy(update={"calibration": more}),
        vehicle.gauges.layout,
        properties=properties,
        max_harmonic=max_harmonic,
        progress=progress,
    )


def prior_of_test(vehicle: Vehicle, structure: AnyAsBuilt) -> AsBuilt:
    """Return the prior of the parameters of :func:`structure_of_test`, by the vehicle file."""
    prior = structure.prior(vehicle.calibration)
    if vehicle.calibration.joint_stations_m:
        return prior
    return prior.changed(joint_softness=np.zeros(structure.counts.joint))


def joint_candidates(vehicle: Vehicle) -> tuple[float, ...]:
    """Return stations where a wall may have a joint [m]: breaks of its profile, then ends of its regions."""
    body = vehicle.body()
    end = wall_regions(vehicle.calibration, wall_of(vehicle), body).end
    first, last = end[0], end[-1]
    apart = APART * (last - first)
    stations: list[float] = []
    for station in (*body.slope_breaks.tolist(), *end[1:-1].tolist()):
        if first + apart < station < last - apart and all(
            abs(station - other_station) > apart for other_station in stations
        ):
            stations.append(station)
    return tuple(sorted(stations))
