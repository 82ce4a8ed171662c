"""Surface pressure of the independent model as a table over Mach number and total incidence.

The table holds circumferential harmonics of p / p_inf. Between the knots it is a tensor-product cubic spline. In
total incidence the knots are mirrored to negative values, where the flow is the same rolled by half a turn:
harmonic m of the pressure changes by (-1)^m. So the spline has the correct symmetry at a_T = 0 without a knot
there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from builder.aero.engine import Flow, FlowKey
from builder.aero.engines.euler import EulerEngine, pieces, pressure_at_stations
from builder.aero.engines.newtonian import NewtonianEngine
from builder.aero.euler.planes import marching_grid_of
from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.campaign_run import complete_flows
from builder.campaign.journal import Journal
from builder.campaign.scheduling import Scheduling
from builder.reporting import Reporter
from builder.vehicle.file import Vehicle
from builder.vehicle.model_entries import KNOTS, Resolution, Truth
from builder.vehicle.shape.geometry import SurfaceGrid, surface_grid
from strainfmu.arrays import BoolArray, FloatArray
from strainfmu.errors import FlowReachError, InputError
from strainfmu.flight_condition import MACH_NUMBER, FlightCondition
from strainfmu.records import load_record, save_record

SCHEMA = "strainfmu.flow_table"
SCHEMA_VERSION = 1

FLOW_TITLE = "Flow: the vehicle that flies"


@dataclass(frozen=True, eq=False, kw_only=True)
class FlowTable:
    """Pressure harmonics at knots.

    Attributes
    ----------
    vehicle : name.
    mach_knots : (n_M,) increasing [1].
    incidence_knots : (n_a,) total incidence, increasing, positive [rad].
    harmonic : (n_M, n_a, n_x, n_m) amplitudes of cos(m phi) in p / p_inf, phi from the leeward meridian [1].
    provenance : what it was made from.
    """

    vehicle: str
    mach_knots: FloatArray
    incidence_knots: FloatArray
    harmonic: FloatArray
    provenance: dict[str, Any]

    def __post_init__(self) -> None:
        n_mach, n_incidence = len(self.mach_knots), len(self.incidence_knots)
        if self.harmonic.ndim != 4 or self.harmonic.shape[:2] != (n_mach, n_incidence):
            expected = f"({n_mach}, {n_incidence}, stations, harmonics)"
            raise InputError(f"harmonic: expected shape {expected}, got {self.harmonic.shape}")
        if not np.all(np.isfinite(self.harmonic)):
            raise InputError("harmonic: not all values are finite")

    @property
    def flows(self) -> FloatArray:
        """(n_M n_a, n_x, n_m) the amplitudes of each flow."""
        return self.harmonic.reshape(-1, *self.harmonic.shape[2:])


def pressure_harmonics(flow: Flow, surface: SurfaceGrid, max_harmonic: int) -> FloatArray:
    """Return the amplitudes (n_x, max_harmonic + 1) of cos(m phi) in p/p_inf, phi from the leeward meridian.

    The discrete cosine transform over the solver's cells; harmonics that they cannot resolve are zero. A flow by
    local inclination holds pressures at the nodes, with the leeward meridian at +z.
    """
    if "pressure_ratio" in flow.arrays:
        return cosine_series(surface.as_map(flow.arrays["pressure_ratio"]), max_harmonic + 1)
    ratio = pressure_at_stations(pieces(flow), surface)
    n_phi = ratio.shape[1]
    m = np.arange(max_harmonic + 1)
    weight = np.where(m == 0, 1.0, 2.0) * (m < n_phi)
    return ratio @ np.cos(np.outer(flow.arrays["roll_angle"], m)) * weight / n_phi


def cosine_series(values: FloatArray, count: int) -> FloatArray:
    """Return the amplitudes (.., count) of cos(m phi) in ``values`` (.., n_phi) at even angles from 0; harmonics
    beyond these are zero."""
    spectrum = np.fft.rfft(values, axis=-1).real[..., :count] / values.shape[-1]
    spectrum[..., 1:] *= 2.0
    return np.pad(spectrum, [(0, 0)] * (values.ndim - 1) + [(0, count - spectrum.shape[-1])])


def flow_states(conditions: Sequence[FlightCondition]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return M, the total incidence and the roll angle of the leeward meridian [rad] (k,) of ``conditions``."""
    mach = np.array([condition.mach_number for condition in conditions])
    incidence = np.array([condition.total_incidence for condition in conditions])
    return mach, incidence, np.array([condition.leeward_roll_angle for condition in conditions])


def harmonics_at(table: FlowTable, mach: FloatArray, incidence: FloatArray) -> FloatArray:
    """Return (k, n_x, n_m) harmonics of p / p_inf at ``mach`` (k,) and total ``incidence`` (k,) [rad]."""
    n_x, n_m = table.harmonic.shape[2:]
    out = np.zeros((len(mach), n_x, n_m))
    for of_parity, weight in zip(by_parity(n_m), knot_weights(table, mach, incidence), strict=True):
        values = weight @ table.harmonic[..., of_parity].reshape(weight.shape[1], -1)
        out[:, :, of_parity] = values.reshape(len(mach), n_x, -1)
    return out


def ratio_at(table: FlowTable, conditions: Sequence[FlightCondition], roll_angle: FloatArray) -> FloatArray:
    """Return p / p_inf (k, n_x n_phi) at ``conditions``, the stations of ``table`` and ``roll_angle`` (n_phi,)
    [rad]."""
    mach, incidence, leeward = flow_states(conditions)
    harmonic = harmonics_at(table, mach, incidence)
    m = np.arange(harmonic.shape[-1])
    ratio = [h @ np.cos(np.outer(m, roll_angle - phi)) for h, phi in zip(harmonic, leeward, strict=True)]
    return np.array(ratio).reshape(len(harmonic), -1)


def by_parity(n_m: int) -> tuple[BoolArray, BoolArray]:
    """Return which of n_m harmonics are even, and which are odd."""
    is_odd = np.arange(n_m) % 2 == 1
    return ~is_odd, is_odd


def knot_weights(table: FlowTable, mach: FloatArray, incidence: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the weights (k, n_M n_a) of the flows at the knots in even harmonics, and in odd ones.

    Cubic splines in both, through flows of negative incidence as well: these are the others rolled by half a turn,
    so that even harmonics add and odd ones subtract their weights.

    Raises
    ------
    FlowReachError
        A condition is outside the knots.
    """
    for name, values, low, high in (
        (MACH_NUMBER, mach, table.mach_knots[0], table.mach_knots[-1]),
        ("total incidence [rad]", incidence, 0.0, table.incidence_knots[-1]),
    ):
        if not (np.all(values >= low - 1e-9) and np.all(values <= high + 1e-9)):
            needed = f"{values.min():.6g} to {values.max():.6g}"
            raise FlowReachError(f"{name}: {needed} needed, the flows are of {low:.6g} to {high:.6g}")
    n_mach, n_incidence = table.harmonic.shape[:2]
    along_mach = CubicSpline(table.mach_knots, np.eye(n_mach), axis=0)(mach)
    knots = np.concatenate([-table.incidence_knots[::-1], table.incidence_knots])
    weight = CubicSpline(knots, np.eye(2 * n_incidence), axis=0)(incidence)
    mirrored, direct = weight[:, :n_incidence][:, ::-1], weight[:, n_incidence:]
    even, odd = (
        (along_mach[:, :, None] * weight_of_incidence[:, None, :]).reshape(len(mach), -1)
        for weight_of_incidence in (direct + mirrored, direct - mirrored)
    )
    return even, odd


def save_flow_table(table: FlowTable, path: Path) -> str:
    """Write ``table`` to ``path`` atomically and return its content hash."""
    units = {"incidence_knots": "rad"}
    return save_record(table, path, SCHEMA, SCHEMA_VERSION, units)


ONE_MACH_NUMBER = 1e-3
"""Half the range of the flight model round a single Mach number, over that."""


def truth_knots(entry: Truth) -> tuple[FloatArray, FloatArray]:
    """Return the knots of the flight model: Mach numbers (n_M,) and positive total incidences (n_a,) [rad].

    A single Mach number, as of a wind tunnel, has two knots, :data:`ONE_MACH_NUMBER` below and above it.

    Raises
    ------
    InputError
        The vehicle file has none.
    """
    for name in KNOTS:
        if getattr(entry, name) is None:
            raise InputError(
                f"truth.{name}: entry is missing, the flows of the vehicle that flies are solved there"
            )
    mach = np.unique(np.array(entry.mach_number))
    if len(mach) == 1:
        mach = mach * np.array([1.0 - ONE_MACH_NUMBER, 1.0 + ONE_MACH_NUMBER])
    return mach, np.sort(np.round(np.radians(entry.total_incidence_deg or ()), 9))


def flow_keys(mach: FloatArray, incidence: FloatArray) -> list[FlowKey]:
    """Return the keys of flows at each pair of ``mach`` (n_M,) and ``incidence`` (n_a,) [rad]."""
    return [(round(m, 9), a) for m in mach.tolist() for a in incidence.tolist()]


def truth_surface(vehicle: Vehicle) -> SurfaceGrid:
    """Return the pressure nodes of the independent model."""
    return surface_grid(vehicle.body(), *vehicle.resolution.truth.surface_nodes)


def load_flow_table(path: Path, vehicle: Vehicle) -> FlowTable:
    """Return the flows of a file if they are flows of the independent model of ``vehicle``.

    Raises
    ------
    InputError
        The file is missing, damaged, altered, or of another schema version; or the flows are of another vehicle or
        of another ``[resolution.truth]``.
    """
    table = load_record(FlowTable, path, SCHEMA, SCHEMA_VERSION)
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
    surface = truth_surface(vehicle)
    if vehicle.truth_engine() == "newtonian":
        entries = vehicle.aerodynamics
        return NewtonianEngine(
            mesh_of_grid(surface),
            entries.stagnation or "rayleigh_pitot",
            entries.leeward or "ambient",
        )
    return EulerEngine(vehicle.body(), marching_grid_of(vehicle.resolution.truth), surface)


def flow_inputs(vehicle: Vehicle, mach: FloatArray, incidence: FloatArray) -> dict[str, Any]:
    """Return what the table of flows at these knots depends on."""
    return {
        "schema_version": SCHEMA_VERSION,
        "engine": truth_engine(vehicle).inputs(),
        MACH_NUMBER: mach.tolist(),
        "total_incidence": incidence.tolist(),
        "resolution": vehicle.resolution.truth.model_dump(),
    }


def solved_flows(
    vehicle: Vehicle,
    mach: FloatArray,
    incidence: FloatArray,
    reporter: Reporter,
    *,
    failed: dict[FlowKey, str] | None = None,
    journal: Journal | None = None,
    scheduling: Scheduling | None = None,
) -> FlowTable:
    """Solve the flows at each pair of ``mach`` (n_M,) and positive total ``incidence`` (n_a,) [rad], and return
    their table.

    With ``failed`` those out of the solver's reach are listed there, and the table ends before them.

    Raises
    ------
    FlowReachError
        The solver does not reach one of them; or with ``failed`` less than two Mach numbers or two incidences.
    """
    keys, how = flow_keys(mach, incidence), dict[str, Any](journal=journal, scheduling=scheduling)
    flows, _ = complete_flows(truth_engine(vehicle), keys, reporter, FLOW_TITLE, failed=failed, **how)
    if failed:
        solved = np.array([key in flows for key in keys]).reshape(len(mach), -1)
        rows, columns = solved_knots(solved)
        if rows.sum() < 2 or columns.sum() < 2:
            raise FlowReachError(f"flows of the independent model: {next(iter(failed.values()))}")
        mach, incidence = mach[rows], incidence[columns]
        reporter.note(
            f"{len(failed)} of {solved.size} flows are out of the solver's reach: flights from M {mach[0]:.3g} to "
            f"{mach[-1]:.3g}, total incidence up to {np.degrees(incidence[-1]):.3g} deg"
        )
    return flow_table(vehicle.name, truth_surface(vehicle), vehicle.resolution.truth, mach, incidence, flows)


def solved_knots(solved: BoolArray) -> tuple[BoolArray, BoolArray]:
    """Return rows and columns of ``solved`` (n_M, n_a) to keep, so that all between them is true.

    The outermost row or column with the largest fraction of failures goes first: lowest or highest Mach number,
    largest incidence.
    """
    rows, columns = np.ones(solved.shape[0], dtype=bool), np.ones(solved.shape[1], dtype=bool)
    while rows.any() and columns.any() and not solved[np.ix_(rows, columns)].all():
        row_numbers, column_numbers = np.flatnonzero(rows), np.flatnonzero(columns)
        failed = ~solved[np.ix_(rows, columns)]
        fractions = [failed[0].mean(), failed[-1].mean(), failed[:, -1].mean()]
        if max(fractions) == 0.0:  # a hole in the middle: the largest incidence goes until it is at the border
            fractions[2] = 1.0
        worst = int(np.argmax(fractions))
        if worst == 2:
            columns[column_numbers[-1]] = False
        else:
            rows[row_numbers[0 if worst == 0 else -1]] = False
    return rows, columns


def flow_table(
    name: str,
    surface: SurfaceGrid,
    resolution: Resolution,
    mach: FloatArray,
    incidence: FloatArray,
    flows: Mapping[FlowKey, Flow],
) -> FlowTable:
    """Return the table of ``flows``, a flow for each pair of ``mach`` (n_M,) and positive ``incidence`` (n_a,)
    [rad]."""
    harmonic = [
        pressure_harmonics(flows[key], surface, resolution.harmonics) for key in flow_keys(mach, incidence)
    ]
    return FlowTable(
        vehicle=name,
        mach_knots=mach,
        incidence_knots=incidence,
        harmonic=np.reshape(harmonic, (len(mach), len(incidence), *harmonic[0].shape)),
        provenance={"resolution": resolution.model_dump(), "flows": len(flows)},
    )
