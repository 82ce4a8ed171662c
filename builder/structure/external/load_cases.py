"""Load cases for another structural code: the net surface pressure of every snapshot, and a uniform one.

The columns of gauges in files of another structural code: which layouts they make up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np

from builder.aero.surface.mesh import SurfaceMesh
from builder.campaign.snapshots import Snapshots
from builder.structure.solid.gauge_layouts import is_displaced
from builder.structure.solid.gauge_rows import Gauges
from builder.vehicle.file import Vehicle
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.flight_condition import FlightCondition

UNIFORM = "uniform"
"""Name of the case of the same pressure everywhere, by which the pressure inside acts."""

UNIFORM_PRESSURE = 1e4
"""Of that case [Pa]."""

ID_LENGTH = 12


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadCases:
    """Pressures that a structure is to be loaded with, linear over each triangle.

    Attributes
    ----------
    surface : nodes and triangles that carry them.
    names : n names, ``case_0001`` and so on; the last is :data:`UNIFORM`.
    conditions : flight condition of each case but the last.
    pressure : (n, n_p) outer less inner pressure at the nodes [Pa].
    """

    surface: SurfaceMesh
    names: tuple[str, ...]
    conditions: tuple[FlightCondition, ...]
    pressure: FloatArray

    def ids(self) -> tuple[str, ...]:
        """Return what identifies each case: a digest of its pressures and of the surface."""
        surface = self.surface.digest().encode()
        return tuple(
            sha256(surface + np.ascontiguousarray(row, dtype="<f8").tobytes()).hexdigest()[:ID_LENGTH]
            for row in self.pressure
        )


def load_cases(vehicle: Vehicle, snapshots: Snapshots) -> LoadCases:
    """Return the load cases of ``snapshots``, at the internal pressure of the vehicle file."""
    conditions = tuple(snapshots.conditions())
    inside = np.array([vehicle.internal_pressure(condition) for condition in conditions])
    uniform = np.full((1, snapshots.pressure.shape[1]), UNIFORM_PRESSURE)
    return LoadCases(
        surface=snapshots.surface,
        names=(*(f"case_{number:04d}" for number in range(1, len(conditions) + 1)), UNIFORM),
        conditions=conditions,
        pressure=np.concatenate([snapshots.pressure - inside[:, None], uniform]),
    )


def strain_columns(layouts: Mapping[str, Gauges], in_use: str) -> dict[str, tuple[str, ...]]:
    """Return the name of each gauge's column, by layout: its own, in others after the layout's name."""
    return {
        layout: gauges.name if layout == in_use else tuple(f"{layout}: {name}" for name in gauges.name)
        for layout, gauges in layouts.items()
    }


def columns_found(
    path: Path, columns: Sequence[str], layouts: Mapping[str, Gauges], in_use: str
) -> dict[str, tuple[str, ...]]:
    """Return the columns of each layout that is there; displaced ones may be missing as a whole.

    Raises
    ------
    InputError
        A column is no gauge's, or one is missing; the message begins with ``path``.
    """
    wanted = strain_columns(layouts, in_use)
    known = {name for names in wanted.values() for name in names}
    for name in columns:
        if name not in known:
            raise InputError(f"{path}: expected columns of gauges of {in_use}, got '{name}'")
    found = {}
    for layout, names in wanted.items():
        missing = [name for name in names if name not in columns]
        if is_displaced(layout) and len(missing) == len(names):
            continue
        if missing:
            raise InputError(f"{path}: expected a column '{missing[0]}', got none ({len(missing)} missing)")
        found[layout] = names
    return found
