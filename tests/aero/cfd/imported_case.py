"""The conditions of the imported snapshots, and the comparison of loads on different meshes."""

from math import radians
from pathlib import Path

import numpy as np

from builder.aero.cfd.results_table import TableEngine, table_engine
from builder.aero.load_operator import coefficient_scale, load_operator
from builder.aero.surface.mesh import mesh_of_grid
from builder.campaign.snapshots import Snapshots
from builder.vehicle.shape.geometry import SurfaceGrid
from strainfmu.arrays import FloatArray
from strainfmu.flight_condition import FlightCondition

CONDITION = FlightCondition(5.0, radians(6.0), radians(5.0), 20e3)
SYMMETRIC = FlightCondition(5.0, CONDITION.total_incidence, 0.0, 20e3)

TOLERANCE = 0.002
"""0.2 % of each coefficient. Moments about mid-body are small differences: their scale is the resultant force's
moment about the nose, so that 0.2 % is a shift of the centre of pressure by 0.2 % of the moment station."""


def table_on(manifest: Path, grid: SurfaceGrid) -> TableEngine:
    """Return the engine of ``manifest`` on the surface of ``grid``."""
    return table_engine(manifest, mesh_of_grid(grid))


def imported_ratio(manifest: Path, grid: SurfaceGrid, condition: FlightCondition) -> FloatArray:
    """Return p/p_inf at the nodes of ``grid`` as imported for ``condition``."""
    engine = table_on(manifest, grid)
    return engine.pressure_ratio(engine.solve(engine.flow_key(condition)), condition)


def coefficient_error(
    ratio: FloatArray, grid: SurfaceGrid, snapshots: Snapshots, number: int
) -> tuple[FloatArray, FloatArray]:
    """Return the errors (5,) of the coefficients of p/p_inf against snapshot ``number``, and their scales."""
    condition, reference = snapshots.conditions()[number], snapshots.reference_quantities
    net = (ratio - 1.0) * condition.ambient_pressure
    loads = load_operator(grid, reference.moment_station) @ net
    truth = snapshots.coefficients()[number]
    lateral = np.hypot(truth[1], truth[2])
    scale = np.abs(truth)
    scale[1:3] = np.maximum(scale[1:3], lateral / 10.0)
    scale[3:] = lateral * reference.moment_station / reference.length
    return loads * coefficient_scale(condition.dynamic_pressure, reference) - truth, scale


def manifest_text(case: str = "", /, **entries: object) -> str:
    """Return a manifest of one case at :data:`CONDITION`; ``case`` replaces the case's own entries."""
    settings = {"quantity": "p", "unit": "Pa", "length_unit": "m", **entries}
    lines = [f"{key} = {_toml(value)}" for key, value in settings.items() if value is not None]
    return "\n".join(lines) + "\n\n" + (case or case_text())


def case_text(file: str = "field.vtu", **entries: float) -> str:
    """Return one case of a manifest."""
    values = {
        "mach_number": 5.0,
        "angle_of_attack_deg": 6.0,
        "sideslip_angle_deg": 5.0,
        "altitude_km": 20.0,
        **entries,
    }
    return f'[[case]]\nfile = "{file}"\n' + "".join(f"{key} = {value!r}\n" for key, value in values.items())


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)
