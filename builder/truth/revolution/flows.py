"""The flows of the independent model: where they are solved, with which engine, and their table."""

from __future__ import annotations

from collections.abc import Mapping
from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.euler import EulerEngine
from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.euler.planes.marching_grid import marching_grid_of
from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.journal import Journal
from builder.campaign.run import complete_flows
from builder.campaign.scheduling import Scheduling
from builder.reporting import Reporter
from builder.truth.revolution.flow_table import FlowTable, load_flow_table, pressure_harmonics
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import KNOTS
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.arrays import FloatArray
from strainfmu.errors import InputError

ONE_MACH_NUMBER = 1e-3
"""Half the range of the flight model round a single Mach number, over that."""


def truth_knots(vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Return the knots of the flight model: Mach numbers (n_M,) and total incidences (n_a,) [rad] from 0.

    A single Mach number, as of a wind tunnel, has two knots, :data:`ONE_MACH_NUMBER` below and above it.

    Raises
    ------
    InputError
        The vehicle file has none.
    """
    entry = vehicle.truth
    for name in KNOTS:
        if getattr(entry, name) is None:
            raise InputError(
                f"truth.{name}: entry is missing, the flows of the vehicle that flies are solved there"
            )
    mach = np.unique(np.array(entry.mach_number))
    if len(mach) == 1:
        mach = mach * np.array([1.0 - ONE_MACH_NUMBER, 1.0 + ONE_MACH_NUMBER])
    incidence = sorted(round(radians(angle), 9) for angle in entry.total_incidence_deg or ())
    return mach, np.array([0.0, *incidence])


def truth_keys(vehicle: Vehicle) -> list[FlowKey]:
    """Return the (M, a_T [rad]) at which the independent model's flows are solved."""
    mach, incidence = truth_knots(vehicle)
    return flow_keys(mach, incidence[1:])


def flow_keys(mach: FloatArray, incidence: FloatArray) -> list[FlowKey]:
    """Return the keys of flows at each pair of ``mach`` (n_M,) and ``incidence`` (n_a,) [rad]."""
    return [(round(m, 9), a) for m in mach.tolist() for a in incidence.tolist()]


def truth_surface(vehicle: Vehicle) -> SurfaceGrid:
    """Return the pressure nodes of the independent model."""
    settings = vehicle.resolution.truth
    return surface_grid(vehicle.body(), settings.surface_stations, settings.surface_roll_angles)


def load_truth_flows(path: Path, vehicle: Vehicle) -> FlowTable:
    """Return the flows of a file if they are flows of the independent model of ``vehicle``.

    Raises
    ------
    InputError
        As :func:`~builder.truth.revolution.flow_table.load_flow_table`, or the flows are of another vehicle or of
        another ``[resolution.truth]``.
    """
    table = load_flow_table(path)
    stations, harmonics = len(truth_surface(vehicle).x), vehicle.resolution.truth.harmonics
    got = table.harmonic.shape[2], table.harmonic.shape[3] - 1
    if table.vehicle != vehicle.name or got != (stations, harmonics):
        raise InputError(
            f"{path}: expected flows of '{vehicle.name}' at {stations} stations with {harmonics} harmonics "
            f"([resolution.truth]), got flows of '{table.vehicle}' at {got[0]} with {got[1]}"
        )
    return table


def truth_engine(vehicle: Vehicle) -> EulerEngine | NewtonianEngine:
    """Return the flow solver of the independent model, of :meth:`Vehicle.truth_engine`."""
    if vehicle.truth_engine() == "newtonian":
        entries = vehicle.aerodynamics
        return NewtonianEngine(
            mesh_of_grid(truth_surface(vehicle)),
            entries.stagnation or "rayleigh_pitot",
            entries.leeward or "ambient",
        )
    return EulerEngine(vehicle.body(), marching_grid_of(vehicle.resolution.truth), truth_surface(vehicle))


def truth_inputs(vehicle: Vehicle) -> dict[str, Any]:
    """Return what the flow table depends on."""
    return {
        "engine": truth_engine(vehicle).inputs(),
        "truth": vehicle.truth.model_dump(include=set(KNOTS)),
        "resolution": vehicle.resolution.truth.model_dump(),
    }


def independent_flows(
    vehicle: Vehicle, reporter: Reporter, journal: Journal | None = None, scheduling: Scheduling | None = None
) -> FlowTable:
    """Solve the flows of the independent model and return their table.

    Raises
    ------
    InputError
        A condition is outside the solver's reach.
    """
    mach, incidence = truth_knots(vehicle)
    how: dict[str, Any] = {"title": "Flow: the vehicle that flies", "journal": journal, "scheduling": scheduling}
    flows = solved_flows(vehicle, mach, incidence[1:], reporter, **how)
    return flow_table(vehicle, mach, incidence[1:], flows)


def solved_flows(
    vehicle: Vehicle,
    mach: FloatArray,
    incidence: FloatArray,
    reporter: Reporter,
    *,
    title: str,
    journal: Journal | None = None,
    scheduling: Scheduling | None = None,
    failed: dict[FlowKey, str] | None = None,
) -> dict[FlowKey, Flow]:
    """Solve the flows at each pair of ``mach`` (n_M,) and ``incidence`` (n_a,) [rad]; why some are beyond the
    solver's reach goes to ``failed``, or is raised.

    Raises
    ------
    InputError
        A condition is outside the solver's reach.
    """
    return complete_flows(
        engine=truth_engine(vehicle),
        keys=flow_keys(mach, incidence),
        journal=journal,
        known={},
        scheduling=scheduling or Scheduling(),
        reporter=reporter,
        title=title,
        failed=failed,
    )[0]


def flow_table(
    vehicle: Vehicle, mach: FloatArray, incidence: FloatArray, flows: Mapping[FlowKey, Flow]
) -> FlowTable:
    """Return the table of ``flows``, a flow for each pair of ``mach`` (n_M,) and positive ``incidence`` (n_a,)
    [rad]."""
    surface, resolution = truth_surface(vehicle), vehicle.resolution.truth
    harmonic = [
        pressure_harmonics(flows[key], surface, resolution.harmonics) for key in flow_keys(mach, incidence)
    ]
    return FlowTable(
        vehicle=vehicle.name,
        mach_knots=mach,
        incidence_knots=incidence,
        harmonic=np.reshape(harmonic, (len(mach), len(incidence), *harmonic[0].shape)),
        provenance={"resolution": resolution.model_dump(), "flows": len(flows)},
    )
