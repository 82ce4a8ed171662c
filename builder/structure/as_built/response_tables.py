"""Strain amplitudes under one kind of load as polynomials of the wall and of the gauges' stations.

Vehicles may be many at once (.., n): these lead then, ahead of what leads in a table.

Amplitudes are arrays (.., n_m, n_s, 3): harmonic in roll angle, station, and meridional, hoop and shear strain.
What leads is the load's: its two families of harmonics, or the stations of a pressure.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from builder.structure.as_built.as_built_vehicle import AsBuilt
from builder.structure.as_built.wall_changes import SIDES, WAVES
from strainfmu.arrays import BoolArray, FloatArray, IntArray

QUARTER = 0.5 * np.pi


@dataclass(frozen=True, eq=False, kw_only=True)
class ResponseTable:
    """Amplitudes at the parameters' zero and their change.

    Attributes
    ----------
    nominal : (.., n_m, n_s, 3).
    along, along_twice : the same per metre along the surface and per its square; None for none.
    wall, wall_twice : (n_t, .., n_m, n_s, 3) per relative thickness of each region, or of the whole wall, then per
        taper of each region, and per their squares.
    uneven : (n_w, 2, n_r, 3 sides, .., n_m, n_s, 3) per wall harmonic w as cos(w phi) and, in a frame rolled by a
        quarter of its period, as sin(w phi); the strain goes round the body by n + w side.
    soft : (n_soft, .., n_m, n_s, 3) per compliance of the clamp along and across the body, then of each joint,
        then per modulus of each region, where that is not known.
    uneven_load : (n_w, 2, n_r, .., n_m, n_s, 3) per wall harmonic, through the load itself; None where it does not
        change.
    region_mass : (n_r, .., n_m, n_s, 3) per mass of each region; None where the load is none of mass.
    """

    nominal: FloatArray
    along: FloatArray | None
    along_twice: FloatArray | None
    wall: FloatArray
    wall_twice: FloatArray
    uneven: FloatArray
    soft: FloatArray
    uneven_load: FloatArray | None = None
    region_mass: FloatArray | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadResponse:
    """What one load strains, ready for any vehicle as built.

    Attributes
    ----------
    table : amplitudes; the two families of harmonics lead.
    constant : (n_d,) reading that no parameter changes, as apparent strain [m/m].
    by_stress : whether strain goes with 1 / E; strain of a temperature does not.
    by_mass : whether strain goes with the vehicle's mass.
    """

    table: ResponseTable
    constant: FloatArray
    by_stress: bool | BoolArray = True
    by_mass: bool | BoolArray = False


def nominal_table(amplitude: FloatArray, n_regions: int) -> ResponseTable:
    """Return the table of ``amplitude`` (.., n_m, n_s, 3) that no parameter changes."""
    none = np.zeros((0, *amplitude.shape))
    return ResponseTable(
        nominal=amplitude,
        along=None,
        along_twice=None,
        wall=none,
        wall_twice=none,
        uneven=np.zeros((len(WAVES), 2, n_regions, 3, *amplitude.shape)),
        soft=none,
    )


def stacked_tables(tables: Sequence[ResponseTable]) -> ResponseTable:
    """Return one table of loads (2, n_loads, n_m, n_s, 3), families of harmonics ahead of the loads.

    What one load has no part of, as harmonics or the wall's thickness, is zero.
    """
    n_m, stacked = max(table.nominal.shape[1] for table in tables), dict[str, Any]()
    for entry in fields(ResponseTable):
        parts = [getattr(table, entry.name) for table in tables]
        lead = max((part.shape[:-4] for part in parts if part is not None), default=None)
        if lead is None:
            stacked[entry.name] = None
            continue
        # What leads is the table's; 2, n_m, n_s, 3 are the load's.
        filled = [
            np.zeros((*lead, *table.nominal.shape)) if part is None or part.shape[:-4] != lead else part
            for part, table in zip(parts, tables, strict=True)
        ]
        none = [(0, 0)] * (len(lead) + 1)
        padded = [np.pad(part, [*none, (0, n_m - part.shape[-3]), (0, 0), (0, 0)]) for part in filled]
        stacked[entry.name] = _by_station(np.stack(padded, axis=-4))
    return ResponseTable(**stacked)


def _by_station(amplitude: FloatArray) -> FloatArray:
    """Return amplitudes (.., 2, n, n_m, n_s, 3) laid out in memory by station and load, in which they are read."""
    lead = range(amplitude.ndim - 5)
    order = (*lead, *(len(lead) + part for part in (3, 1, 4, 2, 0)))
    return np.ascontiguousarray(amplitude.transpose(order)).transpose(np.argsort(order))


def together(responses: Sequence[LoadResponse]) -> LoadResponse:
    """Return the responses of loads of one structure as one, with the readings of every load."""
    return LoadResponse(
        table=stacked_tables([response.table for response in responses]),
        constant=np.array([response.constant for response in responses]),
        by_stress=np.array([response.by_stress for response in responses]),
        by_mass=np.array([response.by_mass for response in responses]),
    )


def combined(responses: Sequence[LoadResponse], weights: FloatArray) -> LoadResponse:
    """Return the response of a load that is the sum of ``weights`` (n,) times loads of one kind."""
    first, entries = responses[0], dict[str, Any]()
    for entry in fields(ResponseTable):
        parts = [getattr(response.table, entry.name) for response in responses]
        entries[entry.name] = None if parts[0] is None else np.tensordot(weights, np.stack(parts), 1)
    constant = np.tensordot(weights, np.stack([response.constant for response in responses]), 1)
    return replace(first, table=replace(first.table, **entries), constant=constant)


def even_amplitudes(
    table: ResponseTable, parameters: AsBuilt, thickness: FloatArray, station: IntArray
) -> FloatArray:
    """Return (.., n_m, n_d, 3) at the gauges, of the part that goes round the body as the load does.

    ``thickness`` (.., n_t) is what the rows of :attr:`ResponseTable.wall` are multiplied by, or (.., n_d) what
    each gauge sees of the first one.
    """
    lead, of_each = table.nominal.ndim - 3, thickness.shape[-1] != len(table.wall)
    amplitude = at_stations(table, parameters, thickness)[..., station, :]
    if len(table.wall) and of_each:
        t = at_gauges(thickness, lead)[..., None]
        amplitude = amplitude + t * (table.wall[0][..., station, :] + t * table.wall_twice[0][..., station, :])
    if table.along is None:
        return amplitude
    shift = at_gauges(parameters.axial_shift, lead)[..., None]
    slope = table.along[..., station, :]
    if table.along_twice is not None:
        slope = slope + shift * table.along_twice[..., station, :]
    return np.asarray(amplitude + shift * slope)


def at_stations(table: ResponseTable, parameters: AsBuilt, thickness: FloatArray) -> FloatArray:
    """Return (.., n_m, n_s, 3) at the stations of the drawing, of the part that goes round the body as the load
    does; without a ``thickness`` (.., n_d) that each gauge sees."""
    amplitude = table.nominal
    if len(table.wall) and thickness.shape[-1] == len(table.wall):
        amplitude = (
            amplitude + np.tensordot(thickness, table.wall, 1) + np.tensordot(thickness**2, table.wall_twice, 1)
        )
    if table.uneven_load is not None:
        amplitude = amplitude + np.tensordot(_waves(parameters), table.uneven_load, 3)
    if table.region_mass is not None:
        amplitude = amplitude + np.tensordot(parameters.region_mass, table.region_mass, 1)
    if len(table.soft):
        amplitude = amplitude + np.tensordot(_softness(parameters)[..., : len(table.soft)], table.soft, 1)
    return np.asarray(amplitude)


def at_gauges(value: FloatArray, lead: int, dimensions: int = 1) -> FloatArray:
    """Return ``value`` (.., n_d) with places for harmonics and for the ``lead`` dimensions of a table, behind the
    vehicles; its last ``dimensions`` are the gauges' own."""
    vehicles, of_gauge = value.shape[:-dimensions], value.shape[-dimensions:]
    return value.reshape(*vehicles, *[1] * (lead + 1), *of_gauge)


def uneven_amplitudes(table: ResponseTable, parameters: AsBuilt) -> Iterator[tuple[int, int, FloatArray]]:
    """Yield the parts of the uneven wall: its harmonic w, quarters of its period that it is rolled by, amplitudes.

    These are (3 sides, .., n_m, n_s, 3), of one vehicle. An even wall has no parts.
    """
    if not is_uneven(parameters):
        return
    for wave, by_frame, tables in zip(WAVES, _waves(parameters), table.uneven, strict=True):
        for turned, (size, part) in enumerate(zip(by_frame, tables, strict=True)):
            if size.any():
                yield wave, turned, np.tensordot(size, part, 1)


def _softness(parameters: AsBuilt) -> FloatArray:
    """Return (.., 2 + n_joints + n_r) what the rows of :attr:`ResponseTable.soft` are multiplied by.

    A region's strain goes with its compliance, 1 / (1 + e), nearly in proportion; so the line is one in that.
    """
    stiffer = parameters.region_modulus / (1.0 + parameters.region_modulus)
    soft = parameters.clamp_axial, parameters.clamp_transverse, parameters.joint_softness
    return np.concatenate(of_all_vehicles(*soft, stiffer), axis=-1)


WAVE_KINDS = ("wall_cosine", "wall_sine", "wall_second_cosine", "wall_second_sine")
"""Kinds of error of a wall whose thickness goes round the body, by wave, then cosine and sine."""


def _waves(parameters: AsBuilt) -> FloatArray:
    """Return (.., n_w, 2, n_r) cosine and sine parts of the thickness, for each of :data:`WAVES`."""
    parts = of_all_vehicles(*(getattr(parameters, kind) for kind in WAVE_KINDS))
    return np.stack([np.stack(parts[:2], axis=-2), np.stack(parts[2:], axis=-2)], axis=-3)


def of_all_vehicles(*values: FloatArray) -> list[FloatArray]:
    """Return values (.., n) with the vehicles of all, where some are given once for all of them."""
    lead = np.broadcast_shapes(*(value.shape[:-1] for value in values))
    return [np.broadcast_to(value, (*lead, value.shape[-1])) for value in values]


def is_uneven(parameters: AsBuilt) -> bool:
    """Return whether the thickness of a wall goes round the body."""
    return any(getattr(parameters, kind).any() for kind in WAVE_KINDS)


def side_phases(roll_angle: FloatArray, n_m: int, wave: int) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Return per side cosine and sine (n_m, n_d) of the strain's harmonic at roll angles, and a factor (n_d,)."""
    phases = []
    for side in SIDES:
        m = np.arange(n_m) + wave * side
        inside = (np.abs(m) < n_m).astype(np.float64)[:, None]
        phase = m[:, None] * roll_angle
        factor = np.cos(wave * roll_angle) if side == 0 else np.ones_like(roll_angle)
        phases.append((inside * np.cos(phase), inside * np.sin(phase), factor))
    return phases
