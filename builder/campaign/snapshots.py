"""Snapshots: surface pressure over many flight conditions, the result of a campaign (``snapshots.h5``).

Transfer of snapshots from an engine's own surface to the pressure nodes of the vehicle's structure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from builder.aero.engine import Flow
from builder.aero.load_operator import coefficients_of, load_operator
from builder.aero.mapping_report import MappingTolerances, check_mapping, mapping_report
from builder.aero.pressure_map import pressure_map
from builder.aero.surface.mesh import SurfaceMesh, mesh_load_operator, mesh_of_grid
from builder.vehicle.shape.geometry import SurfaceGrid
from builder.vehicle.shape.shape_entries import ReferenceQuantities
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError
from strainfmu.files import open_hdf5, write_hdf5_atomically
from strainfmu.flight_condition import FlightCondition
from strainfmu.records import load_record, write_record

SCHEMA = "strainfmu.snapshots"
SCHEMA_VERSION = 3

UNITS = {
    "condition": "1, rad, rad, m",
    "pressure": "Pa",
    "internal_pressure": "Pa",
    "point": "m",
    "station": "m",
    "radius": "m",
    "meridian_angle": "rad",
    "reference": "m2, m, m",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Snapshots:
    """Surface pressure at N flight conditions.

    Attributes
    ----------
    vehicle, engine : names.
    settings : the engine's inputs, and the version that wrote the file; under ``failed`` the conditions of the
        campaign that are not here, where there are any.
    condition : (N, 4 + k) Mach number [1], angle of attack [rad], sideslip angle [rad], altitude [m], then the
        values of k flow parameters, whose names are ``settings["parameters"]``.
    pressure : (N, n_p) absolute pressure at the surface nodes [Pa].
    internal_pressure : (N,) pressure inside the body [Pa].
    reference : (3,) S [m2], L [m], moment station [m].
    point, triangle : (n_p, 3) [m], (n_t, 3): the aerodynamic surface (:class:`SurfaceMesh`).
    station, radius, meridian_angle : (n_x,) where nodes are the product of stations and evenly spaced roll angles
        (:class:`SurfaceGrid`: node = station index * n_roll + roll index); absent on a free surface.
    solved : (N,) True where the flow was solved for this condition, False where it was rolled from another.
    flow : (N,) the condition whose flow it is: its own number where solved.
    momentum_error : (N,) relative difference of the force from wall pressure and from momentum; NaN if not known.
    repairs : (N,) states of the flow that had to be made physical.
    mass_error : (N,) imbalance of mass between tip and base over the free stream's flow through the base's area;
        NaN if not known, None where it is known of no flow.

    Raises
    ------
    InputError
        An array's shape does not fit the others, or a value is not finite.
    """

    vehicle: str
    engine: str
    settings: dict[str, Any]
    condition: FloatArray
    pressure: FloatArray
    internal_pressure: FloatArray
    reference: FloatArray
    point: FloatArray
    triangle: NDArray[np.int64]
    station: FloatArray | None
    radius: FloatArray | None
    meridian_angle: FloatArray | None
    solved: NDArray[np.bool_]
    flow: NDArray[np.int64]
    momentum_error: FloatArray
    repairs: NDArray[np.int64]
    mass_error: FloatArray | None = None

    def conditions(self) -> list[FlightCondition]:
        """Return the conditions as objects."""
        return [FlightCondition.of_row(row) for row in self.condition.tolist()]

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the flow parameters."""
        return tuple(self.settings.get("parameters", ()))

    @property
    def total_incidence(self) -> FloatArray:
        """(N,) total angle of attack [rad]."""
        return np.array([condition.total_incidence for condition in self.conditions()])

    def __post_init__(self) -> None:
        n, n_p = self.pressure.shape if self.pressure.ndim == 2 else (-1, -1)
        shapes = {
            "condition": (n, 4 + len(self.parameter_names)),
            "internal_pressure": (n,),
            "reference": (3,),
            "point": (n_p, 3),
            "solved": (n,),
            "flow": (n,),
            "momentum_error": (n,),
            "repairs": (n,),
        }
        if self.mass_error is not None:
            shapes["mass_error"] = (n,)
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise InputError(f"{name}: shape {getattr(self, name).shape} found, must be {shape}")
        for name in ("condition", "pressure", "internal_pressure", "reference"):
            if not np.isfinite(getattr(self, name)).all():
                raise InputError(f"{name}: not all values are finite")
        if self.station is not None and n_p % len(self.station):
            raise InputError(f"station: {len(self.station)} found, they do not divide {n_p} nodes")

    @property
    def surface(self) -> SurfaceMesh:
        """The aerodynamic surface."""
        return SurfaceMesh(self.point, self.triangle)

    @property
    def grid(self) -> SurfaceGrid | None:
        """The surface as stations times roll angles, or None on a free surface."""
        if self.station is None or self.radius is None or self.meridian_angle is None:
            return None
        n_roll = self.pressure.shape[1] // len(self.station)
        return SurfaceGrid(x=self.station, radius=self.radius, angle=self.meridian_angle, n_roll=n_roll)

    def chosen(self, rows: NDArray[np.int64]) -> Snapshots:
        """Return the snapshots ``rows``, each with a flow of its own."""
        return replace(
            self,
            condition=self.condition[rows],
            pressure=self.pressure[rows],
            internal_pressure=self.internal_pressure[rows],
            solved=np.ones(len(rows), dtype=bool),
            flow=np.arange(len(rows)),
            momentum_error=self.momentum_error[rows],
            repairs=self.repairs[rows],
            mass_error=None if self.mass_error is None else self.mass_error[rows],
        )

    @property
    def reference_quantities(self) -> ReferenceQuantities:
        return ReferenceQuantities(*map(float, self.reference))

    def coefficients(self) -> FloatArray:
        """Return (N, 5): C_A, C_N, C_Y, M_P, M_Y of p - p_internal."""
        grid, reference = self.grid, self.reference_quantities
        loads = (
            mesh_load_operator(self.surface, reference.moment_station)
            if grid is None
            else load_operator(grid, reference.moment_station)
        )
        net = self.pressure - self.internal_pressure[:, None]
        return coefficients_of(net, loads, self.conditions(), reference)


@dataclass(frozen=True, eq=False)
class KeptFlows:
    """The solved flows of a snapshot file, for later campaigns.

    Attributes
    ----------
    fingerprint : of the engine's inputs that they were solved with.
    flows : the flows.
    """

    fingerprint: str
    flows: tuple[Flow, ...]


def save_snapshots(snapshots: Snapshots, path: str | Path, kept_flows: KeptFlows | None = None) -> None:
    """Write ``snapshots.h5`` atomically, with the flows it was made of in the order of their keys.

    Raises
    ------
    StrainfmuError
        The file could not be written; what was there before is untouched.
    """

    def fill(file: h5py.File) -> None:
        write_record(file, snapshots, UNITS)
        if kept_flows is not None:
            group = file.create_group("flows")
            group.attrs["fingerprint"] = kept_flows.fingerprint
            for number, flow in enumerate(sorted(kept_flows.flows, key=lambda flow: flow.key)):
                _write_flow(group.create_group(f"{number:05d}"), flow)

    write_hdf5_atomically(Path(path), SCHEMA, SCHEMA_VERSION, fill)


def load_snapshots(path: str | Path) -> Snapshots:
    """Read ``snapshots.h5`` without its flows.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version.

    Example
    -------
    >>> load_snapshots("demo/snapshots.h5").pressure.shape
    (90, 8640)
    """
    return load_record(Snapshots, Path(path), SCHEMA, SCHEMA_VERSION)


def load_flows(path: Path) -> KeptFlows:
    """Read the flows of ``snapshots.h5``; a file may hold none.

    Raises
    ------
    InputError
        As :func:`load_snapshots`.
    """
    with open_hdf5(path, SCHEMA, SCHEMA_VERSION) as file:
        if "flows" not in file:
            return KeptFlows("", ())
        group = file["flows"]
        return KeptFlows(str(group.attrs["fingerprint"]), tuple(_read_flow(group[name]) for name in sorted(group)))


def _write_flow(group: h5py.Group, flow: Flow) -> None:
    group.attrs["momentum_error"] = flow.momentum_error
    group.attrs["mass_error"] = flow.mass_error
    group.attrs["repairs"] = flow.repairs
    group.create_dataset("key", data=np.array(flow.key, dtype=float))
    arrays = group.create_group("arrays")
    for name, values in flow.arrays.items():
        arrays.create_dataset(name, data=values)


def _read_flow(group: h5py.Group) -> Flow:
    return Flow(
        key=tuple(group["key"][()].tolist()),
        arrays={name: values[()] for name, values in group["arrays"].items()},
        momentum_error=float(group.attrs["momentum_error"]),
        mass_error=float(group.attrs.get("mass_error", np.nan)),
        repairs=int(group.attrs["repairs"]),
    )


def snapshots_on(snapshots: Snapshots, grid: SurfaceGrid) -> Snapshots:
    """Return ``snapshots`` at the nodes of ``grid``; the same where they are there already.

    Forces and moments of p - p_inf are kept exactly
    (:meth:`builder.aero.pressure_map.PressureMap.conservative`).

    Raises
    ------
    InputError
        The two surfaces do not coincide; the message gives the distance and what was probably meant.
    """
    source, target = snapshots.surface, mesh_of_grid(grid)
    if snapshots.grid is not None and np.array_equal(source.point, target.point):
        return snapshots
    ambient = np.array([condition.ambient_pressure for condition in snapshots.conditions()])[:, None]
    net = snapshots.pressure - ambient
    try:
        transfer = pressure_map(source, target, grid)
        check_mapping(mapping_report(transfer, source, target, net), MappingTolerances())
    except InputError as error:
        raise InputError(f"snapshots of the {snapshots.engine} engine: {error}") from error
    return replace(
        snapshots,
        pressure=ambient + transfer.conservative(net),
        point=target.point,
        triangle=target.triangle,
        station=grid.x,
        radius=grid.radius,
        meridian_angle=grid.angle,
    )
