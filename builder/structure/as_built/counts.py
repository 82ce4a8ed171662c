"""How many parameters of each kind a vehicle has: of its gauges, rows, regions of the wall and joints."""

from __future__ import annotations

from builder.structure.as_built.as_built_vehicle import Counts
from builder.structure.as_built.gauge_strain_terms import rows_of
from builder.structure.as_built.wall_regions import wall_regions
from builder.structure.as_built_kinds import BY_REGION, KINDS
from builder.structure.fourier.fourier_model import place_layouts
from builder.structure.gauge_placement import gauge_mesh
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError


def counts_of(vehicle: Vehicle, layout: str) -> Counts:
    """Return the numbers of what a calibration estimates with the gauges of ``layout``."""
    placed = place_layouts(vehicle, gauge_mesh(vehicle), [layout])[1][layout]
    return counts_of_wall(vehicle, placed.roll_angle)


def counts_of_wall(vehicle: Vehicle, roll_angle: FloatArray) -> Counts:
    """Return the numbers with gauges at ``roll_angle`` (n_d,) [rad], regions and joints by [calibration]."""
    joints = vehicle.calibration.joint_stations_m
    row = int(rows_of(roll_angle).max()) + 1
    return Counts(gauge=len(roll_angle), region=len(wall_regions(vehicle)), row=row, joint=len(joints))


def counts_in_flight(vehicle: Vehicle, roll_angle: FloatArray) -> Counts:
    """Return the numbers of what has errors of its own by [noise], with gauges at ``roll_angle`` (n_d,) [rad].

    Regions and joints count where an error of theirs is stated.

    Raises
    ------
    InputError
        An error by regions or joints is stated, and the vehicle has none.
    """
    stated = [KINDS[name] for name in BY_REGION if KINDS[name].std(vehicle.noise) > 0.0]
    if not stated:
        return Counts(gauge=len(roll_angle), row=int(rows_of(roll_angle).max()) + 1)
    if not vehicle.is_of_revolution:
        raise InputError(f"noise.{stated[0].entry}: expected 0 but for a body of revolution that is clamped aft")
    found = counts_of_wall(vehicle, roll_angle)
    if not found.joint and any(kind.extent == "joint" for kind in stated):
        raise InputError(
            "noise.joint_softness_mm: expected 0 without joints, calibration.joint_stations_m is empty"
        )
    return found
