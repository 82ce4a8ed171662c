"""Strain of a structure's gauges under known loads."""

from collections.abc import Sequence

import numpy as np

from builder.structure.loads.applied import (
    Acceleration,
    ApparentStrain,
    DistributedForce,
    Load,
    PadForce,
    PadPressure,
    PointForce,
    SectionLoad,
    SurfaceForce,
    SurfacePressure,
    Weight,
)
from builder.structure.loads.loaded_structure import OUTER, LoadedStructure, SurfacePoints, check_stations
from builder.structure.loads.temperature import TemperatureField
from strainfmu.arrays import FloatArray, IntArray
from strainfmu.errors import InputError

RING_POINTS = 96
"""Points of a ring that takes a section's load: exact for harmonics below 95."""

UNBALANCED = 1e-6
"""Resultant of a load over the sum of its parts below which a free body without a density takes it."""


def gauge_strain(structure: LoadedStructure, loads: Sequence[Load]) -> FloatArray:
    """Return the reading of every gauge under loads that act together.

    The response is linear: strains of load cases add, and scale with each load.

    Parameters
    ----------
    structure : solved for its gauges.
    loads : any number; none gives zero.

    Returns
    -------
    (n_d,) [m/m], positive in tension. Under a temperature field: strain, less the compensation of the gauges times
    their temperature. Own apparent strain is added as :class:`~builder.structure.loads.applied.ApparentStrain`.

    Raises
    ------
    InputError
        A station is beyond the body, a surface does not exist, a density or an expansion is missing, or a free
        body without density is loaded by forces that do not balance.
    """
    n_gauges = len(structure.gauge_location[0])
    reading = np.zeros(n_gauges)
    force = None
    for load in loads:
        if isinstance(load, ApparentStrain):
            if np.shape(load.strain) != (n_gauges,):
                raise InputError(f"apparent strain: expected ({n_gauges},) values, got {np.shape(load.strain)}")
            reading += load.strain
            continue
        if isinstance(load, TemperatureField):
            reading -= structure.properties.compensation * gauge_temperature(structure, load)
        part = nodal_force(structure, load)
        force = part if force is None else force + part
    if force is None:
        return reading
    return reading + structure.strain(balanced(structure, force) if structure.is_free else force)


def gauge_temperature(structure: LoadedStructure, temperature: TemperatureField) -> FloatArray:
    """Return the temperature (n_d,) [K] of every gauge in a field: what its apparent strain depends on."""
    return temperature.at(*structure.gauge_location)


def load_resultant(structure: LoadedStructure, loads: Sequence[Load]) -> FloatArray:
    """Return the force [N] and the moment about the nose tip [N m] of loads, (6,) in body axes."""
    acting = [load for load in loads if not isinstance(load, ApparentStrain)]
    return sum((structure.resultant(nodal_force(structure, load)) for load in acting), np.zeros(6))


def nodal_force(structure: LoadedStructure, load: Load) -> FloatArray:
    """Return the nodal forces of one load, in the structure's own shape.

    Raises
    ------
    InputError
        As :func:`gauge_strain`; an apparent strain is no force.
    """
    match load:
        case PointForce():
            where = np.array([load.station]), np.array([load.roll_angle])
            return structure.point_force(*where, np.array([load.force]))
        case PadForce():
            points = structure.surface_points(OUTER)
            chosen, weight = _pad_weight(structure, points, load)
            return structure.spread_force(OUTER, np.outer(weight / weight.sum(), load.force), chosen)
        case PadPressure():
            points = structure.surface_points(OUTER)
            chosen, weight = _pad_weight(structure, points, load)
            inward = -points.normal[chosen] * weight[:, None]
            radial = np.array([0.0, np.sin(load.roll_angle), np.cos(load.roll_angle)])
            return structure.spread_force(OUTER, -load.push * inward / (inward @ radial).sum(), chosen)
        case SurfacePressure():
            points = structure.surface_points(load.surface)
            return structure.spread_force(load.surface, -load.pressure * points.area[:, None] * points.normal)
        case SurfaceForce():
            area = structure.surface_points(load.surface).area
            return structure.spread_force(load.surface, np.outer(area / area.sum(), load.force))
        case DistributedForce():
            return _distributed(structure, load)
        case SectionLoad():
            return _section(structure, load)
        case Weight():
            return inertia_force(structure, np.concatenate([load.acceleration, np.zeros(3)]))
        case Acceleration():
            return -inertia_force(structure, np.array([*load.linear, *load.angular]))
        case TemperatureField():
            return structure.thermal_force(load)
        case _:
            raise InputError(f"{type(load).__name__} is no force")


def inertia_force(structure: LoadedStructure, acceleration: FloatArray) -> FloatArray:
    """Return nodal forces of mass times acceleration (6,), point masses included.

    The first three are the acceleration of the origin [m/s2], the others the angular one [rad/s2].
    """
    force = structure.inertia_force(acceleration)
    masses = structure.properties.masses
    if not masses:
        return force
    station = np.array([mass.station for mass in masses])
    roll = np.array([mass.roll_angle for mass in masses])
    radius = np.array([structure.outer_radius(x) for x in station])
    position = np.column_stack([station, radius * np.sin(roll), radius * np.cos(roll)])
    local = acceleration[:3] + np.cross(acceleration[3:], position)
    mass = np.array([mass.mass for mass in masses])
    return force + structure.point_force(station, roll, mass[:, None] * local)


def balanced(structure: LoadedStructure, force: FloatArray) -> FloatArray:
    """Return nodal forces less the inertia that they meet in a free body: force and moment sum to nothing.

    Raises
    ------
    InputError
        There is no density and the forces do not balance by themselves.
    """
    resultant = structure.resultant(force)
    if structure.properties.density is None:
        if np.abs(resultant).max() > UNBALANCED * np.abs(force).sum():
            raise InputError("a free body under forces that do not balance needs a density: none found")
        return force
    unit = [inertia_force(structure, axis) for axis in np.eye(6)]
    inertia = np.column_stack([structure.resultant(load) for load in unit])
    acceleration = np.linalg.solve(inertia, resultant)
    return force - sum(a * load for a, load in zip(acceleration, unit, strict=True))


def _pad_weight(
    structure: LoadedStructure, points: SurfacePoints, pad: PadForce | PadPressure
) -> tuple[IntArray, FloatArray]:
    """Return the points (k,) under a pad, and there its raised cosine times area (k,) [m2]."""
    check_stations(structure.outer_span, np.array([pad.station]))
    distance = points.station - pad.station
    near = np.flatnonzero(np.abs(distance) < pad.half_length)
    turn = points.roll_angle[near] - pad.roll_angle
    around = (np.mod(turn + np.pi, 2.0 * np.pi) - np.pi) / pad.half_angle
    within = np.abs(around) < 1.0
    chosen, around = near[within], around[within]
    along = distance[chosen] / pad.half_length
    weight = (1.0 + np.cos(np.pi * along)) * (1.0 + np.cos(np.pi * around)) * points.area[chosen]
    if np.count_nonzero(weight) < 16:
        raise InputError(
            f"pad: {2e3 * pad.half_length:g} mm by {2.0 * np.rad2deg(pad.half_angle):g} deg is too small for the "
            "mesh, take a point force or a finer mesh"
        )
    return chosen, weight


def _distributed(structure: LoadedStructure, load: DistributedForce) -> FloatArray:
    check_stations(structure.outer_span, load.station)
    points = structure.surface_points(OUTER)
    x, y, z = points.position.T
    first, last = load.station[[0, -1]]
    within = (x >= first) & (x <= last)
    per_length = np.column_stack([np.interp(x, load.station, part) for part in load.force_per_length.T])
    length = within * points.area * np.sqrt(1.0 - points.normal[:, 0] ** 2) / (2.0 * np.pi * np.hypot(y, z))
    # The ends may lie within elements: keep the length and its first moment.
    arm = x - 0.5 * (first + last)
    sums = [(length * arm**k).sum() for k in range(3)]
    if np.count_nonzero(length) < 16 or sums[2] <= 0.0:
        raise InputError(f"distributed force: {first:g} to {last:g} m is too short for the mesh")
    slope, level = np.linalg.solve([[sums[1], sums[0]], [sums[2], sums[1]]], [last - first, 0.0])
    return structure.spread_force(OUTER, (length * (level + slope * arm))[:, None] * per_length)


def _section(structure: LoadedStructure, load: SectionLoad) -> FloatArray:
    roll = 2.0 * np.pi * np.arange(RING_POINTS) / RING_POINTS
    force = np.tile(np.asarray(load.force), (RING_POINTS, 1))
    torque, about_y, about_z = load.moment
    if any(load.moment):
        radius = structure.outer_radius(load.station)
        if radius <= 0.0:
            raise InputError(f"section load: a moment at x = {load.station:g} m has no ring to act on")
        force[:, 0] += 2.0 * (about_y * np.cos(roll) - about_z * np.sin(roll)) / radius
        # Increasing roll angle turns from +z to +y, against the right-hand rule about x.
        force[:, 1:] -= torque / radius * np.column_stack([np.cos(roll), -np.sin(roll)])
    return structure.point_force(np.full(RING_POINTS, load.station), roll, force / RING_POINTS)
