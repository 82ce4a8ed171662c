"""The loads behind the five that a vehicle file asks for: rows that act on the pressure, and fields of the map.

There is one entry here for each family of :mod:`strainfmu.estimator.other_loads`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from builder.aero.loads.hinge_moments import hinge_fields, hinge_operator
from builder.aero.loads.sections import (
    bending_fields,
    bending_operator,
    rolling_operator,
    section_operator,
)
from builder.aero.surface.mesh import SurfaceMesh
from builder.vehicle.map.options import MapEntry
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.estimator.other_loads import BENDING, BODY, FAMILIES, HINGES, SECTIONS, LoadFamily

Surface = SurfaceGrid | SurfaceMesh


@dataclass(frozen=True)
class _Asked:
    """How a family is asked for.

    Attributes
    ----------
    rows : (m, n) loads per nodal pressure [m2, m3] of surface, section [map] and moment station [m], load by load,
        place by place.
    fields : fields of the map that state the places, from the section [map].
    """

    rows: Callable[[Surface, MapEntry, float], FloatArray]
    fields: Callable[[MapEntry], dict[str, Any]]


_ASKED: dict[LoadFamily, _Asked] = {
    BODY: _Asked(
        rows=lambda surface, _, moment_station: rolling_operator(surface, moment_station), fields=lambda _: {}
    ),
    SECTIONS: _Asked(
        rows=lambda surface, entry, _: section_operator(surface, entry.section_stations_m),
        fields=lambda entry: {"section_station": np.array(entry.section_stations_m, dtype=float)},
    ),
    HINGES: _Asked(rows=lambda surface, entry, _: hinge_operator(surface, entry), fields=hinge_fields),
    BENDING: _Asked(rows=lambda surface, entry, _: bending_operator(surface, entry), fields=bending_fields),
}


def other_load_operator(surface: Surface, entry: MapEntry, moment_station: float) -> FloatArray:
    """Return (m, n) the loads behind the five per nodal pressure [m2, m3], in the order of the map's groups.

    m is 0 for a body of revolution of which the rolling moment alone, which is zero, is asked for.

    Raises
    ------
    InputError
        A place that ``entry`` states is not on the surface.
    """
    rows = [_ASKED[family].rows(surface, entry, moment_station) for family in FAMILIES]
    found = np.concatenate(rows)
    is_zero = isinstance(surface, SurfaceGrid) and len(found) == len(BODY.loads)
    return found[:0] if is_zero else found


def other_load_fields(entry: MapEntry) -> dict[str, Any]:
    """Return the fields of a map that state the places of these loads."""
    return {name: value for family in FAMILIES for name, value in _ASKED[family].fields(entry).items()}
