"""The results of another flow solver as an engine: the cases of a manifest, mapped to the vehicle's surface."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from builder.aero.cfd.manifest import CfdCase, Manifest, condition_key, file_content, load_manifest
from builder.aero.cfd.surface_field import SurfaceField, read_field
from builder.aero.cfd.surface_transfer import mirror, on_surface, place
from builder.aero.cfd.units import METRES, check_plausible, pressure_ratio
from builder.aero.engine import Flow, FlowKey
from builder.aero.surface.mesh import SurfaceMesh
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

METHOD_VERSION = 1
"""Raised whenever the mapping's results change, so that stored flows of an older one are made again."""
_NEAREST_LISTED = 3
_OVERHANG = 0.05
"""The file may miss the ends of the vehicle by this fraction of its extent: half a cell of a coarse grid."""
_LARGEST = 3.0
"""The file may be larger than the vehicle's surface by this factor: a base, a sting, a booster."""


@dataclass(frozen=True, eq=False)
class TableEngine:
    """Imported results; one flow per case of the manifest, and none between them.

    A flow's key is the whole condition, then a number made of the file's bytes: a file that changes makes its own
    flow stale and no other.

    Attributes
    ----------
    manifest : the cases.
    surface : the nodes at which pressures are given.
    """

    manifest: Manifest
    surface: SurfaceMesh

    @property
    def name(self) -> str:
        return "table"

    @cached_property
    def _case_of(self) -> dict[tuple[float, ...], CfdCase]:
        return {condition_key(case.condition): case for case in self.manifest.cases}

    def conditions(self) -> list[FlightCondition]:
        """Return the conditions of the manifest, in its order."""
        return [case.condition for case in self.manifest.cases]

    def inputs(self) -> Mapping[str, Any]:
        common = self.manifest.entries.settings()
        written = {str(case.content): case.written.settings() for case in self.manifest.cases}
        exceptions = {content: how for content, how in written.items() if how != common}
        return {
            "engine": self.name,
            "method_version": METHOD_VERSION,
            "manifest": common,
            **({"written": exceptions} if exceptions else {}),
            "surface": self.surface.digest(),
        }

    def flow_key(self, condition: FlightCondition) -> FlowKey:
        """Return M, angle of attack, sideslip [rad], altitude [m] and the file's number.

        Raises
        ------
        InputError
            The manifest has no such condition; the message names the nearest it has.
        """
        key = condition_key(condition)
        if key not in self._case_of:
            raise InputError(
                f"{self.manifest.path}: no case at {condition}; the nearest are: "
                + "; ".join(map(str, self._nearest(condition)))
            )
        return (*key, float(self._case_of[key].content))

    def solve(self, key: FlowKey) -> Flow:
        """Read, convert, check and map one file.

        Raises
        ------
        InputError
            The file was changed since the manifest was read, is damaged, holds what cannot be a pressure, or does
            not lie on the vehicle's surface.
        """
        case = self._case_of[key[:-1]]
        if not case.file.exists() or float(file_content(case.file)) != key[-1]:
            raise InputError(f"{case.file}: changed since {self.manifest.path} was read; start again")
        entries = case.written
        field = read_field(case.file, entries.array, entries.location, METRES[entries.length_unit])
        ratio = pressure_ratio(field.values, entries.quantity, entries.unit, case.condition)
        where = f"{case.file}: array '{field.array}'"
        check_plausible(where, ratio, entries.quantity, entries.unit, case.condition.mach_number)
        placed = place(field, *entries.to_body_axes())
        if entries.mirrored:
            placed, ratio = mirror(case.file, placed, ratio)
        return Flow(key=key, arrays={"ratio": _on_surface(case.file, placed, ratio, self.surface)})

    def pressure_ratio(self, flow: Flow, condition: FlightCondition) -> FloatArray:
        return flow.arrays["ratio"]

    def _nearest(self, condition: FlightCondition) -> list[FlightCondition]:
        """Return the manifest's nearest conditions: 1 in Mach number counts as 0.1 rad and as 10 km."""
        scale = np.array([1.0, 10.0, 10.0, 1e-4])
        table = np.array([case.condition.as_tuple() for case in self.manifest.cases])
        distance = np.linalg.norm((table - np.array(condition.as_tuple())) * scale, axis=1)
        return [self.manifest.cases[i].condition for i in np.argsort(distance, kind="stable")[:_NEAREST_LISTED]]


def table_engine(manifest: Path, surface: SurfaceMesh, parameters: Sequence[str] = ()) -> TableEngine:
    """Return the engine of a manifest file for a vehicle's surface; ``parameters`` are its cases' own of the flow.

    Raises
    ------
    InputError
        The manifest is wrong or a file that it names is missing.
    """
    return TableEngine(load_manifest(manifest, parameters), surface)


def _on_surface(file: Path, field: SurfaceField, ratio: FloatArray, surface: SurfaceMesh) -> FloatArray:
    """Return p/p_inf (n_nodes,) at the vehicle's nodes of the field's values (n,)."""
    _check_extent(file, field.point, surface)
    try:
        return on_surface(field, ratio, surface)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error


def _check_extent(file: Path, point: FloatArray, surface: SurfaceMesh) -> None:
    """Refuse what cannot be the same body, before the long search for closest points.

    Raises
    ------
    InputError
        The file does not reach around the vehicle's surface, or is far larger; the message gives both spans.
    """
    span = np.stack([point.min(axis=0), point.max(axis=0)])
    expected = np.stack([surface.point.min(axis=0), surface.point.max(axis=0)])
    extent = float(np.linalg.norm(expected[1] - expected[0]))
    slack = _OVERHANG * extent
    short = (span[0] > expected[0] + slack).any() or (span[1] < expected[1] - slack).any()
    if short or np.linalg.norm(span[1] - span[0]) > _LARGEST * extent:
        spans = [", ".join(f"{low:.4g} to {high:.4g}" for low, high in box.T) for box in (span, expected)]
        raise InputError(
            f"{file}: spans {spans[0]} m in x, y, z, the vehicle's surface {spans[1]} m; wrong length_unit, axes "
            "or translation_m, or not the whole vehicle?"
        )
